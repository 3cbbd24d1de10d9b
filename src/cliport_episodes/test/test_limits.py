"""Numbers that decide, to either side of each: what is a bias, another setup, a box, a full disk."""

from __future__ import annotations

import errno
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import Merged, _counts
from cliport_episodes.demonstration import NOT_MOVED, PixelBox, StepRecord
from cliport_episodes.disk import disk_errors
from cliport_episodes.edits import Edits
from cliport_episodes.errors import BagError, DataSetError, DiskError, DiskFullError, RecordError, SetupError
from cliport_episodes.statistics import Statistics

# Squares of 10 cm are its cells: three rows from right to left, three columns from near to far.
COARSE = WorkspaceSpec(x_min=0.0, x_max=0.3, y_min=0.0, y_max=0.3, pixel_size=0.1)
EVEN = [[2, 2, 2], [2, 2, 2], [2, 2, 2]]


def statistics(picks: Any = EVEN, outside: int = 0, **counted: dict[str, int]) -> Statistics:
    empty: dict[str, dict[str, int]] = {
        name: {} for name in ("success", "instructions", "color_words", "primitives", "sources")
    }
    grids = np.array(picks, np.int32), np.array(EVEN, np.int32)
    return Statistics(
        COARSE, n_episodes=1, n_steps=9, n_executed=9, **{**empty, **counted},
        picks=grids[0], places=grids[1], outside=outside,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("picks", "said"),
    [
        (EVEN, []),
        ([[0, 0, 0], [0, 9, 0], [0, 0, 0]], []),  # nine are too few to say
        ([[1, 0, 0], [3, 2, 1], [1, 1, 1]], []),  # one of ten to the right is enough
        ([[0, 0, 0], [3, 3, 1], [1, 1, 1]], ["0 % of the picks lie in the right half of the table: pick there too"]),
        ([[2, 3, 2], [2, 6, 2], [1, 1, 0]], []),
        ([[2, 3, 2], [2, 9, 2], [1, 1, 0]], ["9 % of the picks lie in the left half of the table: pick there too"]),
        ([[3, 3, 0], [3, 3, 1], [3, 3, 0]], ["5 % of the picks lie in the far half of the table: pick there too"]),
        ([[0, 3, 3], [1, 3, 3], [0, 3, 3]], ["5 % of the picks lie in the near half of the table: pick there too"]),
        ([[1, 0, 1], [0, 6, 0], [1, 0, 1]], []),  # six of ten in one square
        ([[1, 0, 1], [0, 7, 0], [1, 0, 1]], ["64 % of the picks lie in one square of 10 cm"]),
    ],
)
def test_biases_of_positions(picks: list[list[int]], said: list[str]) -> None:
    assert list(statistics(picks).biases()) == said


@pytest.mark.parametrize(
    ("counted", "said"),
    [
        ({"instructions": {"a": 9}}, []),
        ({"instructions": {"a": 6, "b": 4}}, []),
        ({"instructions": {"a": 7, "b": 3}}, ["70 % of what is asked for has the instruction 'a': ask for others too"]),
        ({"color_words": {"red": 10}}, ["100 % of what is asked for has the colour 'red': ask for others too"]),
    ],
)
def test_biases_of_words(counted: dict[str, dict[str, int]], said: list[str]) -> None:
    assert list(statistics(**counted).biases()) == said


def test_statistics_as_plain_values() -> None:
    values = statistics(outside=2).to_dict()
    assert (values["picks"], values["places"], values["square"], values["n_steps"]) == (EVEN, EVEN, 0.1, 9)
    assert values["biases"] == ["2 poses lie outside the workspace: they cannot be learned"]


def shifted(setup: CaptureSetup, metres: float) -> CaptureSetup:
    return replace(setup, camera_in_base=Pose.from_xyz_rpy((0.0, metres, 0.0), (0, 0, 0)) @ setup.camera_in_base)


def turned(setup: CaptureSetup, degrees: float) -> CaptureSetup:
    turn = Pose.from_xyz_rpy((0, 0, 0), (math.radians(degrees), 0, 0))
    return replace(setup, camera_in_base=setup.camera_in_base @ turn)


def with_camera(setup: CaptureSetup, **values: Any) -> CaptureSetup:
    return replace(setup, camera=replace(setup.camera, **values))


