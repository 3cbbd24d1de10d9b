"""A depth camera that is off: measured, written into the calibration, and corrected wherever depth is used."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
import pytest
import yaml

from cliport_core import Heightmap, Pose, WorkspaceSpec
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.calibration_file import (
    CalibrationRecord,
    Method,
    load_calibration,
    save_calibration,
)
from cliport_perception.calibration.correction_watch import CorrectionWatch
from cliport_perception.calibration.depth_application import apply_depth
from cliport_perception.calibration.depth_check import check_depth
from cliport_perception.calibration.verification import Frame
from cliport_perception.calibration.view import fit_view
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.camera_health import CameraHealth, HealthLimits
from cliport_perception.depth_correction import AS_MEASURED, DepthCorrection
from cliport_perception.errors import CalibrationError, UnfitFrameError
from cliport_perception.frame_processor import FrameProcessor
from cliport_perception.table_watch import TableWatch

WORKSPACE = WorkspaceSpec()
OPTICAL = "camera_color_optical_frame"
LYING = Pose.from_xyz_rpy((0.55, -0.2, 0.0), (np.pi, 0.0, 0.3))
ERROR = DepthCorrection(1.012, -0.006)  # what makes the measured depth true


def measured(scene, rng: np.random.Generator | None = None) -> np.ndarray:
    """What a depth camera that is off by ERROR reads."""
    noise = 0.0 if rng is None else rng.normal(0.0, 0.0015, scene.depth.shape)
    return ((scene.depth + noise - ERROR.offset) / ERROR.scale).astype(np.float32)


def record(scene, depth: DepthCorrection | None = None, up: float = 0.0) -> CalibrationRecord:
    pose = Pose(scene.camera_in_base.rotation, scene.camera_in_base.translation + np.array([0.0, 0.0, up]))
    camera, made = CameraCalibration(scene.camera, pose), datetime.now(timezone.utc)
    return CalibrationRecord(camera, made, Method.STATIC, "panda_link0", OPTICAL, depth=depth)


def seen(scene, depth: np.ndarray, with_board: bool = False) -> Frame:
    board = None
    if with_board:
        corners = np.asarray(Board().cv_board.getChessboardCorners(), dtype=np.float64)
        pixels = scene.camera.project((scene.camera_in_base.inverse() @ LYING).apply(corners))
        board = fit_view(corners, pixels, scene.camera)
    return Frame(scene.color, depth, None, board)


def applied(frame: Frame, known: CalibrationRecord) -> CalibrationRecord:
    plane = TableWatch(known.camera.intrinsics, known.camera.camera_in_base, WORKSPACE).measure(frame.depth)
    found = None if plane is None else check_depth(frame.depth, frame.board, known.camera, WORKSPACE, plane)
    return apply_depth(found, frame, known, WORKSPACE).record


def heightmap(scene, depth: np.ndarray, correction: DepthCorrection) -> Heightmap:
    processor = FrameProcessor(WORKSPACE, CameraHealth({}, HealthLimits()), 0.0, 0.0)
    return processor.process(scene.color, depth, scene.camera, scene.camera_in_base, 0, correction).heightmap


@pytest.mark.parametrize("with_board", [True, False])
def test_a_camera_that_is_off_makes_right_heightmaps_once_its_depth_is_applied(
    box_scene, tmp_path: Path, with_board: bool
) -> None:
    true = heightmap(box_scene, box_scene.depth, AS_MEASURED)
    depth = measured(box_scene, np.random.default_rng(0))
    file = tmp_path / "camera.yaml"
    save_calibration(file, applied(seen(box_scene, depth, with_board), record(box_scene)))
    correction = CorrectionWatch(str(file)).of_frame(OPTICAL)
    errors = []
    for used in (AS_MEASURED, correction):
        found = heightmap(box_scene, measured(box_scene), used)
        both = found.valid & true.valid
        assert both.mean() > 0.8
        errors.append(np.abs(found.height - true.height)[both])
    assert np.median(errors[0]) > 0.004 and np.percentile(errors[1], 95.0) < 0.002
    known = load_calibration(file)
    assert known.table_z == pytest.approx(0.0, abs=0.002)


def test_what_is_left_of_an_error_is_added_to_what_is_corrected_already(box_scene) -> None:
    first = DepthCorrection(1.004, 0.001)
    frame = seen(box_scene, first.apply(measured(box_scene)))
    second = applied(frame, record(box_scene, first)).depth
    assert second is not None and second.is_close(ERROR, 5e-4)
    left = DepthCorrection(1.02, 0.01).after(first)
    depth = np.float32([[0.5, 1.0, np.nan]])
    np.testing.assert_allclose(left.apply(depth), DepthCorrection(1.02, 0.01).apply(first.apply(depth)), rtol=1e-6)


def test_a_table_that_is_elsewhere_gives_the_executors_height(cast_scene, camera, camera_in_base) -> None:
    """With a board to tell it: the camera is 8 mm lower than the calibration says, so the table is seen higher."""
    scene = cast_scene(camera, camera_in_base)
    known = applied(seen(scene, scene.depth, True), record(scene, up=0.008))
    assert known.table_z == pytest.approx(0.008, abs=0.001)
    assert known.depth is not None and known.depth.is_close(AS_MEASURED, 2e-3)


def test_what_depth_cannot_mend_is_refused(box_scene) -> None:
    with pytest.raises(CalibrationError, match="too little of the table is seen"):
        apply_depth(None, seen(box_scene, box_scene.depth), record(box_scene), WORKSPACE)
    turned = record(box_scene)
    pose = turned.camera.camera_in_base
    leaning = Pose(Pose.from_xyz_rpy((0, 0, 0), (0.02, 0, 0)).rotation @ pose.rotation, pose.translation)
    turned = replace(turned, camera=CameraCalibration(box_scene.camera, leaning))
    with pytest.raises(CalibrationError, match=r"stays tilted by \d\.\d degrees .*calibrate the camera again"):
        applied(seen(box_scene, box_scene.depth), turned)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"scale": 2.0, "offset": 0.0}, "a depth scale must be from 0.9 to 1.1, got 2"),
        ({"scale": 1.0, "offset": -3.0}, "a depth offset must be within 0.1 m, got -3"),
        ({"scale": 1.0}, "depth must hold scale and offset"),
        ({"scale": 1.0, "offset": float("nan")}, "depth.offset must be a finite number, got nan"),
    ],
)
def test_a_correction_that_no_sensor_needs_is_refused(box_scene, tmp_path: Path, values: dict, words: str) -> None:
    content = record(box_scene).to_dict()
    content["calibration"]["depth"] = values
    file = tmp_path / "camera.yaml"
    file.write_text(yaml.safe_dump(content))
    with pytest.raises(CalibrationError, match=words):
        load_calibration(file)


def test_files_of_the_version_before_are_read_and_hold_neither(box_scene, tmp_path: Path) -> None:
    content = record(box_scene).to_dict()
    content["calibration"]["version"] = 1
    file = tmp_path / "camera.yaml"
    file.write_text(yaml.safe_dump(content))
    known = load_calibration(file)
    assert known.depth is None and known.table_z is None
    assert CorrectionWatch(str(file)).of_frame("another") is AS_MEASURED
    content["calibration"]["table_z"] = 0.01
    file.write_text(yaml.safe_dump(content))
    with pytest.raises(CalibrationError, match="has the unknown table_z"):
        load_calibration(file)


def test_the_file_is_followed_and_belongs_to_one_camera(box_scene, tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    save_calibration(file, record(box_scene))
    watch = CorrectionWatch(str(file))
    assert watch.of_frame(OPTICAL).is_identity and watch.table_z is None
    save_calibration(file, replace(record(box_scene, ERROR), table_z=0.004))
    watch.poll()
    assert watch.of_frame(OPTICAL) == ERROR and watch.table_z == 0.004
    with pytest.raises(UnfitFrameError, match=r"corrects the depth of 'camera_color_optical_frame'.* in 'other'"):
        watch.of_frame("other")
    assert CorrectionWatch("").of_frame("other").is_identity
    with pytest.raises(CalibrationError, match="cannot read"):
        CorrectionWatch(str(tmp_path / "missing.yaml"))


def test_another_correction_forgets_the_frames_before(box_scene) -> None:
    processor = FrameProcessor(WORKSPACE, CameraHealth({}, HealthLimits()), 0.0, 0.0, depth_frames=3)
    depth, rest = measured(box_scene), (box_scene.camera, box_scene.camera_in_base)
    for stamp in range(3):
        processor.process(box_scene.color, depth, *rest, stamp)
    corrected = processor.process(box_scene.color, depth, *rest, 3, ERROR).heightmap
    alone = heightmap(box_scene, depth, ERROR)
    np.testing.assert_array_equal(corrected.height, alone.height)
