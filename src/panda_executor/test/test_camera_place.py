"""Where the camera stands: known once its frame and the transforms to the base are."""

from __future__ import annotations

import numpy as np
import pytest

from cliport_core.outcome import Refusal
from cliport_core.pose import Pose
from panda_executor.camera_place import CameraPlace
from panda_executor.errors import RequestError


def test_the_position_follows_the_chain_of_transforms() -> None:
    place = CameraPlace("base")
    with pytest.raises(RequestError, match="no camera_info has arrived"):
        place.positions()
    place.see("lens")
    with pytest.raises(RequestError, match="no transform from 'lens' to 'base'"):
        place.positions()
    place.put("mount", "lens", Pose(np.eye(3), np.array([0.0, 0.0, 0.05])))
    with pytest.raises(RequestError, match="publish its calibration on /tf_static"):
        place.positions()
    place.put("base", "mount", Pose.looking_at((0.9, 0.0, 0.8), (0.9, 0.0, 0.0)))
    np.testing.assert_allclose(place.positions(), [[0.9, 0.0, 0.75]], atol=1e-12)
    place.put("base", "mount", Pose.looking_at((0.5, 0.7, 0.8), (0.5, 0.7, 0.0)))
    np.testing.assert_allclose(place.positions(), [[0.5, 0.7, 0.75]], atol=1e-12)


def test_an_unknown_place_is_refused_as_such() -> None:
    place = CameraPlace("base")
    for _ in range(2):
        with pytest.raises(RequestError, match="where the camera stands is not known") as caught:
            place.positions()
        assert caught.value.refusal is Refusal.NO_CAMERA_POSE
        place.see("lens")
    place.put("base", "lens", Pose(np.eye(3), np.array([0.1, 0.2, 0.3])))
    place.put("base", "other", Pose(np.eye(3), np.array([1.0, 2.0, 3.0])))
    np.testing.assert_array_equal(place.positions(), [[0.1, 0.2, 0.3]])
    place.see("other")
    np.testing.assert_array_equal(place.positions(), [[1.0, 2.0, 3.0]])


def test_of_several_cameras_each_must_be_known() -> None:
    place = CameraPlace("base", 2)
    place.put("base", "lens", Pose(np.eye(3), np.array([0.9, 0.0, 0.8])))
    place.put("base", "side", Pose(np.eye(3), np.array([0.4, 0.9, 0.7])))
    place.see("lens")
    with pytest.raises(RequestError, match="where the camera 2 stands is not known: no camera_info has arrived"):
        place.positions()
    place.see("side", 2)
    np.testing.assert_array_equal(place.positions(), [[0.9, 0.0, 0.8], [0.4, 0.9, 0.7]])
