"""The setup that all episodes of a data set share: the workspace, the camera and its pose."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from cliport_core.errors import CoreError
from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.errors import SetupError
from cliport_perception.camera_model import CameraModel
from cliport_perception.depth_correction import AS_MEASURED, DepthCorrection

# Differences up to which two setups count as the same.
MAX_SHIFT = 1e-3  # of the camera's position [m]
MAX_TURN = math.radians(0.1)  # of the camera's orientation [rad]
MAX_INTRINSIC = 0.1  # of focal lengths and centre [pixels]
MAX_COEFFICIENT = 1e-4  # of distortion coefficients
MAX_DEPTH = 1e-4  # of the depth camera's scale, and of its offset [m]


@dataclass(frozen=True, eq=False)
class CaptureSetup:
    """Workspace and camera of a recording.

    camera_frame: the optical frame; camera_in_base: its pose in base_frame; depth: correction of the recorded depth.
    """

    workspace: WorkspaceSpec
    camera: CameraModel
    camera_frame: str
    base_frame: str
    camera_in_base: Pose
    depth: DepthCorrection = AS_MEASURED

    def differences(self, other: CaptureSetup) -> list[str]:
        """Return the differences in words, "here" for this setup, "there" for the other; empty: data can be mixed."""
        here, there = self.workspace.to_dict(), other.workspace.to_dict()
        found = [
            f"workspace.{name} {value:g} here, {there[name]:g} there"
            for name, value in here.items()
            if not math.isclose(value, there[name], rel_tol=0.0, abs_tol=1e-9)
        ]
        for name in ("camera_frame", "base_frame"):
            if getattr(self, name) != getattr(other, name):
                found.append(f"{name} '{getattr(self, name)}' here, '{getattr(other, name)}' there")
        if not self.depth.is_close(other.depth, MAX_DEPTH):
            found.append(f"depth is corrected by {self.depth.to_dict()} here, by {other.depth.to_dict()} there")
        return found + _camera_differences(self.camera, other.camera) + self._pose_differences(other)

    def _pose_differences(self, other: CaptureSetup) -> list[str]:
        found = []
        change = self.camera_in_base.inverse() @ other.camera_in_base
        shift = float(np.linalg.norm(change.translation))
        turn = math.acos(float(np.clip((np.trace(change.rotation) - 1.0) / 2.0, -1.0, 1.0)))
        if shift > MAX_SHIFT:
            found.append(f"the camera stands {1000 * shift:.0f} mm elsewhere")
        if turn > MAX_TURN:
            found.append(f"the camera is turned by {math.degrees(turn):.1f} degrees")
        return found

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for YAML or JSON."""
        camera = self.camera
        corrected = {} if self.depth.is_identity else {"depth": self.depth.to_dict()}
        return {
            "workspace": self.workspace.to_dict(),
            "camera": {
                "frame": self.camera_frame,
                "width": camera.width,
                "height": camera.height,
                "K": [float(v) for v in camera.matrix.reshape(-1)],
                "D": list(camera.distortion),
                "model": camera.distortion_model,
            },
            "camera_in_base": {
                "base_frame": self.base_frame,
                "translation": [float(v) for v in self.camera_in_base.translation],
                "quaternion_xyzw": [float(v) for v in self.camera_in_base.as_quaternion_xyzw()],
            },
            **corrected,
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> CaptureSetup:
        """Return the setup of values as `to_dict` gives them.

        Raises:
            SetupError: when a value is missing or impossible.
        """
        try:
            camera, pose = values["camera"], values["camera_in_base"]
            fx, _, cx, _, fy, cy = (float(v) for v in camera["K"][:6])
            return cls(
                workspace=WorkspaceSpec.from_dict(dict(values["workspace"])),
                camera=CameraModel(
                    int(camera["width"]),
                    int(camera["height"]),
                    fx,
                    fy,
                    cx,
                    cy,
                    distortion_model=str(camera["model"]),
                    distortion=tuple(float(v) for v in camera["D"]),
                ),
                camera_frame=str(camera["frame"]),
                base_frame=str(pose["base_frame"]),
                camera_in_base=Pose.from_quaternion_xyzw(pose["quaternion_xyzw"], pose["translation"]),
                depth=DepthCorrection.from_dict(values["depth"]) if "depth" in values else AS_MEASURED,
            )
        except KeyError as error:
            raise SetupError(f"the setup lacks {error}") from None
        except (CoreError, TypeError, ValueError, IndexError) as error:
            raise SetupError(f"the setup is not usable: {error}") from None


def _camera_differences(here: CameraModel, there: CameraModel) -> list[str]:
    if (here.width, here.height) != (there.width, there.height):
        return [f"images of {here.width}x{here.height} pixels here, {there.width}x{there.height} there"]
    found = [
        f"camera {name} {getattr(here, name):.2f} pixels here, {getattr(there, name):.2f} there"
        for name in ("fx", "fy", "cx", "cy")
        if abs(getattr(here, name) - getattr(there, name)) > MAX_INTRINSIC
    ]
    length = max(len(here.distortion), len(there.distortion))
    coefficients_here = np.pad(np.array(here.distortion), (0, length - len(here.distortion)))
    coefficients_there = np.pad(np.array(there.distortion), (0, length - len(there.distortion)))
    other_model = here.is_distorted and here.distortion_model != there.distortion_model
    if other_model or np.any(np.abs(coefficients_here - coefficients_there) > MAX_COEFFICIENT):
        found.append("another lens distortion")
    return found
