"""A lens over ROS: pictures to a camera_info file, and that file in place of a camera_info without K."""

from __future__ import annotations

import re
from argparse import Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from ros_domain import next_domain
from ros_until import until
from sensor_msgs.msg import CameraInfo, Image

from cliport_core import messages, topics
from cliport_perception import CameraModel
from cliport_perception.calibration import ros_lens
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.cli import main as calibrate
from cliport_perception.calibration.lens_file import read_lens, write_lens
from cliport_perception.calibration.lens_solver import LensFit
from cliport_perception.calibration.procedures import Voice
from cliport_perception.calibration.ros_lens import LensNode, run_lens
from cliport_perception.calibration.ros_live import LiveCalibration
from cliport_perception.errors import CalibrationError

LENS = CameraModel(64, 48, 50.0, 50.0, 32.0, 24.0, "plumb_bob", (0.1, 0.0, 0.0, 0.0, 0.0))
FOUND = LensFit(LENS, 0.1, 0.1, (0.1, 0.1, 0.1, 0.1), ())
PICTURE = np.full((48, 64, 3), 7, np.uint8)


class Played:
    """A procedure that counts its pictures; complete from `enough` on, refused `refusals` times."""

    def __init__(self, enough: int = 3, refusals: int = 0) -> None:
        self.enough, self.refusals = enough, refusals
        self.pictures: list[Any] = []

    def on_picture(self, picture: Any) -> None:
        self.pictures.append(picture)
        if len(self.pictures) == 1:
            raise CalibrationError("the first one is odd")

    @property
    def is_complete(self) -> bool:
        return len(self.pictures) >= self.enough

    def solve(self) -> LensFit:
        if self.refusals:
            raise CalibrationError("tilt the board more")
        return FOUND

    def extend(self) -> int:
        self.refusals -= 1
        return 5


@pytest.fixture
def ros() -> Iterator[Node]:
    rclpy.init(domain_id=next_domain())
    node = rclpy.create_node("camera")
    yield node
    node.destroy_node()
    rclpy.try_shutdown()


def test_pictures_reach_the_procedure_until_it_has_enough(ros: Node, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros_lens, "_SILENT_S", 0.0)
    said: list[str] = []
    procedure: Any = Played()
    node = LensNode(procedure, Voice(said.append, said.append))
    assert until([node], lambda: bool(said))
    assert said == [f"nothing received on {topics.COLOR}: is the camera running, is the name remapped?"]
    color = ros.create_publisher(Image, topics.COLOR, qos_profile_sensor_data)
    sent: list[int] = []

    def show() -> None:
        color.publish(messages.image_to_msg(PICTURE, "rgb8"))
        sent.append(1)

    assert until([ros, node], lambda: procedure.is_complete, show)
    assert "the first one is odd" in said and np.array_equal(procedure.pictures[0], PICTURE)
    more = len(sent) + 5
    assert until([ros, node], lambda: len(sent) > more, show)
    assert len(procedure.pictures) == 3
    node.destroy_node()


def test_a_lens_is_written_once_it_is_good_and_the_old_one_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "lens.yaml"
    old = CameraModel(32, 24, 30.0, 30.0, 16.0, 12.0, "plumb_bob", (0.0,) * 5)
    write_lens(file, old)
    monkeypatch.setattr(ros_lens, "LensProcedure", lambda *given: Played(enough=0, refusals=1))
    said: list[str] = []
    options = Namespace(find_intrinsics=file, samples=20)
    assert run_lens(Board(), options, [], Voice(said.append, said.append)) == 0
    assert said == ["nothing is saved yet: tilt the board more; 5 more views follow, those taken are kept"]
    assert read_lens(file) == LENS
    first, second = capsys.readouterr().out.strip().splitlines()
    assert "camera_info_url" in first and read_lens(Path(second.split()[-1])) == old
    assert not rclpy.ok()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--find-intrinsics", "{folder}"], "it is a folder"),
        (["--find-intrinsics", "{folder}/lens.yaml", "--samples", "14"], "--samples must be 15 or more for a lens"),
        (["--camera-info", "{folder}/none.yaml"], "cannot read .*none.yaml: No such file"),
    ],
)
def test_bad_options_end_in_one_line(
    arguments: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [argument.format(folder=tmp_path) for argument in arguments]
    assert calibrate([*given, "--out", str(tmp_path / "camera.yaml")]) == 1
    error = capsys.readouterr().err.strip()
    assert error.startswith("error: ") and "\n" not in error
    assert re.search(words, error)
    assert not list(tmp_path.iterdir()) and not rclpy.ok()


def test_a_lens_from_a_file_stands_for_camera_info(ros: Node, monkeypatch: pytest.MonkeyPatch) -> None:
    said: list[str] = []
    begun: list[CameraModel] = []

    def start(camera: CameraModel) -> Any:
        begun.append(camera)
        return "a procedure"

    node = LiveCalibration(start, ("base", "hand"), said.append, LENS)
    assert begun == [LENS] and node.procedure == "a procedure" and node.camera == LENS
    node._on_info(CameraInfo(width=960, height=540))
    assert said == [] and begun == [LENS]
    node._began -= 60.0
    node._adapt()
    assert said == [f"nothing received on {topics.COLOR}: is the camera running, are the names remapped?"]
    node.destroy_node()
