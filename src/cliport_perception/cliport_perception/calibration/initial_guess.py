"""A first guess of where camera and board are, from whole poses: what the refinement starts from.

OpenCV 5.0's Python lacks its hand-eye solvers. Rotations are aligned by SciPy's solution of Wahba's problem, as
Park and Martin do (IEEE T-RA 10, 1994); the translations are then linear. Outliers are left out by random trials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from cliport_core.pose import FloatArray, Pose
from cliport_perception.calibration.angles import angle_of
from cliport_perception.calibration.sample import Sample, turn_spread
from cliport_perception.errors import CalibrationError


@dataclass(frozen=True, eq=False)
class Placement:
    """The two unknowns of eye on base: the camera's optical frame in the base, the board in the gripper."""

    camera_in_base: Pose
    board_in_gripper: Pose

    def board_in_camera(self, gripper_in_base: Pose) -> Pose:
        """Return where the board is before the camera when the gripper stands at a pose."""
        return self._base_in_camera @ gripper_in_base @ self.board_in_gripper

    @cached_property
    def _base_in_camera(self) -> Pose:
        return self.camera_in_base.inverse()


@dataclass(frozen=True)
class TrialConfig:
    """Random trials, of `size` samples each, that leave outliers out.

    agree_m, agree_rad: a sample agrees with a placement when its own view differs by no more.
    """

    trials: int = 80
    size: int = 4
    agree_m: float = 0.03
    agree_rad: float = 0.1


def guess_placement(
    samples: Sequence[Sample], rng: np.random.Generator, config: TrialConfig | None = None
) -> tuple[Placement, list[int]]:
    """Return the placement with which most samples agree, and the indices of those.

    Raises:
        CalibrationError: when hardly any samples agree with each other.
    """
    config = config or TrialConfig()
    best: list[int] = []
    least = np.inf
    for _ in range(config.trials):
        chosen = rng.choice(len(samples), size=min(config.size, len(samples)), replace=False)
        trial = [samples[i] for i in chosen]
        if turn_spread([sample.gripper_in_base for sample in trial])[1] < 0.03:  # no two axes
            continue
        shift, turn = disagreement(samples, placement_of(trial))
        agreeing = np.flatnonzero((shift < config.agree_m) & (turn < config.agree_rad))
        cost = float(np.minimum(shift, config.agree_m).sum())
        if len(agreeing) > len(best) or (len(agreeing) == len(best) and cost < least):
            best, least = [int(i) for i in agreeing], cost
    if len(best) < config.size:
        raise CalibrationError(
            f"the samples contradict each other, at most {len(best)} of {len(samples)} agree: does the board sit "
            "firmly in the gripper, is the camera still, are --board and the frame of the gripper right?"
        )
    return placement_of([samples[i] for i in best]), best


def placement_of(samples: Sequence[Sample]) -> Placement:
    """Return the placement that fits whole poses best: rotations first, then translations."""
    gripper = Rotation.from_matrix(np.stack([s.gripper_in_base.rotation for s in samples]))
    board = Rotation.from_matrix(np.stack([s.view.board_in_camera.rotation for s in samples]))
    first, second = np.triu_indices(len(samples), 1)
    in_base = (gripper[first] * gripper[second].inv()).as_rotvec()
    in_camera = (board[first] * board[second].inv()).as_rotvec()
    camera_turn, _ = Rotation.align_vectors(in_base, in_camera)
    board_turn = (gripper.inv() * camera_turn * board).mean()
    rows, wanted = [], []
    for sample in samples:
        rows.append(np.hstack([sample.gripper_in_base.rotation, -np.eye(3)]))
        seen = camera_turn.as_matrix() @ sample.view.board_in_camera.translation
        wanted.append(seen - sample.gripper_in_base.translation)
    shifts = np.linalg.lstsq(np.vstack(rows), np.concatenate(wanted), rcond=None)[0]
    return Placement(Pose(camera_turn.as_matrix(), shifts[3:]), Pose(board_turn.as_matrix(), shifts[:3]))


def disagreement(samples: Sequence[Sample], placement: Placement) -> tuple[FloatArray, FloatArray]:
    """Return how far each sample's own view is from a placement's: (S,) [m] of the board's origin, (S,) [rad]."""
    gripper = np.stack([sample.gripper_in_base.as_matrix() for sample in samples])
    seen = np.stack([sample.view.board_in_camera.as_matrix() for sample in samples])
    drawn = placement.camera_in_base.inverse().as_matrix() @ gripper @ placement.board_in_gripper.as_matrix()
    apart = np.swapaxes(drawn[:, :3, :3], 1, 2) @ seen[:, :3, :3]
    return np.linalg.norm(drawn[:, :3, 3] - seen[:, :3, 3], axis=1), angle_of(apart)
