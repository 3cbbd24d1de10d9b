"""Calibrations with a hidden truth: random cameras, an arm that is not quite where it says, pictures of a board."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from cliport_core.pose import Pose
from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.detection import BoardDetector, Refusal
from cliport_perception.calibration.eye_on_base import solve_eye_on_base
from cliport_perception.calibration.initial_guess import Placement
from cliport_perception.calibration.proposals import candidate_poses, next_pose
from cliport_perception.calibration.result import Acceptance, EyeOnBase
from cliport_perception.calibration.sample import Sample
from cliport_perception.calibration.synthetic import PictureConfig, SyntheticCamera
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError, PerceptionError


@dataclass(frozen=True)
class SimulationConfig:
    """Errors that are simulated, and how many samples.

    samples: per set-up; arm_shift: standard deviation per axis of where the gripper truly is [m]; arm_turn: the same of
    its orientation [rad]; outlier_share: of samples whose gripper pose is grossly wrong; print_scale: of the board.
    """

    samples: int = 30
    arm_shift: float = 0.0003
    arm_turn: float = 0.0006
    outlier_share: float = 0.0
    print_scale: float = 1.0
    picture: PictureConfig = field(default_factory=PictureConfig)


@dataclass(frozen=True, eq=False)
class HiddenSetup:
    """The truth that the procedure must find out, and a gripper pose at which the board faces the camera."""

    camera: CameraModel
    placement: Placement
    start: Pose


def random_setup(rng: np.random.Generator, board: Board) -> HiddenSetup:
    """Return a camera somewhere about the table, with a lens that distorts, and a board held somehow by the gripper."""
    focal = float(rng.uniform(500.0, 620.0))
    bend = (*rng.uniform((-0.12, -0.05), (0.12, 0.05)), *rng.uniform(-0.001, 0.001, 2), 0.0)
    camera = CameraModel(
        960, 540, focal, focal * float(rng.uniform(0.998, 1.002)), 480.0 + float(rng.uniform(-10, 10)),
        270.0 + float(rng.uniform(-10, 10)), "plumb_bob", tuple(float(v) for v in bend),
    )  # fmt: skip
    distance, azimuth = rng.uniform(0.85, 1.15), rng.uniform(-1.2, 1.2)
    elevation = rng.uniform(math.radians(40.0), math.radians(80.0))
    middle = np.array([0.45, 0.0, 0.0]) + rng.uniform(-0.05, 0.05, 3)
    level = distance * math.cos(elevation)
    eye = middle + np.array([level * math.cos(azimuth), level * math.sin(azimuth), distance * math.sin(elevation)])
    camera_in_base = Pose.looking_at(eye, middle)
    roll = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, rng.uniform(-0.3, 0.3)))
    camera_in_base = camera_in_base @ roll
    held = Pose(Rotation.random(rng=rng).as_matrix(), rng.uniform(-0.08, 0.08, 3))
    facing = Pose.from_xyz_rpy((*rng.uniform(-0.05, 0.05, 2), 0.8 * distance), (0.0, 0.0, rng.uniform(-1.0, 1.0)))
    centered = facing @ Pose(np.eye(3), -board.center)
    start = camera_in_base @ centered @ held.inverse()
    return HiddenSetup(camera, Placement(camera_in_base, held), start)


def take_samples(
    setup: HiddenSetup, board: Board, rng: np.random.Generator, config: SimulationConfig
) -> tuple[list[Sample], dict[str, int]]:
    """Return the samples of a whole procedure, and how many pictures were refused, by the reason."""
    drawn = SyntheticCamera(board, setup.camera, config.picture, config.print_scale)
    detector = BoardDetector(board, setup.camera)
    candidates = candidate_poses(setup.start)
    samples: list[Sample] = []
    refused: dict[str, int] = {}
    for _ in range(6 * config.samples):
        if len(samples) == config.samples:
            break
        told = next_pose(candidates, [sample.gripper_in_base for sample in samples], rng)
        true = _jittered(told, rng, config.arm_shift, config.arm_turn)
        look = detector.look(drawn.picture(setup.placement.board_in_camera(true), rng))
        if isinstance(look, Refusal):
            refused[look.fault.value] = refused.get(look.fault.value, 0) + 1
            continue
        samples.append(Sample(told, look, len(samples)))
    for i in rng.choice(len(samples), size=round(config.outlier_share * len(samples)), replace=False):
        wrong = _jittered(samples[i].gripper_in_base, rng, 0.05, 0.15)
        samples[i] = replace(samples[i], gripper_in_base=wrong)
    return samples, refused


def simulate(
    count: int,
    seed: int,
    board: Board,
    config: SimulationConfig | None = None,
    progress: Callable[[dict[str, Any]], None] = lambda row: None,
) -> dict[str, Any]:
    """Return the runs of calibrations in `count` random set-ups, with median and worst errors at the top.

    progress: told of each run. A run that was refused has its reason, and leaves no worst error: None.
    """
    config = config or SimulationConfig()
    runs = []
    for number in range(count):
        runs.append(_run(number, np.random.default_rng((seed, number)), board, config))
        progress(runs[-1])
    mm = np.array([run.get("error_mm", math.inf) for run in runs])
    deg = np.array([run.get("error_deg", math.inf) for run in runs])
    return {
        "median_mm": _finite(np.median(mm)),
        "median_deg": _finite(np.median(deg)),
        "worst_mm": _finite(mm.max()),
        "worst_deg": _finite(deg.max()),
        "solved": sum("error_mm" in run for run in runs),
        "accepted": sum(bool(run.get("accepted")) for run in runs),
        "within_uncertainty": sum(bool(run.get("within_uncertainty")) for run in runs),
        "count": count,
        "seed": seed,
        "pictures": "synthetic: the board's print along the rays of a distorting lens, with blur and grain",
        "board": board.describe(),
        "config": asdict(config),
        "runs": runs,
    }


def _run(number: int, rng: np.random.Generator, board: Board, config: SimulationConfig) -> dict[str, Any]:
    setup = random_setup(rng, board)
    samples, refused = take_samples(setup, board, rng, config)
    row: dict[str, Any] = {"number": number, "samples": len(samples), "refused": refused}
    try:
        found = solve_eye_on_base(samples, setup.camera, board, rng)
    except PerceptionError as error:
        return row | {"error": str(error)}
    return row | _judged(found, setup)


def _judged(found: EyeOnBase, setup: HiddenSetup) -> dict[str, Any]:
    mm, deg = pose_difference(found.camera_in_base, setup.placement.camera_in_base)
    accepted = True
    try:
        Acceptance().check(found.held_out, found.uncertainty)
    except CalibrationError:
        accepted = False
    return {
        "error_mm": mm,
        "error_deg": deg,
        "uncertainty_mm": found.uncertainty.mm,
        "uncertainty_deg": found.uncertainty.deg,
        "within_uncertainty": mm <= found.uncertainty.mm and deg <= found.uncertainty.deg,
        "accepted": accepted,
        "held_out": found.held_out._asdict(),
        "fitted": found.fitted._asdict(),
        "outliers": len(found.outliers),
        "scale": found.scale,
        "scale_sigma": found.scale_sigma,
    }


def _jittered(pose: Pose, rng: np.random.Generator, shift: float, turn: float) -> Pose:
    change = Rotation.from_rotvec(rng.normal(0.0, turn, 3)).as_matrix()
    return Pose(pose.rotation @ change, pose.translation + rng.normal(0.0, shift, 3))


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
