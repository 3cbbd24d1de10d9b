"""A printed calibration board that is fixed to the simulated hand: seen by the camera, touched by nothing."""

from __future__ import annotations

import numpy as np

from cliport_core import Pose
from cliport_perception import CameraModel
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.synthetic import SyntheticCamera
from panda_model import HandModel
from sim_bridge.rendering.clean_frame import CleanFrame
from sim_bridge.rendering.image_window import ImageWindow

_BEFORE_TCP = 0.05  # how far the sheet hangs before the fingers, along the tcp's x: clear of the palm [m]
# With the hand pointing down and its x away from the robot, the print faces away from the robot, its top up.
_TURN = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def board_in_tcp(board: Board) -> Pose:
    """Return where the board's frame is in the tcp's: its middle before the fingertips."""
    return Pose(_TURN, np.array([_BEFORE_TCP, 0.0, 0.0]) - _TURN @ board.center)


class HeldBoard:
    """Draws the board over what a camera sees. hand: which holds it."""

    def __init__(self, board: Board, hand: HandModel, camera: CameraModel, window: ImageWindow) -> None:
        self.board = board
        self._rows, self._cols = window.slices
        self._drawn = SyntheticCamera(board, camera)
        tcp_in_hand = Pose(np.eye(3), np.array([0.0, 0.0, hand.tcp_from_hand]))
        self._board_in_hand = tcp_in_hand @ board_in_tcp(board)

    def over(self, frame: CleanFrame, hand_in_base: Pose, camera_in_base: Pose) -> CleanFrame:
        """Return the frame with the board where nothing nearer hides it."""
        board_in_camera = camera_in_base.inverse() @ hand_in_base @ self._board_in_hand
        covered = self._drawn.cover(board_in_camera)
        if covered is None:
            return frame
        whole = self._drawn.camera.height, self._drawn.camera.width
        share, ink, depth = np.zeros(whole), np.zeros(whole), np.full(whole, np.inf)
        share[covered.part], ink[covered.part], depth[covered.part] = covered.share, covered.ink, covered.depth
        share, ink, depth = (layer[self._rows, self._cols] for layer in (share, ink, depth))
        seen = (share > 0.0) & (depth > 0.0) & (depth < frame.depth)
        share, ink = np.where(seen, share, 0.0), np.where(seen, ink, 0.0)
        mixed = frame.color * (1.0 - share[..., None]) + ink[..., None]
        solid = seen & (share > 0.5)
        sight = board_in_camera.rotation[:, 2] @ board_in_camera.apply(self.board.center)
        cosine = abs(float(sight)) / float(np.linalg.norm(board_in_camera.apply(self.board.center)))
        return CleanFrame(
            np.rint(mixed).astype(np.uint8),
            np.where(solid, depth, frame.depth).astype(np.float32),
            np.where(solid, cosine, frame.facing).astype(np.float32),
        )
