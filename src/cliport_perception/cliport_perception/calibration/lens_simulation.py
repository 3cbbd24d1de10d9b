"""Lenses with a hidden truth, found by the procedure from synthetic pictures of a board that a person moves about."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from cliport_core.pose import FloatArray, Pose
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.lens_views import LensProcedure
from cliport_perception.calibration.procedures import Voice
from cliport_perception.calibration.result import SIGMAS
from cliport_perception.calibration.simulation import random_setup
from cliport_perception.calibration.synthetic import SyntheticCamera
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError

_VIEWS = 25
_MOST_PLACES = 250  # at which the board is held, before a run is given up
_GRID = (9, 16)  # of pixels at which the found lens is compared with the true one


def simulate_lenses(
    count: int, seed: int, board: Board, progress: Callable[[dict[str, Any]], None] = lambda row: None
) -> dict[str, Any]:
    """Return the runs, with median and worst errors of the focal length [%] and of the pixels [px] at the top."""
    runs = []
    for number in range(count):
        runs.append(_run(number, np.random.default_rng((seed, number)), board))
        progress(runs[-1])
    found = [run for run in runs if "error" not in run]
    top: dict[str, Any] = {"count": count, "seed": seed, "found": len(found), "board": board.describe()}
    for name in ("focal_percent", "median_px", "worst_px"):
        values = [run[name] for run in found]
        top |= {f"median_{name}": float(np.median(values)), f"greatest_{name}": max(values)} if found else {}
    return top | {"within": sum(run["within"] for run in found), "runs": runs}


def _run(number: int, rng: np.random.Generator, board: Board) -> dict[str, Any]:
    truth = random_setup(rng, board).camera
    drawn = SyntheticCamera(board, truth)
    said: list[str] = []
    procedure = LensProcedure(board, _VIEWS, Voice(said.append, lambda words: None))
    places = 0
    while not procedure.is_complete and places < _MOST_PLACES:
        places += 1
        pose = held_somewhere(rng, board, truth)
        for _ in range(2):
            procedure.on_picture(drawn.picture(pose, rng))
    row: dict[str, Any] = {"number": number, "places": places, "views": len(procedure.views)}
    try:
        found = procedure.solve()
    except CalibrationError as error:
        return row | {"error": str(error)}
    errors = [getattr(found.camera, name) - getattr(truth, name) for name in ("fx", "fy", "cx", "cy")]
    off = pixel_errors(truth, found.camera)
    return row | {
        "focal_percent": 100.0 * max(abs(errors[0]) / truth.fx, abs(errors[1]) / truth.fy),
        "errors_px": errors,
        "within": all(abs(error) <= SIGMAS * sigma for error, sigma in zip(errors, found.sigmas, strict=True)),
        "held_out_px": found.held_out_px,
        "median_px": float(np.median(off)),
        "worst_px": float(off.max()),
    }


def held_somewhere(rng: np.random.Generator, board: Board, camera: CameraModel) -> Pose:
    """Return a pose of the board in the optical frame: some place in the picture, some distance, some tilt."""
    at = rng.uniform((0.08 * camera.height, 0.08 * camera.width), (0.92 * camera.height, 0.92 * camera.width))
    ray = camera.rays()[int(at[0]), int(at[1])].astype(np.float64)
    tilts = rng.uniform(-math.radians(40.0), math.radians(40.0), 2)
    turn = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (tilts[0], tilts[1], rng.uniform(-0.5, 0.5)))
    middle = ray * rng.uniform(0.3, 0.8)
    return Pose(turn.rotation, middle - turn.rotation @ board.center)


def pixel_errors(truth: CameraModel, found: CameraModel) -> FloatArray:
    """Return how far apart (N,) [px] the two lenses put what lies along the true one's rays, over the whole picture.

    The camera is turned so that both fit best: a calibration of where it stands takes that up.
    """
    rows = np.linspace(0, truth.height - 1, _GRID[0]).astype(int)
    cols = np.linspace(0, truth.width - 1, _GRID[1]).astype(int)
    pixels: npt.NDArray[np.float64] = np.stack(np.meshgrid(rows, cols, indexing="ij"), axis=-1).reshape(-1, 2) * 1.0
    true, seen = (lens.rays()[np.ix_(rows, cols)].reshape(-1, 3) for lens in (truth, found))
    turn, _ = Rotation.align_vectors(_unit(seen), _unit(true))
    return np.asarray(np.linalg.norm(found.project(turn.apply(true)) - pixels, axis=1))


def _unit(rays: npt.NDArray[np.float32]) -> FloatArray:
    long = rays.astype(np.float64)
    return np.asarray(long / np.linalg.norm(long, axis=1, keepdims=True))
