"""A board that is fixed to the simulated hand: where the camera sees it, and what hides it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from cliport_core import Pose
from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.detection import BoardDetector
from cliport_perception.calibration.view import BoardView
from sim_bridge.node_parameters import ParameterError, SimParameters
from sim_bridge.rendering.camera import CameraConfig, RgbdFrame, SimCamera
from sim_bridge.rendering.held_board import board_in_tcp
from sim_bridge.rendering.image_window import ImageWindow
from sim_bridge.rendering.sensor_noise import NoiseConfig, SensorKind
from sim_bridge.world import SimWorld

BOARD = Board()
CONFIG = CameraConfig(noise=NoiseConfig.of_kind(SensorKind.PERFECT), held_board=BOARD)


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    made = SimWorld()
    yield made
    made.close()


def facing(world: SimWorld, distance: float = 0.8) -> Pose:
    """Return a camera's pose that looks straight at the board from so far [m]."""
    board = world.panda.tcp_in_base() @ board_in_tcp(BOARD)
    middle = board.apply(BOARD.center)
    return Pose(board.rotation, middle - distance * board.rotation[:, 2])


def taken(world: SimWorld, config: CameraConfig) -> RgbdFrame:
    return SimCamera(config).capture(world, np.random.default_rng(0))


def test_the_board_is_found_where_the_hand_holds_it(world: SimWorld) -> None:
    for turn in ((0.0, 0.0, 0.0), (0.3, -0.2, 0.5)):
        about = Pose.from_xyz_rpy((0.0, 0.0, 0.8), turn) @ Pose(np.eye(3), np.array([0.0, 0.0, -0.8]))
        camera = facing(world) @ about
        view = BoardDetector(BOARD, CONFIG.intrinsics).look(taken(world, replace(CONFIG, camera_in_base=camera)).color)
        assert isinstance(view, BoardView), view
        held = camera.inverse() @ world.panda.tcp_in_base() @ board_in_tcp(BOARD)
        mm, deg = pose_difference(view.board_in_camera, held)
        assert len(view.points) == BOARD.corner_count and mm < 1.0 and deg < 0.5


def test_its_depth_is_that_of_the_sheet(world: SimWorld) -> None:
    config = replace(CONFIG, camera_in_base=facing(world))
    with_board, without = taken(world, config), taken(world, replace(config, held_board=None))
    nearer = np.nan_to_num(with_board.depth) != np.nan_to_num(without.depth)
    assert 5000 < nearer.sum() < 60000
    assert np.allclose(with_board.depth[nearer], 0.8, atol=1e-3)


def test_what_is_nearer_hides_it(world: SimWorld) -> None:
    behind = facing(world) @ Pose.from_xyz_rpy((0.0, 0.0, 1.6), (0.0, np.pi, 0.0))
    config = replace(CONFIG, camera_in_base=behind)
    with_board, without = taken(world, config), taken(world, replace(config, held_board=None))
    sheet, covered = with_board.depth != without.depth, without.depth < 0.78
    assert sheet.sum() > 1000 and covered.sum() > 1000
    assert not (sheet & covered).any(), "the hand is before its back"


def test_a_part_of_the_image_shows_the_same(world: SimWorld) -> None:
    config = replace(CONFIG, camera_in_base=facing(world))
    window = ImageWindow(180, 400, 300, 620)
    part = taken(world, replace(config, window=window))
    assert np.array_equal(part.color[window.slices], taken(world, config).color[window.slices])


def test_a_form_that_is_none_is_refused() -> None:
    assert SimParameters().board is None
    assert SimParameters(held_board="charuco").board == BOARD
    with pytest.raises(ParameterError, match="held_board: 'chess' describes no board"):
        _ = SimParameters(held_board="chess").board
