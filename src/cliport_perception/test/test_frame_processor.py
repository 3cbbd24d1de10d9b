from __future__ import annotations

import cv2
import numpy as np
import pytest

from cliport_core import ImageError, Pose, WorkspaceSpec
from cliport_perception import CameraModel, UnfitFrameError
from cliport_perception.camera_health import CameraHealth, HealthLimits
from cliport_perception.clouds import CloudBuilder, CloudRegion
from cliport_perception.frame_processor import FrameProcessor

MS = 1_000_000


def make(heightmap_hz: float = 10.0, points_hz: float = 2.0) -> FrameProcessor:
    return FrameProcessor(WorkspaceSpec(), CameraHealth({}, HealthLimits()), heightmap_hz, points_hz)


def test_each_product_keeps_its_rate(box_scene) -> None:
    processor = make()
    color, depth, camera, pose = box_scene
    heightmaps = clouds = 0
    for i in range(20):  # two thirds of a second at 30 Hz
        stamp = 5_000 * MS + i * 33 * MS
        if processor.admits(stamp, stamp + 10 * MS):
            products = processor.process(color, depth, camera, pose, stamp)
            assert products.heightmap.stamp_ns == stamp
            heightmaps += 1
            clouds += products.cloud is not None
    assert heightmaps == 7
    assert clouds == 2


def test_no_rate_admits_every_frame(box_scene) -> None:
    processor = make(heightmap_hz=0.0, points_hz=0.0)
    for _ in range(2):
        assert processor.admits(5_000 * MS, 5_000 * MS)
        assert processor.process(*box_scene, 5_000 * MS).cloud is not None


def test_the_cloud_made_beside_the_heightmap_is_the_frames_own(box_scene) -> None:
    processor = make(0.0, 0.0)
    color, depth, camera, pose = box_scene
    plain = CloudBuilder(camera, pose, CloudRegion.around(WorkspaceSpec()))
    for number in range(4):
        frame = color[::-1] if number % 2 else color, depth + np.float32(0.001 * number)
        assert processor.process(*frame, camera, pose, number).cloud == plain.build(*frame)


def test_the_cloud_of_a_refused_frame_is_neither_shown_nor_counted(box_scene) -> None:
    processor = make()
    color, depth, camera, pose = box_scene
    for _ in range(3):
        with pytest.raises(UnfitFrameError, match=r"valid in 0\.0 %"):
            processor.process(color, np.full_like(depth, np.nan), camera, pose, 0)
    cloud = processor.process(*box_scene, 0).cloud
    assert cloud == CloudBuilder(camera, pose, CloudRegion.around(WorkspaceSpec())).build(color, depth)
    with pytest.raises(ImageError, match="depth image is"):
        processor.process(color, depth[1:], camera, pose, 1000 * MS)


def test_a_clock_reset_does_not_stop_it(box_scene) -> None:
    processor = make()
    processor.process(*box_scene, 90_000 * MS)
    assert processor.admits(10 * MS, 20 * MS)
    assert processor.process(*box_scene, 10 * MS).cloud is not None


def test_old_frames_and_empty_depth_are_refused(box_scene) -> None:
    processor = make()
    with pytest.raises(UnfitFrameError, match=r"2\.0 s old"):
        processor.admits(1000 * MS, 3000 * MS)
    empty = np.full_like(box_scene.depth, np.nan)
    with pytest.raises(UnfitFrameError, match=r"valid in 0\.0 %"):
        processor.process(box_scene.color, empty, box_scene.camera, box_scene.camera_in_base, 0)
    assert processor.admits(0, 0)  # the refused frame did not use up the rate


@pytest.mark.parametrize(("factor", "words"), [(0.001, "0.001"), (10.0, "10"), (4.0, "4")])
def test_depth_in_another_unit_is_named(box_scene, factor: float, words: str) -> None:
    depth = (box_scene.depth * np.float32(factor)).astype(np.float32)
    with pytest.raises(UnfitFrameError, match=f"depth is about {words} times what this camera, as calibrated, sees"):
        make().process(box_scene.color, depth, box_scene.camera, box_scene.camera_in_base, 0)


@pytest.mark.parametrize("distance", [0.08, 0.1, 0.3])
def test_something_before_the_camera_is_no_unit(box_scene, distance: float) -> None:
    depth = np.full_like(box_scene.depth, np.float32(distance))
    with pytest.raises(UnfitFrameError, match="is the camera's view blocked"):
        make().process(box_scene.color, depth, box_scene.camera, box_scene.camera_in_base, 0)


@pytest.mark.parametrize(("limit", "refused"), [(0.002, True), (0.0, False)])
def test_surroundings_that_moved_as_one_are_refused_unless_the_watch_is_off(limit: float, refused: bool) -> None:
    rng, lens = np.random.default_rng(0), CameraModel(480, 270, 270.0, 270.0, 240.0, 135.0)
    spots = rng.uniform(40, 200, (14, 24, 1)).astype(np.float32)
    color = np.repeat(cv2.resize(spots, (480, 270), interpolation=cv2.INTER_CUBIC)[..., None], 3, axis=-1)
    color = color.clip(0, 255).astype(np.uint8)
    place, depth = Pose.looking_at((0.5, 0.01, 0.9), (0.45, 0.0, 0.0)), np.full((270, 480), 0.9, np.float32)
    health = CameraHealth({}, HealthLimits())
    processor = FrameProcessor(WorkspaceSpec(), health, 10.0, 2.0, max_picture_motion=limit)
    seen = [np.roll(color, shift, axis=1) for shift in (0, 0, 4, 4, 4)]
    words = []
    for second, picture in enumerate(seen):
        try:
            processor.process(picture, depth, lens, place, second * 1000 * MS)
            words.append("")
        except UnfitFrameError as error:
            words.append(str(error))
    assert words[:3] == ["", "", ""]
    assert bool(words[-1].startswith("the camera was moved: all that it sees around")) is refused


def test_a_moved_camera_is_followed(box_scene, cast_scene) -> None:
    processor = make(0.0, 0.0)
    first = processor.process(*box_scene, 0).heightmap
    moved = cast_scene(box_scene.camera, Pose.looking_at((1.2, -0.3, 1.0), (0.45, 0.0, 0.0)))
    second = processor.process(*moved, 1).heightmap
    both = first.valid & second.valid
    assert np.median(np.abs(first.height - second.height)[both]) < 1e-4