def test_a_setup_is_another_beyond_the_noise_of_a_calibration(setup: CaptureSetup) -> None:
    """1 mm, a tenth of a degree, a tenth of a pixel, 1e-4 of a coefficient."""
    for same in (shifted(setup, 0.0009), turned(setup, 0.09), with_camera(setup, distortion=(9e-5, 0, 0, 0, -9e-5))):
        assert setup.differences(same) == same.differences(setup) == []
    for other, said in (
        (shifted(setup, 0.0011), "the camera stands 1 mm elsewhere"),
        (shifted(setup, 0.6), "the camera stands 600 mm elsewhere"),
        (turned(setup, 0.11), "the camera is turned by 0.1 degrees"),
        (with_camera(setup, distortion=(0.0, 0.0, 0.0, 0.0, -1.1e-4)), "another lens distortion"),
        (replace(setup, base_frame="base"), "base_frame 'panda_link0' here, 'base' there"),
        (with_camera(setup, width=65), "images of 64x48 pixels here, 65x48 there"),
        (with_camera(setup, height=49), "images of 64x48 pixels here, 64x49 there"),
    ):
        assert setup.differences(other) == [said]
    for name in ("fx", "fy", "cx", "cy"):
        value = getattr(setup.camera, name)
        assert setup.differences(with_camera(setup, **{name: value + 0.09})) == []
        found = setup.differences(with_camera(setup, **{name: value + 0.11}))
        assert found == [f"camera {name} {value:.2f} pixels here, {value + 0.11:.2f} there"]


def test_a_lens_model_matters_where_the_lens_distorts(setup: CaptureSetup) -> None:
    plumb, rational = (
        with_camera(setup, distortion=values, distortion_model=model)
        for values, model in (((0.1, 0, 0, 0, 0), "plumb_bob"), ((0.1, 0, 0, 0, 0, 0, 0, 0), "rational_polynomial"))
    )
    assert plumb.differences(rational) == ["another lens distortion"] and plumb.differences(plumb) == []
    straight = with_camera(setup, distortion=(0.0,) * 8, distortion_model="rational_polynomial")
    assert setup.differences(straight) == []


def test_a_setup_as_plain_values(setup: CaptureSetup) -> None:
    values = setup.to_dict()
    assert values["camera"] == {
        "frame": "camera_optical", "width": 64, "height": 48, "K": [60.0, 0.0, 31.5, 0.0, 60.0, 23.5, 0.0, 0.0, 1.0],
        "D": list(setup.camera.distortion), "model": "plumb_bob",
    }  # fmt: skip
    back = CaptureSetup.from_dict(values)
    assert (back.camera, back.workspace, back.base_frame) == (setup.camera, setup.workspace, "panda_link0")
    del values["camera_in_base"]["quaternion_xyzw"]
    with pytest.raises(SetupError, match=r"^the setup lacks 'quaternion_xyzw'$"):
        CaptureSetup.from_dict(values)


@pytest.mark.parametrize(
    ("edges", "good"),
    [
        ((0, 0, 1, 1), True),
        ((-1, 0, 1, 1), False),
        ((0, -1, 1, 1), False),
        ((1, 0, 1, 1), False),
        ((0, 1, 1, 1), False),
    ],
)
def test_a_box_holds_a_pixel(edges: tuple[int, int, int, int], good: bool) -> None:
    if good:
        PixelBox(*edges)
        return
    with pytest.raises(RecordError, match="holds no pixel: draw it anew"):
        PixelBox(*edges)


def test_a_rotation_is_a_bin(record: StepRecord) -> None:
    replace(record, pick_rotation=0, place_rotation=35)
    with pytest.raises(RecordError, match=r"^place_rotation is 36: it must be one of 0\.\.35$"):
        replace(record, place_rotation=36)
    for centroid in ((0.0, 0.0, math.inf), (math.nan, 0.0, 0.0)):
        with pytest.raises(RecordError, match="step 0 has a pose or a measurement that is not a finite number"):
            replace(record, result=ActionResult(Outcome.SUCCEEDED, "", centroid, 0.0))


def test_an_ending_in_words(record: StepRecord) -> None:
    assert record.ending == "grasp missed: nothing between the fingers"
    assert replace(record, result=ActionResult(Outcome.SUCCEEDED, "")).ending == "succeeded"
    assert replace(record, result=None).ending == NOT_MOVED == "recorded without moving"


@pytest.mark.parametrize(
    ("first", "last", "kept"),
    [(None, None, [0, 1, 2, 3]), (1, None, [1, 2, 3]), (None, 2, [0, 1, 2]), (1, 2, [1, 2]), (0, 0, [0])],
)
def test_edits_keep_from_the_first_to_the_last(first: int | None, last: int | None, kept: list[int]) -> None:
    assert [step for step in range(4) if Edits(first=first, last=last).keeps(step)] == kept


