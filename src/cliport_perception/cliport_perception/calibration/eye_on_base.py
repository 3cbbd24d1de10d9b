"""Eye on base: a fixed camera is calibrated by a board that the gripper carries about."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.initial_guess import Placement, guess_placement
from cliport_perception.calibration.odd_samples import explain_odd_samples
from cliport_perception.calibration.refinement import Refined, refine, reprojection_errors, sample_rms
from cliport_perception.calibration.result import SIGMAS, EyeOnBase, Misfit, SampleMisfit, Uncertainty, Use
from cliport_perception.calibration.sample import MotionLimits, Sample, check_motion
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError


@dataclass(frozen=True)
class SolverConfig:
    """Settings of the solver.

    held_out_share: of the samples, not fitted at first but predicted. outlier_px: a sample whose misfit is larger, and
    larger than outlier_times the median's, is left out. max_outlier_share: more of them are a fault of the set-up.
    scale_tolerance: how far the printed board's size may be from its nominal one.
    """

    held_out_share: float = 0.3
    outlier_px: float = 1.0
    outlier_times: float = 3.5
    max_outlier_share: float = 0.35
    scale_tolerance: float = 0.005
    motion: MotionLimits = field(default_factory=MotionLimits)


def solve_eye_on_base(
    samples: Sequence[Sample],
    camera: CameraModel,
    board: Board,
    rng: np.random.Generator,
    config: SolverConfig | None = None,
) -> EyeOnBase:
    """Return where the camera is, with its misfits and uncertainty.

    rng: draws trial samples, and those that are held out.

    Raises:
        CalibrationError: when the motion is singular, the samples do not agree with each other, the camera or the board
            moved while they were taken, or the board was printed at another size.
    """
    config = config or SolverConfig()
    check_motion(samples, config.motion)
    start, _ = guess_placement(samples, rng)
    refined, kept = _without_outliers(samples, start, camera, config)
    odd = set(range(len(samples))) - set(kept)
    _check_odd(samples, sorted(odd), kept, refined.placement, camera, config)
    good = [samples[i] for i in kept]
    check_motion(good, config.motion)
    scale = _checked_scale(good, refined.placement, camera, board, config)
    final = refine(good, refined.placement, camera)
    held = set(_held_out(kept, config.held_out_share, rng))
    predicting = refine([samples[i] for i in kept if i not in held], final.placement, camera).placement
    misfits = _misfits(samples, final.placement, predicting, held, odd, camera, board)
    return EyeOnBase(
        final.placement.camera_in_base,
        final.placement.board_in_gripper,
        _pooled(misfits, Use.FITTED),
        _pooled(misfits, Use.HELD_OUT),
        Uncertainty.of_covariance(final.covariance),
        tuple(misfits),
        scale.scale,
        scale.scale_sigma,
    )


def _check_odd(
    samples: Sequence[Sample],
    odd: list[int],
    kept: list[int],
    placement: Placement,
    camera: CameraModel,
    config: SolverConfig,
) -> None:
    """Refuse samples of which too many do not fit, or whose misfits have one cause."""
    explain_odd_samples(samples, odd, kept, placement, camera)
    if len(odd) > config.max_outlier_share * len(samples):
        raise CalibrationError(
            f"{len(odd)} of {len(samples)} samples do not fit the others, at most "
            f"{100 * config.max_outlier_share:.0f} % may: does the board sit firmly in the gripper, and do pictures "
            "and joint states have one clock?"
        )


def _without_outliers(
    samples: Sequence[Sample], start: Placement, camera: CameraModel, config: SolverConfig
) -> tuple[Refined, list[int]]:
    """Return the placement of the samples that agree with it, and their indices."""
    kept = list(range(len(samples)))
    refined = refine(samples, start, camera, robust=True)
    for _ in range(6):
        rms = sample_rms(reprojection_errors(samples, refined.placement, camera))
        limit = max(config.outlier_px, config.outlier_times * float(np.median(rms[kept])))
        agreeing = [i for i in range(len(samples)) if rms[i] <= limit]
        if agreeing == kept or len(agreeing) < 4:
            break
        kept = agreeing
        refined = refine([samples[i] for i in kept], refined.placement, camera, robust=True)
    return refined, kept


def _checked_scale(
    samples: Sequence[Sample], start: Placement, camera: CameraModel, board: Board, config: SolverConfig
) -> Refined:
    refined = refine(samples, start, camera, fit_scale=True)
    off, spread = refined.scale - 1.0, SIGMAS * refined.scale_sigma
    if abs(off) > max(config.scale_tolerance, spread):
        raise CalibrationError(
            f"the board was printed at {100 * refined.scale:.1f} % (+-{100 * spread:.1f}) of its nominal size: its "
            f"pitch is {1e3 * refined.scale * board.pitch:.2f} mm by the arm's motion, not {1e3 * board.pitch:g}; "
            "print it at 100 %, or give --board the size that you measure"
        )
    return refined


def _held_out(kept: list[int], share: float, rng: np.random.Generator) -> list[int]:
    return [int(i) for i in rng.choice(kept, size=max(1, round(share * len(kept))), replace=False)]


def _misfits(
    samples: Sequence[Sample],
    final: Placement,
    predicting: Placement,
    held: set[int],
    odd: set[int],
    camera: CameraModel,
    board: Board,
) -> list[SampleMisfit]:
    misfits = []
    for i, sample in enumerate(samples):
        use = Use.OUTLIER if i in odd else Use.HELD_OUT if i in held else Use.FITTED
        placement = final if use is Use.OUTLIER else predicting
        px = float(sample_rms(reprojection_errors([sample], placement, camera))[0])
        drawn, seen = placement.board_in_camera(sample.gripper_in_base), sample.view.board_in_camera
        mm = 1e3 * float(np.linalg.norm(drawn.apply(board.center) - seen.apply(board.center)))
        misfits.append(SampleMisfit(use, Misfit(px, mm, pose_difference(drawn, seen)[1])))
    return misfits


def _pooled(misfits: list[SampleMisfit], use: Use) -> Misfit:
    """Return the root mean square [px], and medians of the others: a single far or level view is no good measure."""
    rows = np.array([sample.misfit for sample in misfits if sample.use is use])
    px = np.sqrt(np.mean(rows[:, 0] ** 2))
    return Misfit(float(px), float(np.median(rows[:, 1])), float(np.median(rows[:, 2])))
