"""Reads where a simulated camera is mounted and how its lens and sensor map the scene to pixels."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from cliport_core import Pose
from cliport_perception.camera_file import CameraCalibration, CameraFileError, read_camera
from sim_bridge.errors import SimBridgeError

_SHIPPED = Path(__file__).with_name("mounting.yaml")


class MountingError(SimBridgeError):
    """A file that does not describe a camera; the message names it and what it must hold."""


def load_mounting(path: str | Path = "") -> Pose:
    """Return the pose of the optical frame (z forward) in the base frame; arguments and errors as in load_camera."""
    return load_camera(path).camera_in_base


def load_camera(path: str | Path = "") -> CameraCalibration:
    """Return the camera that a YAML file describes, as `cliport_perception.camera_file.read_camera` does.

    path: of the file; empty: the shipped one, whose lens a file without one has too.

    Raises:
        MountingError: when the file cannot be read or holds something else.
    """
    try:
        shipped = read_camera(_SHIPPED)
        return read_camera(Path(path), shipped.intrinsics) if path else shipped
    except CameraFileError as error:
        raise MountingError(str(error)) from None


def mounting_error(
    camera_in_base: Pose, rng: np.random.Generator, shift_sigma: float = 0.0015, turn_sigma: float = 0.0015
) -> Pose:
    """Draw the camera's true pose when calibration is off by a little: sigmas in m and rad per axis."""
    error = Pose.from_xyz_rpy((0.0, 0.0, 0.0), rng.normal(0.0, turn_sigma, 3))
    return Pose(
        error.rotation @ camera_in_base.rotation,
        camera_in_base.translation + rng.normal(0.0, shift_sigma, 3),
    )