@pytest.mark.parametrize(
    ("edits", "data"),
    [
        (Edits(), {"success": "unmarked", "finished": "false"}),
        (Edits(success=True, finished=True), {"success": "true", "finished": "true"}),
        (Edits(success=False, first=0), {"success": "false", "finished": "false", "first": "0"}),
        (
            Edits(None, False, {2: "b", 1: "ä"}, None, 3, "seen", 7),
            {"success": "unmarked", "finished": "false", "instructions": '{"1": "ä", "2": "b"}', "last": "3",
             "notes": "seen", "edited_ns": "7"},
        ),
    ],
)  # fmt: skip
def test_edits_as_text_and_back(edits: Edits, data: dict[str, str]) -> None:
    written = edits.to_custom_data()
    assert written == {"cliport_format": "1", **data}
    assert Edits.from_custom_data(written) == edits
    assert Edits.from_custom_data({**written, "other": "kept"}) == replace(edits, others={"other": "kept"})


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"cliport_format": "2"}, "it has format 2, and 1 is known here: update this software"),
        ({"success": "maybe"}, r"what was edited cannot be read \(KeyError: 'maybe'\)"),
        ({"first": "one"}, r"what was edited cannot be read \(ValueError"),
        ({"instructions": "[]"}, r"what was edited cannot be read \(AttributeError"),
        ({"instructions": "7"}, r"what was edited cannot be read \(AttributeError"),
    ],
)
def test_edits_that_cannot_be_read(change: dict[str, str], said: str) -> None:
    with pytest.raises(BagError, match=said):
        Edits.from_custom_data({**Edits().to_custom_data(), **change})


@pytest.mark.parametrize(
    ("number", "kind", "said"),
    [
        (errno.ENOSPC, DiskFullError, "No space left on device. .* Free some space and do the last step again"),
        (errno.EDQUOT, DiskFullError, "Free some space"),
        (errno.EFBIG, DiskFullError, "Free some space"),
        (errno.EACCES, DiskError, "Permission denied. .* Check the folder and its permissions"),
        (None, DiskError, "cannot write '/a': gone. What was saved before is whole. Check the folder"),
    ],
)
def test_what_a_disk_refuses_is_said_with_its_remedy(number: int | None, kind: type[DiskError], said: str) -> None:
    with pytest.raises(DiskError, match=said) as caught, disk_errors(Path("/a")):
        raise OSError("gone") if number is None else OSError(number, "x")
    assert type(caught.value) is kind


@pytest.mark.parametrize(
    ("parts", "available", "counts"),
    [
        ({"a": 0.5, "b": 0.5}, 5, {"a": 2, "b": 3}),
        ({"a": 0.8, "b": 0.1}, 10, {"a": 8, "b": 1}),
        ({"a": 0.7, "b": 0.2, "c": 0.1}, 10, {"a": 7, "b": 2, "c": 1}),
        ({"a": 1.0}, 3, {"a": 3}),
        ({"a": 1, "b": 1}, 2, {"a": 1, "b": 1}),
        ({"a": 2}, 3, {"a": 2}),
        ({"a": 1, "b": 2}, 2, "2 episodes with steps are too few"),
        ({"a": 0.9, "b": 0.1}, 4, "4 episodes with steps are too few"),
        ({"a": 0.9, "b": 0.2}, 9, "give shares that sum to 1 at most, or whole numbers"),
        ({"a": 1.5, "b": 1}, 9, "give shares that sum to 1"),
        ({"a": 0.0, "b": 1.0}, 9, "give shares that sum to 1"),
        ({"a": 3, "b": -1}, 9, "give shares that sum to 1"),
        ({}, 9, "give shares that sum to 1"),
    ],
)
def test_shares_and_numbers_of_a_split(parts: dict[str, float], available: int, counts: dict[str, int] | str) -> None:
    if isinstance(counts, dict):
        assert _counts(parts, available) == counts
        return
    with pytest.raises(DataSetError, match=counts):
        _counts(parts, available)


def test_a_merge_in_words() -> None:
    assert Merged(("a", "b"), (), (), 2).words("other") == "2 of the 2 episodes of other are added"
    assert Merged((), (), (), 2).words("x") == "0 of the 2 episodes of x are added; the others were here already"
