"""The live procedure's way of moving the hand by itself: a tour, driven by the executor."""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from rclpy.node import Node

from cliport_core.pose import Pose
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.procedures import EyeOnBaseProcedure, Procedure, Voice
from cliport_perception.calibration.ros_mover import HandMover
from cliport_perception.calibration.tour import Tour
from cliport_perception.errors import CalibrationError

Running = Callable[[], Procedure | None]

_SPARE = 0.05  # of what a board of that size reaches from the tcp, when nobody says how it is fixed [m]


def check_moving(options: argparse.Namespace) -> None:
    """Check that the options that move the arm go together. Raises CalibrationError."""
    if not options.move:
        if options.first is not None or options.carried is not None:
            raise CalibrationError("--first and --carried belong to --move")
        return
    if options.board_at is not None or options.touched is not None:
        raise CalibrationError("--move needs a board that the gripper carries: leave --board-at and --touched away")
    if options.carried is not None and options.carried <= 0.0:
        raise CalibrationError(f"--carried must be a length above zero [m], got {options.carried:g}")


@contextmanager
def moving(
    node: Node, running: Running, base_frame: str, board: Board, options: argparse.Namespace, voice: Voice
) -> Iterator[Callable[[], None]]:
    """Give what moves the hand on, to be called all the time; at the end nothing moves any more.

    running: returns the procedure, None before it has begun.
    """
    carried = options.carried or math.hypot(*board.size) / 2.0 + _SPARE
    first = None if options.first is None else Pose.from_xyz_rpy(options.first[:3], options.first[3:])
    mover = HandMover(node, base_frame, carried, voice.say)

    def propose(tried: Sequence[Pose]) -> Pose | None:
        procedure = running()
        return procedure.propose(tried) if isinstance(procedure, EyeOnBaseProcedure) else None

    tour = Tour(propose, mover, voice.complain, first)
    voice.say(
        f"the executor moves the hand, with {1e3 * carried:.0f} mm about the fingertips kept free for the board; it "
        "avoids the arm and the table only: clear the rest, and be at the stop"
    )

    def step() -> None:
        procedure = running()
        if isinstance(procedure, EyeOnBaseProcedure):
            tour.tick(time.monotonic(), procedure.sample_count)

    try:
        yield step
    finally:
        mover.close()
