"""Several cameras' views as one: heights, colours, clouds, and a camera that falls silent."""

from __future__ import annotations

from array import array
from collections.abc import Sequence

import numpy as np
import pytest

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.errors import UnfitFrameError
from cliport_perception.frame_processor import FrameProducts
from cliport_perception.fusion import CameraFusion, fused

S = 1_000_000_000
SPACE = WorkspaceSpec()


def view(
    cells: dict[tuple[int, int], tuple[float, Sequence[int]]], stamp_s: float = 10.0, cloud: bytes | None = None
) -> FrameProducts:
    """What one camera sees: height [m] and colour of some cells, nothing elsewhere."""
    color: np.ndarray = np.zeros((*SPACE.shape, 3), np.uint8)
    height: np.ndarray = np.zeros(SPACE.shape, np.float32)
    valid: np.ndarray = np.zeros(SPACE.shape, bool)
    for cell, (z, rgb) in cells.items():
        color[cell], height[cell], valid[cell] = rgb, z, True
    stamp_ns = round(stamp_s * S)
    buffer = None if cloud is None else array("B", cloud)
    return FrameProducts(Heightmap(color, height, valid, SPACE, stamp_ns), buffer, stamp_ns)


def test_the_highest_point_wins_and_colours_are_averaged() -> None:
    first = view({(3, 4): (0.02, (10, 20, 31)), (5, 6): (-0.01, (1, 2, 3))}).heightmap
    second = view({(3, 4): (0.05, (20, 21, 40)), (7, 8): (0.1, (9, 9, 9))}, 9.5).heightmap
    both = fused([first, second])
    assert both.height[3, 4] == np.float32(0.05) and both.color[3, 4].tolist() == [15, 20, 36]
    assert both.height[5, 6] == np.float32(-0.01), "what nobody else saw counts as it is, also below zero"
    assert both.color[5, 6].tolist() == [1, 2, 3] and both.color[7, 8].tolist() == [9, 9, 9]
    assert both.valid.sum() == 3 and both.stamp_ns == 9.5 * S
    assert not both.height[~both.valid].any() and not both.color[~both.valid].any()


def test_one_camera_alone_is_handed_on_as_it_is() -> None:
    products = view({(3, 4): (0.02, (1, 2, 3))}, cloud=b"a cloud")
    assert CameraFusion(1, 1.0).put(1, products) is products


def test_the_first_cameras_frames_set_the_pace() -> None:
    fusion = CameraFusion(2, 1.0)
    assert fusion.put(2, view({(1, 1): (0.1, (5, 5, 5))}, 9.9, b"behind")) is None
    seen = fusion.put(1, view({(2, 2): (0.2, (7, 7, 7))}, 10.0, b"before"))
    assert seen is not None and seen.cloud is not None
    assert seen.heightmap.valid[1, 1] and seen.heightmap.valid[2, 2]
    assert seen.cloud.tobytes() == b"beforebehind"
    assert (seen.heightmap.stamp_ns, seen.cloud_stamp_ns) == (9.9 * S, 9.9 * S)


def test_a_cloud_comes_once_all_cameras_gave_one() -> None:
    fusion = CameraFusion(2, 1.0)
    fusion.put(2, view({}, 10.0))
    for cloud in (None, b"before"):
        seen = fusion.put(1, view({}, 10.0, cloud))
        assert seen is not None and seen.cloud is None
    fusion.put(2, view({}, 10.1, b"behind"))
    fusion.put(2, view({}, 10.4))
    seen = fusion.put(1, view({}, 10.5, b"before"))
    assert seen is not None and (seen.cloud_stamp_ns, seen.heightmap.stamp_ns) == (10.1 * S, 10.4 * S)
    last = fusion.put(1, view({}, 10.6))
    assert last is not None and last.cloud is None, "none is due"


def test_a_camera_that_never_came_is_named() -> None:
    fusion = CameraFusion(3, 1.0)
    fusion.put(2, view({}))
    with pytest.raises(UnfitFrameError, match="camera 3 has given nothing usable yet"):
        fusion.put(1, view({}))


@pytest.mark.parametrize(
    ("stamp", "words"),
    [
        (8.9, "camera 2's newest view is 1.1 s older than camera 1's (at most 1 s)"),
        (11.1, "camera 2's newest view is 1.1 s newer than camera 1's"),
        (9.1, ""),
        (10.9, ""),
    ],
)
def test_a_camera_that_fell_silent_is_named(stamp: float, words: str) -> None:
    fusion = CameraFusion(2, 1.0)
    fusion.put(2, view({}, stamp))
    if not words:
        assert fusion.put(1, view({})) is not None
        return
    with pytest.raises(UnfitFrameError) as caught:
        fusion.put(1, view({}))
    assert words in str(caught.value)


def test_what_all_together_see_too_little_of_is_refused() -> None:
    half = {(row, col): (0.0, (1, 2, 3)) for row in range(SPACE.shape[0] // 2) for col in range(SPACE.shape[1])}
    fusion = CameraFusion(2, 1.0, 0.6)
    assert fusion.put(2, view(half)) is None
    with pytest.raises(UnfitFrameError, match=r"depth is valid in 50\.0 % of the workspace \(at least 60 % needed\)"):
        fusion.put(1, view(half))
    other = {(SPACE.shape[0] - 1 - row, col): what for (row, col), what in half.items()}
    fusion.put(2, view(other))
    assert fusion.put(1, view(half)) is not None
