"""The page's commands for a calibration: what is asked for, what is shown, and what is refused meanwhile."""

from __future__ import annotations

import sys
import threading
from pathlib import Path

import pytest

from demo_tool.calibration_process import CalibrationProcess, shared_arguments
from demo_tool.errors import NotNowError

NONE = {"board": "", "move": False, "first": ""}


def state(bench) -> dict:
    return bench.view["calibration"]


def test_what_it_says_is_shown_to_its_end(bench) -> None:
    bench.see()
    assert state(bench) == {"state": "none", "words": "", "lines": [], "share": 0.0}
    bench.do("calibrate", **NONE)
    made = bench.calibrations
    assert made.begun == [[]] and (state(bench)["state"], state(bench)["words"]) == ("running", "it begins")
    made.on_line("the board is not seen")
    made.on_line("sample 6 of 30: 0.04 px")
    assert (state(bench)["share"], state(bench)["lines"]) == (0.2, ["the board is not seen", "sample 6 of 30: 0.04 px"])
    for number in range(20):
        made.on_line(f"line {number}")
    assert state(bench)["lines"] == [f"line {number}" for number in range(8, 20)] and state(bench)["share"] == 0.2
    made.on_line("calibration/camera.yaml: camera at 0.9, 0, 0.8 m")
    made.on_end(0)
    assert (state(bench)["state"], state(bench)["share"]) == ("done", 1.0)
    assert bench.view["last"] == {
        "ok": True, "words": "the camera is calibrated: calibration/camera.yaml: camera at 0.9, 0, 0.8 m"
    }  # fmt: skip


def test_what_is_asked_for_becomes_options(bench) -> None:
    bench.see()
    bench.do("calibrate", board=" aruco:150:4X4_50 ", move=True, first="0.5 0 0.4 3.14 -0.8 0")
    assert bench.calibrations.begun == [
        ["--board", "aruco:150:4X4_50", "--first", "0.5", "0", "0.4", "3.14", "-0.8", "0", "--move"]
    ]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"board": "--out=/etc/passwd"}, "'board' must be a board's form"),
        ({"board": "x" * 81}, "'board' must be a board's form"),
        ({"board": 3}, "'board' must be a text"),
        ({"move": "yes"}, "'move' must be true or false"),
        ({"first": "0.5 0 0.4 3.14 -0.8 0"}, "a first pose is of a hand that is moved"),
        ({"move": True, "first": "0.5 0 0.4"}, "must be six numbers"),
        ({"move": True, "first": "0.5 0 0.4 a b c"}, "must be six numbers"),
        ({"move": True, "first": "0.5 0 0.4 nan 0 0"}, "must be six numbers"),
    ],
)
def test_what_makes_no_sense_begins_nothing(bench, change: dict, words: str) -> None:
    bench.see()
    assert words in bench.refused("calibrate", **{**NONE, **change})
    assert bench.calibrations.begun == [] and state(bench)["state"] == "none"


def test_meanwhile_nothing_else_moves_the_arm(bench) -> None:
    bench.begin()
    bench.draw()
    bench.do("calibrate", **NONE)
    for command in ("execute", "preview", "recover", "open_hand", "propose", "new_scene"):
        assert "the camera is being calibrated: stop that first" in bench.refused(command)
    assert "the camera is being calibrated" in bench.refused("calibrate", **NONE)
    bench.calibrations.on_end(0)
    bench.do("calibrate", **NONE)
    assert len(bench.calibrations.begun) == 2


def test_a_stopped_one_saves_nothing_and_says_so(bench) -> None:
    bench.see()
    assert bench.refused("stop_calibrating") == "no calibration runs"
    bench.do("calibrate", **NONE)
    bench.do("stop_calibrating")
    assert bench.calibrations.stops == 1 and state(bench)["state"] == "running"
    bench.calibrations.on_line("error: interrupted; nothing was written")
    bench.calibrations.on_end(130)
    assert (state(bench)["state"], state(bench)["words"]) == ("stopped", "stopped; nothing was saved")


@pytest.mark.parametrize(
    ("line", "words"),
    [("error: unknown marker dictionary 'X'", "unknown marker dictionary 'X'"), ("hm", "it ended with status 1: hm")],
)
def test_a_failure_has_its_reason(bench, line: str, words: str) -> None:
    bench.see()
    bench.do("calibrate", **NONE)
    bench.calibrations.on_line(line)
    bench.calibrations.on_end(1)
    assert (state(bench)["state"], state(bench)["words"]) == ("failed", words)
    assert bench.view["last"] == {"ok": False, "words": f"the camera is not calibrated: {words}"}


def test_what_cannot_begin_leaves_the_last_one_shown(bench) -> None:
    bench.see()
    bench.calibrations.fault = "the calibration cannot be started"
    assert bench.refused("calibrate", **NONE) == "the calibration cannot be started"
    assert state(bench)["state"] == "none"
    bench.station.close()
    assert bench.calibrations.closed


SAYS = "import sys; print(sys.argv[1:], flush=True)"
TIED = "import sys; print('begun', flush=True); sys.stdin.read(); print('its input ended', flush=True)"


class Heard:
    """What a process says, and its end."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.ends: list[int] = []
        self.spoke, self.ended = threading.Event(), threading.Event()

    def on_line(self, line: str) -> None:
        self.lines.append(line)
        self.spoke.set()

    def on_end(self, status: int) -> None:
        self.ends.append(status)
        self.ended.set()


def test_the_program_is_given_what_belongs_to_it() -> None:
    heard = Heard()
    ros = ["--ros-args", "-r", "__node:=page", "-r", "/camera/color/image_raw:=/eye/image", "-p", "rectified:=true"]
    process = CalibrationProcess(Path("out/camera.yaml"), "fr3", ros, (sys.executable, "-c", SAYS))
    process.begin(["--move"], heard.on_line, heard.on_end)
    assert heard.ended.wait(60) and heard.ends == [0]
    assert heard.lines == [
        "['--move', '--out', 'out/camera.yaml', '--robot', 'fr3', '--tied', '--ros-args', '-r', "
        "'/camera/color/image_raw:=/eye/image', '-p', 'rectified:=true']"
    ]
    assert shared_arguments(["--ros-args", "--remap", "__ns:=/left", "__node:=x"]) == ["--ros-args"]


def test_its_input_is_open_until_it_is_closed() -> None:
    heard = Heard()
    process = CalibrationProcess(Path("x"), "panda", (), (sys.executable, "-c", TIED))
    process.begin([], heard.on_line, heard.on_end)
    assert heard.spoke.wait(60) and not heard.ended.wait(0.3)
    assert process._process._process is not None and process._process._process.stdin is not None
    process._process._process.stdin.close()
    assert heard.ended.wait(60) and heard.lines == ["begun", "its input ended"]
    process.close()


def test_what_cannot_be_started_is_one_line() -> None:
    process = CalibrationProcess(Path("x"), "panda", (), ("/no/such/program",))
    with pytest.raises(NotNowError, match="the calibration cannot be started: No such file or directory"):
        process.begin([], lambda line: None, lambda status: None)
