"""The user's own workspace and camera in place of the simulator's, and the options that commands share for them."""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cliport_benchmark.errors import OptionError
from cliport_benchmark.variation import Variation
from cliport_core import WorkspaceSpec
from cliport_core.errors import CoreError
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.camera_health import HealthLimits
from sim_bridge.errors import LayoutError, PhysicsError
from sim_bridge.rendering.mounting import load_camera
from sim_bridge.rendering.sensor_noise import SensorKind
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import Task
from sim_bridge.world import SimConfig, SimWorld

_TRIES = 3  # scenes without a free place after which a workspace is refused
_LATTICE = 24  # points along each side of the workspace that the camera should see


@dataclass(frozen=True)
class OwnSetup:
    """The workspace that scenes are made for and the camera that sees them; the defaults are the simulator's own.

    camera_kind: how that camera errs.

    Raises:
        OptionError: when the camera sees too little of the workspace.
    """

    workspace: WorkspaceSpec = field(default_factory=WorkspaceSpec)
    camera: CameraCalibration = field(default_factory=load_camera)
    camera_kind: SensorKind = SensorKind.PLAIN

    def __post_init__(self) -> None:
        seen, least = self._seen_share(), HealthLimits().min_valid_fraction
        if seen < least:
            raise OptionError(
                f"the camera at {self.camera.camera_in_base.translation.round(3).tolist()} m sees {100 * seen:.0f} % "
                f"of the workspace (at least {100 * least:.0f} % needed): check --camera against --workspace"
            )

    @classmethod
    def load(cls, workspace: Path | None, camera: Path | None, camera_kind: SensorKind = SensorKind.PLAIN) -> OwnSetup:
        """Read the files that are given.

        Raises:
            OptionError: when the workspace's cannot be used, or the camera does not see it.
            MountingError: when the camera's cannot be used.
        """
        try:
            spec = WorkspaceSpec() if workspace is None else WorkspaceSpec.load(workspace)
        except CoreError as error:
            raise OptionError(f"--workspace: {error}") from None
        return cls(spec, load_camera() if camera is None else load_camera(camera), camera_kind)

    def sim_config(self) -> SimConfig:
        """Return the physics settings for scenes in this workspace."""
        return SimConfig(workspace=self.workspace)

    def settings(self) -> dict[str, Any]:
        """Return the set-up as results and data sets record it."""
        lens, pose = self.camera.intrinsics, self.camera.camera_in_base
        camera: dict[str, Any] = {
            "width": lens.width,
            "height": lens.height,
            "fx": lens.fx,
            "fy": lens.fy,
            "cx": lens.cx,
            "cy": lens.cy,
            "camera_in_base_xyz": pose.translation.tolist(),
            "camera_in_base_xyzw": pose.as_quaternion_xyzw().tolist(),
        }
        if lens.is_distorted:
            camera |= {"distortion_model": lens.distortion_model, "distortion": list(lens.distortion)}
        settings = {"workspace": self.workspace.to_dict(), "camera": camera}
        return settings if self.camera_kind is SensorKind.PLAIN else settings | {"camera_kind": self.camera_kind.value}

    def check_room(self, task: str, split: str, first_seed: int) -> None:
        """Refuse a workspace that is too small for a task, or in which its things would lie outside.

        Raises:
            OptionError: naming the task and what it lacks.
        """
        if self.workspace == WorkspaceSpec():
            return
        world, reason = SimWorld(self.sim_config()), "its objects flew apart"
        try:
            for seed in range(first_seed, first_seed + _TRIES):
                try:
                    made = reset_scene(world, task, split, seed)
                except PhysicsError:
                    continue
                except LayoutError as error:
                    reason = str(error)
                    continue
                self._check_inside(world, made)
                return
        finally:
            world.close()
        raise OptionError(f"{task} has no room in this workspace: {reason}")

    def _check_inside(self, world: SimWorld, task: Task) -> None:
        for thing in task.objects:
            x, y = world.object_xy(thing)
            if not self.workspace.contains_xy(float(x), float(y)):
                spec = self.workspace
                raise OptionError(
                    f"{task.name} puts its {thing.described} at x {x:.2f}, y {y:.2f} m, outside the workspace's "
                    f"x {spec.x_min:g}..{spec.x_max:g}, y {spec.y_min:g}..{spec.y_max:g} m: give a workspace around it"
                )

    def _seen_share(self) -> float:
        """Return the share of the table's points within the workspace that lies in the image."""
        spec, lens = self.workspace, self.camera.intrinsics
        x, y = np.meshgrid(np.linspace(spec.x_min, spec.x_max, _LATTICE), np.linspace(spec.y_min, spec.y_max, _LATTICE))
        points = self.camera.camera_in_base.inverse().apply(np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3))
        before = points[points[:, 2] > 0.0]
        if not len(before):
            return 0.0
        row, col = lens.project(before).T
        return float(np.sum((row >= 0) & (row < lens.height) & (col >= 0) & (col < lens.width)) / len(points))


def add_setup_options(parser: argparse.ArgumentParser) -> None:
    """Add --workspace, --camera and --camera-kind."""
    parser.add_argument("--workspace", type=Path, metavar="FILE", help="YAML of your workspace; the shipped one")
    parser.add_argument("--camera", type=Path, metavar="FILE", help="YAML of your camera; the simulator's own")
    parser.add_argument(
        "--camera-kind",
        default=SensorKind.PLAIN.value,
        choices=[kind.value for kind in SensorKind],
        help="how its depth errs (default %(default)s)",
    )


def add_variation_options(parser: argparse.ArgumentParser) -> None:
    """Add --randomize and --mounting-error."""
    parser.add_argument(
        "--randomize",
        nargs="?",
        const="all",
        metavar="WHAT",
        help="vary the scenes: light, texture, clutter, mounting, several with commas between; all without a name",
    )
    parser.add_argument(
        "--mounting-error",
        nargs=2,
        type=float,
        metavar=("MM", "DEG"),
        help="standard deviations, per axis, of the camera's unknown shift and turn; 1.5 and 0.086",
    )


def setup_of(options: argparse.Namespace) -> OwnSetup:
    """Load the set-up that the options of add_setup_options name; errors as OwnSetup.load."""
    return OwnSetup.load(options.workspace, options.camera, SensorKind(options.camera_kind))


def variation_of(options: argparse.Namespace) -> Variation:
    """Parse the options of add_variation_options; errors as Variation.parse."""
    return Variation.parse(options.randomize, options.mounting_error and tuple(options.mounting_error))


def set_up_words(values: dict[str, Any]) -> str:
    """Return the conditions under which a result's agent was scored, to follow its name: ", randomized: light", say."""
    words = ""
    own = OwnSetup().settings()
    if any(name in values and values[name] != own[name] for name in own):
        words += ", own set-up"
    words += f", {values['camera_kind'].replace('_', ' ')} camera" if values.get("camera_kind") else ""
    words += ", colours of the survey" if values.get("survey_colors") else ""
    if values.get("randomize"):
        words += f", randomized: {', '.join(values['randomize'])}"
    return words


def condition_words(values: dict[str, Any]) -> str:
    """Return all that was unusual about a result, to follow a name: ", exact offset, randomized: light", say."""
    words = ", other wording" if "wording" in values else ""
    words += ", through the graph" if values.get("graph") else ""
    words += ", without the arm" if values.get("without_arm") else ""
    words += f", without {' and '.join(values['left_out'])}" if values.get("left_out") else ""
    words += ", exact offset" if values.get("offset") == "exact" else ""
    return words + set_up_words(values)
