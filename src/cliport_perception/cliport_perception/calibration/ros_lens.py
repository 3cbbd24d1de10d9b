"""The procedure for a lens over ROS: pictures in, a camera_info file out; no arm and no camera_info needed."""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from rclpy.node import Node

from cliport_core.errors import CoreError
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.lens_file import write_lens
from cliport_perception.calibration.lens_views import LensProcedure, check_count
from cliport_perception.calibration.procedures import Voice
from cliport_perception.calibration.ros_pictures import RosPicture, subscribe_pictures
from cliport_perception.calibration.ros_session import ros_session
from cliport_perception.calibration.saving import check_writable
from cliport_perception.errors import CalibrationError

_SILENT_S = 5.0


class LensNode(Node):
    """Feeds the procedure with pictures."""

    def __init__(self, procedure: LensProcedure, voice: Voice) -> None:
        """Subscribe."""
        super().__init__("calibrate")
        self._procedure, self._voice = procedure, voice
        self._pictures = 0
        self._began = time.monotonic()
        self._input = subscribe_pictures(self, self._on_picture)
        self.create_timer(1.0, self._adapt)

    def _adapt(self) -> None:
        self._input.adapt()
        if not self._pictures and time.monotonic() - self._began > _SILENT_S:
            name = self._input.topic_name
            self._voice.complain(f"nothing received on {name}: is the camera running, is the name remapped?")

    def _on_picture(self, picture: RosPicture) -> None:
        self._pictures += 1
        if self._procedure.is_complete:
            return
        try:
            self._procedure.on_picture(picture.color())
        except CoreError as error:
            self._voice.complain(str(error))


def run_lens(board: Board, options: argparse.Namespace, ros_args: list[str], voice: Voice) -> int:
    """Run the procedure until the lens is found; return the exit status.

    Raises:
        CalibrationError: when the file cannot be written. Nothing is overwritten then.
    """
    path: Path = options.find_intrinsics
    check_count(options.samples)
    check_writable(path)
    procedure = LensProcedure(board, options.samples, voice)
    with ros_session(ros_args) as executor:
        executor.add_node(LensNode(procedure, voice))
        while True:
            while not procedure.is_complete:
                executor.spin_once(timeout_sec=0.1)
            try:
                found = procedure.solve()
                break
            except CalibrationError as error:
                more = procedure.extend()
                voice.say(f"nothing is saved yet: {error}; {more} more views follow, those taken are kept")
    kept = write_lens(path, found.camera)
    print(f"{path}: give it to the camera's driver as camera_info_url, or to calibrate as --camera-info")
    if kept is not None:
        print(f"the file that was there is kept as {kept}")
    return 0
