"""Where the camera stands: known once its frame and the transforms to the base are."""

from __future__ import annotations

import numpy as np
import pytest

from cliport_core.pose import Pose
from panda_executor.camera_place import CameraPlace
from panda_executor.errors import RequestError


def test_the_position_follows_the_chain_of_transforms() -> None:
    place = CameraPlace("base")
    with pytest.raises(RequestError, match="no camera_info has arrived"):
        place.position()
    place.see("lens")
    with pytest.raises(RequestError, match="no transform from 'lens' to 'base'"):
        place.position()
    place.put("mount", "lens", Pose(np.eye(3), np.array([0.0, 0.0, 0.05])))
    with pytest.raises(RequestError, match="publish its calibration on /tf_static"):
        place.position()
    place.put("base", "mount", Pose.looking_at((0.9, 0.0, 0.8), (0.9, 0.0, 0.0)))
    np.testing.assert_allclose(place.position(), [0.9, 0.0, 0.75], atol=1e-12)
    place.put("base", "mount", Pose.looking_at((0.5, 0.7, 0.8), (0.5, 0.7, 0.0)))
    np.testing.assert_allclose(place.position(), [0.5, 0.7, 0.75], atol=1e-12)
