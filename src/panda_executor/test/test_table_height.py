"""The table's height that the executor works with: the calibration's, else the parameter's."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_core import Pose
from cliport_core.errors import CoreError
from cliport_perception.calibration.calibration_file import CalibrationRecord, Method, save_calibration
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.camera_model import CameraModel
from panda_executor.errors import ExecutorError
from panda_executor.node_parameters import read_parameters


def table_z(**values: Any) -> float:
    node = SimpleNamespace(declare_parameter=lambda name, default: SimpleNamespace(value=values.get(name, default)))
    return read_parameters(node).config.scene.table_z  # type: ignore[arg-type]


@pytest.mark.parametrize("height", [None, 0.0034])
def test_the_calibrations_height_is_used_where_it_has_one(tmp_path: Path, height: float | None) -> None:
    camera = CameraCalibration(CameraModel(640, 480, 600.0, 600.0, 320.0, 240.0), Pose.identity())
    made = datetime.now(timezone.utc)
    record = CalibrationRecord(camera, made, Method.STATIC, "panda_link0", "camera", table_z=height)
    file = str(tmp_path / "camera.yaml")
    save_calibration(Path(file), record)
    assert table_z(calibration=file) == (height or 0.0)
    assert table_z(calibration=file, table_z=0.00341) == 0.00341
    if height is None:
        assert table_z(calibration=file, table_z=0.02) == 0.02
        return
    with pytest.raises(ExecutorError, match=r"table_z is 0\.02, and .*camera\.yaml has it at 0\.0034: leave"):
        table_z(calibration=file, table_z=0.02)


def test_a_calibration_that_is_not_there_is_named() -> None:
    with pytest.raises(CoreError, match=r"cannot read .*/nowhere/camera\.yaml"):
        table_z(calibration="/nowhere/camera.yaml")
