"""Each bad input ends in one clear line, and docs/calibration.md says which."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("sensor_msgs.msg")

from geometry_msgs.msg import Quaternion, Transform
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo

from cliport_core import WorkspaceSpec, messages
from cliport_core.errors import CoreError
from cliport_core.images import decode_depth
from cliport_core.pose import Pose
from cliport_core.raw_image import image_of_raw
from cliport_perception.calibration.board import parse_board
from cliport_perception.calibration.calibration_file import load_calibration
from cliport_perception.calibration.detection import BoardDetector, Refusal
from cliport_perception.calibration.eye_on_base import solve_eye_on_base
from cliport_perception.calibration.synthetic import SyntheticCamera
from cliport_perception.camera_health import CameraHealth, HealthLimits
from cliport_perception.conversions import CameraReader
from cliport_perception.frame_processor import FrameProcessor

DOCS = Path(__file__).resolve().parents[3] / "docs/calibration.md"
S = 1_000_000_000
LENS = "width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0"
CAMERA = f"camera: {{position: [0.9, 0.0, 0.8], looking_at: [0.4, 0.0, 0.0], {LENS}}}\n"


class Inputs:
    """What is wrong, by the name that the table in the docs gives it; each raises, or returns, the line."""

    def __init__(self, folder: Path, board_in_hand: Any, box_scene: Any) -> None:
        self._folder, self._world, self._scene = folder, board_in_hand, box_scene

    def lines(self) -> dict[str, Callable[[], str | None]]:
        file, depth = self._loaded, self._scene.depth
        return {
            "no marker in the picture": lambda: self._look(None),
            "a board of another dictionary": lambda: self._look("charuco:5x4:40:30:6X6_250"),
            "a camera that moves during sampling": self._camera_moved,
            "pure translation": lambda: self._solved([0.0, 0.0, 0.0]),
            "turns about one axis": lambda: self._solved([0.3, 0.0, 0.0]),
            "a board printed at 98 %": lambda: self._world_solved(self._world.samples(20, noise_px=0.1, scale=0.98)),
            "a YAML file without a field": lambda: file(CAMERA.replace("fx: 500.0, ", "")),
            "a YAML file with a number that is not finite": lambda: file(CAMERA.replace("0.8]", ".nan]")),
            "`camera_info` without K": lambda: self._info(CameraInfo(width=640, height=480)),
            "depth of another size than colour": lambda: self._processed(depth[::2, ::2].copy()),
            "16UC1 depth in tenths of millimetres": lambda: self._processed(10 * depth),
            "32FC1 depth in millimetres": lambda: self._decoded(1e3 * depth),
            "clocks that differ": lambda: health().check_age(160 * S, 100 * S),
            "a camera at 1 Hz": lambda: health(S).report(100 * S, 1, 0).message,
            "a transform that is no rotation": self._no_rotation,
        }

    def _look(self, shown: str | None) -> str:
        board, rng = self._world.board, np.random.default_rng(0)
        drawn = SyntheticCamera(parse_board(shown) if shown else board, self._world.camera)
        facing = Pose.from_xyz_rpy((-0.1, -0.08, 0.6 if shown else -1.0), (0.3, 0.0, 0.2))
        found = BoardDetector(board, self._world.camera).look(drawn.picture(facing, rng))
        assert isinstance(found, Refusal)
        return found.words

    def _world_solved(self, samples: list[Any]) -> str:
        return str(solve_eye_on_base(samples, self._world.camera, self._world.board, np.random.default_rng(0)))

    def _solved(self, turn: list[float]) -> str:
        rng, start = np.random.default_rng(0), self._world.start
        moves = (Pose.from_xyz_rpy(rng.uniform(-0.05, 0.05, 3), rng.uniform(-1, 1) * np.array(turn)) for _ in range(12))
        return self._world_solved([self._world.sample(rng, start @ move) for move in moves])

    def _camera_moved(self) -> str:
        place = self._world.placement
        shift = Pose.from_xyz_rpy((0.01, 0.0, 0.0), (0.0, 0.02, 0.0))
        after = self._world._replace(placement=replace(place, camera_in_base=shift @ place.camera_in_base))
        return self._world_solved(self._world.samples(20, noise_px=0.1)[:13] + after.samples(20, noise_px=0.1)[13:])

    def _loaded(self, text: str) -> str:
        path = self._folder / "camera.yaml"
        path.write_text(text + "calibration: {}\n")
        try:
            return str(load_calibration(path))
        finally:
            assert path.read_text().startswith(text), "it was overwritten"

    def _info(self, info: CameraInfo) -> str:
        return str(CameraReader().read(bytes(serialize_message(info))))

    def _processed(self, depth: np.ndarray) -> str:
        processor = FrameProcessor(WorkspaceSpec(), CameraHealth({}, HealthLimits()), 0.0, 0.0)
        return str(processor.process(self._scene.color, depth, self._scene.camera, self._scene.camera_in_base, 0))

    def _decoded(self, depth: np.ndarray) -> str:
        image = messages.image_to_msg(depth.astype(np.float32), "32FC1")
        return str(decode_depth(image_of_raw(bytes(serialize_message(image)))))

    def _no_rotation(self) -> str:
        return str(messages.pose_from_transform_msg(Transform(rotation=Quaternion(x=0.0, y=0.0, z=0.0, w=0.0))))


def health(period_ns: int = S // 10) -> CameraHealth:
    streams = ("color", "depth", "camera_info")
    made = CameraHealth(dict.fromkeys(streams, "/t"), HealthLimits())
    for stream in streams:
        made.on_message(stream)
    for i in range(5):
        now = 100 * S - (4 - i) * period_ns
        assert made.check_age(now, now) is None
        made.on_served()
    return made


def documented() -> dict[str, str]:
    """The rows of the table in the docs."""
    section = DOCS.read_text().partition("\n## Bad input\n")[2].partition("\n## ")[0]
    return dict(re.findall(r"^\| (.+?) \| `(.+)` \|$", section, re.MULTILINE))


def test_each_bad_input_ends_in_the_line_that_the_docs_have(tmp_path: Path, board_in_hand, box_scene) -> None:
    said = {}
    for name, call in Inputs(tmp_path, board_in_hand, box_scene).lines().items():
        try:
            said[name] = str(call())
        except (CoreError, ValueError) as error:
            said[name] = str(error)
        said[name] = said[name].replace(f"{tmp_path}/", "")
        assert "\n" not in said[name]
    table = "\n".join(f"| {name} | `{line}` |" for name, line in said.items())
    assert without_digits(documented()) == without_digits(said), table


def without_digits(lines: dict[str, str]) -> dict[str, str]:
    """A solver's last digits depend on the machine."""
    return {name: re.sub(r"\d+(\.\d+)?", "N", line) for name, line in lines.items()}
