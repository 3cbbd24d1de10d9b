"""A camera's file: what it holds comes back, lenses that distort are seen through, bad ones end in one line."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from cliport_core import Pose, WorkspaceSpec
from cliport_perception import CameraModel
from cliport_perception.camera_file import CameraCalibration
from sim_bridge.rendering.image_window import ImageWindow
from sim_bridge.rendering.mounting import MountingError, load_camera

LENS = "width: 640, height: 480, fx: 500, fy: 501.5, cx: 320, cy: 240"


def test_what_a_calibration_writes_is_read_back(tmp_path: Path) -> None:
    lens = CameraModel(640, 480, 500.0, 501.5, 321.0, 239.0, "plumb_bob", (0.1, -0.05, 0.001, 0.0, 0.0))
    mine = CameraCalibration(lens, Pose.looking_at((0.5, 0.6, 0.8), (0.5, 0.0, 0.0)))
    file = tmp_path / "camera.yaml"
    file.write_text(yaml.safe_dump({"camera": mine.to_dict()}))
    found = load_camera(file)
    assert found.intrinsics == lens and found.camera_in_base.is_close(mine.camera_in_base)


def test_a_file_without_a_lens_has_the_shipped_one(tmp_path: Path) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text("camera: {position: [0.4, 0.5, 0.9], looking_at: [0.4, 0.0, 0.0]}")
    assert load_camera(file).intrinsics == load_camera().intrinsics == CameraModel(960, 540, 540, 540, 480, 270)


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        ("looking_at: [0.4, 0, 0], fx: 500", "lacks width, height, fy, cx, cy"),
        ("looking_at: [0.4, 0, 0], orientation_xyzw: [1, 0, 0, 0]", "not both"),
        ("orientation_xyzw: [1, 1, 0, 0]", r"unit quaternion, got one of length 1\.41"),
        ("orientation_xyzw: [1, 0, 0]", "must be four numbers, x, y, z and w"),
        ("looking_at: [0.4, 0, 0], lens: 3", r"unknown keys \['lens'\]"),
        (f"looking_at: [0.4, 0, 0], {LENS.replace('640', '640.5')}", "whole numbers of pixels"),
        (f"looking_at: [0.4, 0, 0], {LENS.replace('500', 'wide')}", "fx must be a finite number"),
        (f"looking_at: [0.4, 0, 0], {LENS.replace('500', '-1')}", "focal lengths must be positive"),
        (f"looking_at: [0.4, 0, 0], {LENS}, distortion: [0.1, 0.2]", "coefficients, got 2"),
        (f"looking_at: [0.4, 0, 0], {LENS}, distortion: some", "distortion must be a list of numbers"),
        (f"looking_at: [0.4, 0, 0], {LENS}, distortion_model: fish", "'fish' is not supported"),
    ],
)
def test_a_file_that_describes_no_camera_is_refused_in_one_line(tmp_path: Path, inside: str, words: str) -> None:
    file = tmp_path / "camera.yaml"
    file.write_text("camera: {position: [0.4, 0.5, 0.9], " + inside + "}")
    with pytest.raises(MountingError, match=words) as caught:
        load_camera(file)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)


def test_the_window_of_a_lens_that_distorts_holds_what_sees_the_workspace() -> None:
    pose, spec = load_camera().camera_in_base, WorkspaceSpec()
    straight = CameraModel(960, 540, 540.0, 540.0, 480.0, 270.0)
    bent = CameraModel(960, 540, 540.0, 540.0, 480.0, 270.0, "plumb_bob", (-0.1, 0.02, 0.0, 0.0, 0.0))
    barely = CameraModel(960, 540, 540.0, 540.0, 480.0, 270.0, "plumb_bob", (1e-9, 0.0, 0.0, 0.0, 0.0))
    wanted, found = (ImageWindow.that_sees(lens, pose, spec) for lens in (straight, barely))
    bounds = [(w.row_start, w.row_end, w.col_start, w.col_end) for w in (wanted, found)]
    assert np.abs(np.subtract(*bounds)).max() <= 2
    window = ImageWindow.that_sees(bent, pose, spec)
    x, y = np.meshgrid(np.linspace(spec.x_min, spec.x_max, 9), np.linspace(spec.y_min, spec.y_max, 9))
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    row, col = bent.project(pose.inverse().apply(points)).T
    assert row.min() >= window.row_start and row.max() < window.row_end
    assert col.min() >= window.col_start and col.max() < window.col_end
