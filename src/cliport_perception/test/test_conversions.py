from __future__ import annotations

from array import array
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message, serialize_message

from cliport_core import ImageError, WorkspaceSpec
from cliport_perception import CameraModel
from cliport_perception import conversions as c
from cliport_perception.camera_health import HealthReport, Level
from cliport_perception.clouds import CloudBuilder, CloudRegion


def over_the_wire(message):
    return deserialize_message(serialize_message(message), type(message))


def test_camera_raw_and_rectified() -> None:
    camera = CameraModel(960, 540, 540.0, 541.0, 479.0, 268.0, "plumb_bob", (0.1, -0.2, 0.001, 0.002, 0.03))
    message = over_the_wire(c.camera_to_msg(camera))
    assert c.camera_from_msg(message) == camera
    rectified = c.camera_from_msg(message, rectified=True)
    assert not rectified.is_distorted
    assert (rectified.fx, rectified.cy) == (540.0, 268.0)


def test_a_cloud_costs_no_rays_and_comes_back(box_scene, monkeypatch: pytest.MonkeyPatch) -> None:
    builder = CloudBuilder(box_scene.camera, box_scene.camera_in_base, CloudRegion.around(WorkspaceSpec()))
    monkeypatch.delattr(CameraModel, "rays")  # they are the builder's, and no frame's
    data = builder.build(box_scene.color, box_scene.depth)
    message = c.cloud_to_msg(data, "panda_link0", 5)
    monkeypatch.undo()
    assert (message.height, message.point_step, message.row_step, message.is_dense) == (1, 16, len(data), True)
    assert [(f.name, f.offset) for f in message.fields] == [("x", 0), ("y", 4), ("z", 8), ("rgb", 12)]
    back = c.cloud_points_from_msg(over_the_wire(message))
    assert back.tobytes() == builder.points(box_scene.depth).tobytes()


def test_clouds_of_other_layouts_are_read() -> None:
    """As depth_image_proc publishes them: organised, 32 bytes a point, NaN where nothing was seen."""
    points = np.arange(24, dtype=np.float32).reshape(2, 4, 3)
    points[1, 2] = np.nan
    rows = np.full((2, 5, 8), 7.0, np.float32)  # a row is longer than its points
    rows[:, :4, :3] = points
    message = c.cloud_to_msg(array("B", rows.tobytes()), "panda_link0", 5)
    message.height, message.width, message.point_step, message.row_step = 2, 4, 32, 160
    np.testing.assert_array_equal(c.cloud_points_from_msg(message), points.reshape(-1, 3))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"fields": []}, "its fields are none"),
        ({"is_bigendian": True}, "little-endian"),
        ({"point_step": 8}, "does not fit"),
        ({"row_step": 4}, "does not fit"),
        ({"width": 1000}, "does not fit"),
        ({"height": 2}, "does not fit"),
    ],
)
def test_clouds_that_cannot_be_read_are_refused(change: dict[str, Any], words: str) -> None:
    message = c.cloud_to_msg(array("B", bytes(16 * 3)), "panda_link0", 5)
    assert c.cloud_points_from_msg(message).shape == (3, 3)
    for name, value in change.items():
        setattr(message, name, value)
    with pytest.raises(ImageError, match=words):
        c.cloud_points_from_msg(message)


def test_an_empty_cloud() -> None:
    assert c.cloud_points_from_msg(over_the_wire(c.cloud_to_msg(array("B"), "panda_link0", 5))).shape == (0, 3)


def test_diagnostics() -> None:
    report = HealthReport(Level.STALE, "newest camera frame is old", {"age_s": "2.0"})
    message = over_the_wire(c.diagnostics_to_msg("camera", report, 7))
    status = message.status[0]
    assert (status.level, status.name, status.message) == (b"\x03", "camera", "newest camera frame is old")
    assert [(v.key, v.value) for v in status.values] == [("age_s", "2.0")]
