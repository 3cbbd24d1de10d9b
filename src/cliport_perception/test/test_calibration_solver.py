"""Eye on base: what was hidden is found, and sets that give no calibration are refused in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cliport_core import Pose
from cliport_perception.calibration.angles import angle_of, pose_difference
from cliport_perception.calibration.eye_on_base import solve_eye_on_base
from cliport_perception.calibration.initial_guess import guess_placement
from cliport_perception.calibration.result import Acceptance, EyeOnBase, Misfit, Uncertainty, Use
from cliport_perception.calibration.sample import Sample
from cliport_perception.errors import CalibrationError


def solve(world, samples: list[Sample]) -> EyeOnBase:
    return solve_eye_on_base(samples, world.camera, world.board, np.random.default_rng(1))


def test_without_noise_the_truth_is_found(board_in_hand) -> None:
    found = solve(board_in_hand, board_in_hand.samples(12))
    assert found.camera_in_base.is_close(board_in_hand.placement.camera_in_base, 1e-6)
    assert found.board_in_gripper.is_close(board_in_hand.placement.board_in_gripper, 1e-6)
    assert max(found.held_out) < 1e-3 and found.uncertainty.mm < 1e-2
    uses = [sample.use for sample in found.samples]
    assert uses.count(Use.HELD_OUT) == 4 and uses.count(Use.FITTED) == 8


def test_the_guess_alone_is_near(board_in_hand) -> None:
    placement, agreeing = guess_placement(board_in_hand.samples(12, noise_px=0.1), np.random.default_rng(0))
    mm, deg = pose_difference(placement.camera_in_base, board_in_hand.placement.camera_in_base)
    assert len(agreeing) == 12 and mm < 30.0 and deg < 2.0


@pytest.mark.parametrize("seed", range(5))
def test_errors_stay_within_the_uncertainty_that_is_claimed(board_in_hand, seed: int) -> None:
    samples = board_in_hand.samples(25, seed, noise_px=0.1, arm_m=0.0003)
    found = solve(board_in_hand, samples)
    mm, deg = pose_difference(found.camera_in_base, board_in_hand.placement.camera_in_base)
    assert mm < found.uncertainty.mm < 5.0 and deg < found.uncertainty.deg < 0.5
    assert abs(found.scale - 1.0) < 3.0 * found.scale_sigma
    Acceptance().check(found.held_out, found.uncertainty)


def test_gross_outliers_are_named_and_change_nothing(board_in_hand) -> None:
    samples = board_in_hand.samples(20, noise_px=0.1)
    clean = solve(board_in_hand, samples)
    off = Pose.from_xyz_rpy((0.03, -0.02, 0.01), (0.05, 0.0, 0.1))
    for i in (3, 11):
        samples[i] = replace(samples[i], gripper_in_base=samples[i].gripper_in_base @ off)
    samples[7] = replace(samples[7], gripper_in_base=samples[6].gripper_in_base)  # a stale joint state
    found = solve(board_in_hand, samples)
    assert found.outliers == [3, 7, 11]
    mm, deg = pose_difference(found.camera_in_base, clean.camera_in_base)
    assert mm < 1.5 and deg < 0.15


def test_a_board_printed_at_98_percent_is_named(board_in_hand) -> None:
    with pytest.raises(CalibrationError, match=r"printed at (98\.\d|97\.9) % .* its pitch is 39\.\d+ mm .*, not 40;"):
        solve(board_in_hand, board_in_hand.samples(20, noise_px=0.1, scale=0.98))


@pytest.mark.parametrize(
    ("axes", "words"), [((0.0, 0.0), "these were shifts only"), ((1.0, 0.0), "about one axis only")]
)
def test_singular_motions_are_refused(board_in_hand, axes: tuple[float, float], words: str) -> None:
    rng = np.random.default_rng(0)
    samples = []
    for _ in range(12):
        turn = Pose.from_xyz_rpy(rng.uniform(-0.05, 0.05, 3), (*(0.3 * rng.uniform(-1, 1) * np.array(axes)), 0.0))
        samples.append(board_in_hand.sample(rng, board_in_hand.start @ turn))
    with pytest.raises(CalibrationError, match=words):
        solve(board_in_hand, samples)


def test_few_samples_are_refused(board_in_hand) -> None:
    with pytest.raises(CalibrationError, match="9 samples, at least 10 needed"):
        solve(board_in_hand, board_in_hand.samples(9))


@pytest.mark.parametrize(
    ("what", "words"), [("camera", "the camera moved by"), ("board", "the board in the gripper moved")]
)
def test_what_moved_meanwhile_is_named(board_in_hand, what: str, words: str) -> None:
    shift = Pose.from_xyz_rpy((0.01, 0.0, 0.0), (0.0, 0.02, 0.0))
    place = board_in_hand.placement
    after = (
        replace(place, camera_in_base=shift @ place.camera_in_base)
        if what == "camera"
        else replace(place, board_in_gripper=place.board_in_gripper @ shift)
    )
    samples = board_in_hand.samples(20, noise_px=0.1)
    moved = board_in_hand._replace(placement=after).samples(20, noise_px=0.1)
    with pytest.raises(CalibrationError, match=rf"{words}.*near sample 1[1-5]:"):
        solve(board_in_hand, samples[:13] + moved[13:])


def test_samples_that_contradict_each_other_are_refused(board_in_hand) -> None:
    samples = board_in_hand.samples(14)
    poses = [sample.gripper_in_base for sample in samples]
    mixed = [replace(sample, gripper_in_base=poses[(5 * i + 3) % 14]) for i, sample in enumerate(samples)]
    with pytest.raises(CalibrationError, match=r"contradict each other|do not fit the others"):
        solve(board_in_hand, mixed)


def test_what_is_not_good_enough_is_refused_with_every_reason() -> None:
    with pytest.raises(CalibrationError, match=r"held-out misfit 2\.00 px \(at most 1\), uncertainty 0\.60 deg"):
        Acceptance().check(Misfit(2.0, 1.0, 0.1), Uncertainty(1.0, 0.6))
    with pytest.raises(CalibrationError, match="nan mm"):
        Acceptance().check(Misfit(0.1, float("nan"), 0.1), Uncertainty(1.0, 0.1))


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 3.0, np.pi])
def test_angles_of_rotations(angle: float) -> None:
    assert angle_of(Pose.from_xyz_rpy(np.zeros(3), (angle, 0.0, 0.0)).rotation) == pytest.approx(angle, abs=1e-12)
