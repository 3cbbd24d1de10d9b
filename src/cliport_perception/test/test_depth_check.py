"""The depth camera's scale and offset and the table's height: found as they were made, and as sure as is claimed."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cliport_core import Pose, WorkspaceSpec
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.depth_check import DepthCheck, Estimate, check_depth
from cliport_perception.calibration.view import BoardView, fit_view
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.table_watch import TableWatch

WORKSPACE = WorkspaceSpec()
LYING = Pose.from_xyz_rpy((0.35, 0.15, 0.0), (np.pi, 0.0, 0.3))
BOARD = Board()
CORNERS = np.asarray(BOARD.cv_board.getChessboardCorners(), dtype=np.float64)


def board_view(scene, rng: np.random.Generator | None = None) -> BoardView:
    """The board on the table, seen with 0.05 px of noise."""
    pixels = scene.camera.project((scene.camera_in_base.inverse() @ LYING).apply(CORNERS))
    if rng is not None:
        pixels = pixels + rng.normal(0.0, 0.05, pixels.shape)
    view = fit_view(CORNERS, pixels, scene.camera)
    assert view is not None
    return view


def check(scene, depth: np.ndarray, view: BoardView | None, up: float = 0.0) -> DepthCheck | None:
    """The check of a depth image; up: how far the calibration has the camera too high [m]."""
    pose = Pose(scene.camera_in_base.rotation, scene.camera_in_base.translation + np.array([0.0, 0.0, up]))
    plane = TableWatch(scene.camera, pose, WORKSPACE).measure(depth)
    assert plane is not None
    return check_depth(depth, view, CameraCalibration(scene.camera, pose), WORKSPACE, plane)


def measured(scene, scale: float, offset: float, rng: np.random.Generator | None = None) -> np.ndarray:
    """What a depth camera with this error reads, 2 mm of noise."""
    depth = (scene.depth - offset) / scale
    return depth if rng is None else (depth + rng.normal(0.0, 0.002, depth.shape)).astype(np.float32)


@pytest.mark.parametrize(("scale", "offset"), [(1.0, 0.0), (1.01, 0.0), (1.0, 0.008), (0.985, -0.01)])
@pytest.mark.parametrize("with_board", [True, False])
def test_scale_and_offset_are_found(table_scene, scale: float, offset: float, with_board: bool) -> None:
    found = check(table_scene, measured(table_scene, scale, offset), board_view(table_scene) if with_board else None)
    assert found is not None and found.scale is not None
    assert found.scale.value == pytest.approx(scale, abs=5e-4)
    assert found.offset.value == pytest.approx(offset, abs=5e-4)
    assert (found.mended is not None) is with_board
    if found.mended is not None:
        assert found.mended.value == pytest.approx(0.0, abs=5e-4)


@pytest.mark.parametrize("seed", range(10))
def test_errors_are_within_the_deviations_that_are_claimed(table_scene, seed: int) -> None:
    rng = np.random.default_rng(seed)
    depth = measured(table_scene, 1.012, -0.006, rng)
    found = check(table_scene, depth, board_view(table_scene, rng))
    assert found is not None and found.scale is not None and found.mended is not None
    assert abs(found.scale.value - 1.012) < 3.0 * found.scale.sigma < 0.02
    assert abs(found.offset.value + 0.006) < 3.0 * found.offset.sigma < 0.01
    assert abs(found.mended.value) < 3.0 * found.mended.sigma < 0.02
    alone = check(table_scene, depth, None)
    assert alone is not None and alone.scale is not None
    assert abs(alone.scale.value - 1.012) < 3.0 * alone.scale.sigma < 0.02
    assert abs(alone.offset.value + 0.006) < 3.0 * alone.offset.sigma < 0.01


def test_a_board_tells_a_table_that_is_elsewhere_from_a_scale(table_scene) -> None:
    depth = measured(table_scene, 1.0, 0.0)
    found = check(table_scene, depth, board_view(table_scene), up=0.01)
    assert found is not None and found.scale is not None and found.mended is not None
    assert found.scale.value == pytest.approx(1.0, abs=5e-4)
    assert found.table.value == pytest.approx(0.01, abs=2e-4) and found.mended.value == pytest.approx(0.01, abs=5e-4)
    alone = check(table_scene, depth, None, up=0.01)
    assert alone is not None and alone.scale is not None and alone.mended is None
    assert alone.scale.value == pytest.approx(0.96 / 0.95, abs=5e-4), "the table is taken to be at z = 0"


def test_a_camera_that_looks_straight_down_tells_an_offset_only(cast_scene, camera) -> None:
    down = Pose(np.diag([1.0, -1.0, -1.0]), np.array([0.45, 0.0, 1.0]))
    scene = cast_scene(camera, down)
    found = check(scene, measured(scene, 1.0, 0.007, np.random.default_rng(0)), None)
    assert found is not None and found.scale is None
    assert abs(found.offset.value - 0.007) < max(3.0 * found.offset.sigma, 2e-4)
    assert "too little to tell a scale from an offset" in found.in_words("panda_link0")[0]
    lying = Pose.from_xyz_rpy((0.35, -0.2, 0.0), (np.pi, 0.0, 0.3))
    pixels = camera.project((down.inverse() @ lying).apply(CORNERS))
    depth = measured(scene, 1.0, 0.007, np.random.default_rng(0))
    with_board = check(scene, depth, fit_view(CORNERS, pixels, camera))
    assert with_board is not None and with_board.scale is None and with_board.mended is not None
    assert abs(with_board.offset.value - 0.007) < 3.0 * with_board.offset.sigma < 0.01
    assert abs(with_board.mended.value) < 3.0 * with_board.mended.sigma < 0.01


def test_the_executors_parameter_is_named() -> None:
    found = DepthCheck(Estimate(1.0123, 0.001), Estimate(-0.0052, 0.0005), Estimate(0.0034, 0.0001), None, 0.5)
    assert found.in_words("panda_link0") == [
        "depth: true = 1.0123 (+-0.0030) x measured -5.2 mm (+-1.5), from the table, taken to be at z = 0; 3 standard "
        "deviations",
        "table_z: perception sees the table's top at 0.0034 (+-0.0003) m in panda_link0: set the executor's table_z to "
        "0.0034",
    ]
    with_board = found._replace(mended=Estimate(0.001, 0.0005)).in_words("base")
    assert "from table and board" in with_board[0]
    assert with_board[2] == "table: by the board, and with depth corrected so, its top is at 0.0010 (+-0.0015) m"


def test_too_little_of_the_table_says_nothing(table_scene) -> None:
    plane = TableWatch(table_scene.camera, table_scene.camera_in_base, WORKSPACE).measure(table_scene.depth)
    assert plane is not None
    calibration = CameraCalibration(table_scene.camera, table_scene.camera_in_base)
    assert check_depth(np.full_like(table_scene.depth, np.nan), None, calibration, WORKSPACE, plane) is None


def test_a_board_without_depth_at_its_corners_is_left_out(table_scene) -> None:
    view = board_view(table_scene)
    depth = table_scene.depth.copy()
    for row, col in np.rint(view.pixels).astype(int):
        depth[row - 3 : row + 4, col - 3 : col + 4] = np.nan
    found = check(table_scene, depth, view)
    assert found is not None and found.mended is None and math.isfinite(found.offset.sigma)
