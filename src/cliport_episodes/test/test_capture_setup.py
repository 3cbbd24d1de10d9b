"""What makes two recordings one data set."""

from dataclasses import replace

import numpy as np
import pytest
import yaml

from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.errors import SetupError
from cliport_perception.camera_model import CameraModel


def test_survives_yaml(setup: CaptureSetup) -> None:
    assert CaptureSetup.from_dict(yaml.safe_load(yaml.safe_dump(setup.to_dict()))).differences(setup) == []


def test_differences_are_said_in_words(setup: CaptureSetup) -> None:
    moved = Pose.from_xyz_rpy((0.012, 0.0, 0.0), (0.0, 0.0, 0.0)) @ setup.camera_in_base
    turned = setup.camera_in_base @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, 0.05))
    for other, words in (
        (replace(setup, camera_in_base=moved), "the camera stands 12 mm elsewhere"),
        (replace(setup, camera_in_base=turned), "the camera is turned by 2.9 degrees"),
        (replace(setup, camera_frame="eye"), "camera_frame 'camera_optical' here, 'eye' there"),
        (replace(setup, camera=replace(setup.camera, fx=70.0)), "camera fx 60.00 pixels here, 70.00 there"),
        (replace(setup, camera=CameraModel(32, 24, 60, 60, 16, 12)), "images of 64x48 pixels here, 32x24 there"),
        (replace(setup, camera=replace(setup.camera, distortion=(0.1, 0, 0, 0, 0))), "another lens distortion"),
        (
            replace(setup, workspace=WorkspaceSpec(0.0, 1.0, -0.5, 0.5, pixel_size=0.003125)),
            "workspace.pixel_size 0.0025 here, 0.003125 there",
        ),
    ):
        assert words in setup.differences(other)


def test_noise_of_a_calibration_is_no_difference(setup: CaptureSetup) -> None:
    nudge = Pose.from_xyz_rpy((0.0002, 0.0, 0.0), (0.0, 0.0, 0.0005))
    undistorted = replace(setup.camera, distortion=(0.0,) * 5)
    assert setup.differences(replace(setup, camera_in_base=nudge @ setup.camera_in_base, camera=undistorted)) == []


@pytest.mark.parametrize("change", [{"camera": {}}, {"camera_in_base": None}, {"workspace": {"pixel_size": -1}}])
def test_nonsense_is_one_error(setup: CaptureSetup, change: dict[str, object]) -> None:
    with pytest.raises(SetupError):
        CaptureSetup.from_dict({**setup.to_dict(), **change})


def test_a_setup_is_itself_whatever_the_rounding(setup: CaptureSetup) -> None:
    """The cosine of no turn comes out a hair above one for some cameras."""
    rng = np.random.default_rng(0)
    for _ in range(300):
        camera = Pose.from_quaternion_xyzw(rng.normal(size=4), rng.normal(size=3))
        own = replace(setup, camera_in_base=camera)
        assert not own.differences(replace(setup, camera_in_base=camera))
