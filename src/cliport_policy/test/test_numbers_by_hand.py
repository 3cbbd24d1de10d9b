"""Distances, shares and tables of what a policy is worth, by hand."""

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.calibration import TEMPERATURES, expected_calibration_error
from cliport_policy.card import Card
from cliport_policy.comparison import Comparison, Errors, Span, _rounded, action_errors, summarize
from cliport_policy.config import NetworkConfig
from cliport_policy.data.demonstrations import Demonstration
from cliport_policy.data.mixture import Source, _probabilities
from cliport_policy.errors import ConfigError, DataError
from cliport_policy.inference import Inference
from cliport_policy.offline_report import table, write_report
from cliport_policy.peaks import CellGrid
from cliport_policy.reliability import THRESHOLDS, Reliability, _is_right, _progress
from cliport_policy.reliability import table as reliability_table

STEP = Comparison("one", 3, 7, "put it there", (0.1, 0.2, 0.3), (0.4, 0.5, 0.6))


def far(pick_mm: float, place_mm: float = 0.0) -> Comparison:
    errors = Errors(pick_mm / 2.5, pick_mm, 1.0, place_mm / 2.5, place_mm, 2.0)
    return replace(STEP, errors=errors, done_probability=0.25)


def test_errors_of_an_action() -> None:
    ours = PickPlaceAction(PlanarPose(0.403, 0.104, 0.2), PlanarPose(0.5, 0.22, 3.0))
    theirs = PickPlaceAction(PlanarPose(0.4, 0.1, 0.1), PlanarPose(0.5, 0.2, -3.0))
    found = action_errors(ours, theirs, WorkspaceSpec(pixel_size=0.005))
    turned = math.degrees(2 * math.pi - 5.9)
    assert found == Errors(1.0, 5.0, round(math.degrees(0.1), 2), 4.0, 20.0, round(turned, 2))
    assert found.worst_mm == 20.0


@pytest.mark.parametrize(
    ("yaw", "jaws", "turn"), [(0.0, 0.0, 0.0), (80.0, 80.0, 80.0), (100.0, 80.0, 100.0), (190.0, 10.0, 170.0)]
)
def test_jaws_repeat_after_half_a_turn_and_turns_after_a_whole(yaw: float, jaws: float, turn: float) -> None:
    theirs, place = PlanarPose(0.4, 0.1, 0.0), PlanarPose(0.5, 0.2, 0.0)
    ours = PickPlaceAction(replace(theirs, yaw=math.radians(yaw)), place)
    found = action_errors(ours, PickPlaceAction(theirs, place), WorkspaceSpec())
    assert (found.pick_deg, found.turn_deg) == pytest.approx((jaws, turn))


def test_a_pose_is_rounded_to_a_tenth_of_a_millimetre() -> None:
    assert _rounded(PlanarPose(0.12344, 0.98766, 4.0)) == (0.1234, 0.9877, round(4.0 - 2 * math.pi, 4))


def test_a_span_is_from_the_first_to_the_last() -> None:
    span = Span()
    assert span.seconds == 0.0
    for stamp_ns in (5_000_000_000, 3_000_000_000, 4_500_000_000):
        span.add(stamp_ns)
    assert span.seconds == pytest.approx(2.0) and Span(0, 10**9).seconds == pytest.approx(1.0)


def test_a_summary_of_eleven_steps() -> None:
    """Ten answers of 10, 12 .. 28 mm and a refused one, which counts as a miss."""
    found = summarize([*(far(10.0 + 2 * i, 20.0 if i % 2 else 20.1) for i in range(10)), replace(STEP, refused="x")])
    assert found["steps"] == 11 and found["refused"] == 1
    assert found["pick_mm"] == {"median": 19.0, "nine_in_ten": 26.0, "worst": 28.0}
    assert found["pick_within_20_mm"] == round(6 / 11, 4) and found["place_within_20_mm"] == round(5 / 11, 4)
    assert found["both_within_20_mm"] == round(3 / 11, 4)
    assert summarize([])["pick_within_20_mm"] == 0.0 and "pick_mm" not in summarize([])


def test_the_table_of_an_offline_run(tmp_path: Path) -> None:
    long = replace(far(5.0, 7.5), source="a" * 30 + "xyz", step=12)
    shown = table([long, replace(STEP, refused="too odd")]).splitlines()
    heads = ("pick px", "mm", "deg", "place px", "mm", "turn deg", "done")
    assert shown[0] == f"{'episode':<24}{'step':>5}" + "".join(f"{head:>9}" for head in heads) + "  instruction"
    numbers = "".join(f"{number:>9}" for number in ("2.0", "5.0", "1.0", "3.0", "7.5", "2.0", "0.25"))
    assert shown[1] == f"{'a' * 20}xyz    12{numbers}  put it there"
    assert shown[2:5] == [f"{'one':<24}    3  refused: too odd", "", "2 steps, 1 refused"]
    assert "pick mm: median 5, nine in ten 5, worst 5" in shown and "both within 20 mm: 50 %" in shown
    write_report(tmp_path / "new", "mine", [long], [{"success": True}])
    report = json.loads((tmp_path / "new" / "offline.json").read_text())
    assert report["checkpoint"] == "mine" and report["steps"][0]["errors"]["place_mm"] == 7.5
    assert report["finished_scenes"] == [{"success": True}] and report["summary"]["steps"] == 1
    (tmp_path / "file").touch()
    with pytest.raises(DataError, match=r"cannot write into .*file \(File exists\): give another --out"):
        write_report(tmp_path / "file", "mine", [long], [])


def test_the_table_of_reliability(capsys: pytest.CaptureFixture[str]) -> None:
    assert THRESHOLDS == (0.1, 0.3, 0.5, 0.7, 0.9)
    right = np.array([False, True])
    found = Reliability(np.array([0.2, 0.8]), np.array([0.1]), np.array([0.3, 0.6]), right, 4)
    lines = reliability_table(found).splitlines()
    assert lines[:2] == ["2 finished and 1 unfinished scenes", "4 more refused for their sentence"]
    assert [line.split() for line in lines[3:8]] == [
        ["0.1", "100.0", "%", "100.0", "%"],
        *([threshold, "50.0", "%", "100.0", "%"] for threshold in ("0.3", "0.5", "0.7")),
        ["0.9", "0.0", "%", "100.0", "%"],
    ]
    assert [line.split() for line in lines[9:]] == [
        ["0.0", "100.0", "%", "50.0", "%"],
        ["0.1", "100.0", "%", "50.0", "%"],
        ["0.3", "100.0", "%", "50.0", "%"],
        ["0.5", "50.0", "%", "100.0", "%"],
        ["0.7", "0.0", "%", "none"],
        ["0.9", "0.0", "%", "none"],
    ]
    assert {len(line) for line in lines[2:]} == {14 + 1 + 21 + 1 + 26}
    assert found.to_dict()["calibration_error"] == pytest.approx((0.3 + 0.4) / 2)
    for done in (1, 19, 20, 39, 41):
        _progress(done, 41)
    assert capsys.readouterr().err == "\r20/41 scenes\r41/41 scenes\n"


@pytest.mark.parametrize(
    ("confidence", "hit", "error"),
    [
        ([0.05, 0.95], [False, True], 0.05),
        ([0.15, 0.19], [True, False], 0.33),  # one bin
        ([0.19, 0.21], [True, False], 0.51),  # two
        ([1.0, 0.9], [True, True], 0.05),  # 1 falls in the last one
        ([0.5, 0.5, 0.5, 0.1], [True, False, True, True], 0.75 / 6 + 0.9 / 4),
    ],
)
def test_calibration_errors_by_hand(confidence: list[float], hit: list[bool], error: float) -> None:
    assert expected_calibration_error(np.array(confidence), np.array(hit)) == pytest.approx(error)


def test_temperatures_go_from_a_quarter_to_four() -> None:
    assert len(TEMPERATURES) == 33 and TEMPERATURES[16] == pytest.approx(1.0)
    assert (TEMPERATURES[0], TEMPERATURES[-1]) == pytest.approx((0.25, 4.0))


@pytest.mark.parametrize(
    ("ours", "right"), [((10, 10), True), ((10, 22), True), ((10, 23), False), ((18, 18), True), ((19, 19), False)]
)
def test_an_answer_within_three_centimetres_is_right(ours: tuple[int, int], right: bool) -> None:
    """Twelve pixels of 2.5 mm; of the pick and of the place."""
    pose = PlanarPose(0.4, 0.0, 0.0)
    expert = Demonstration("", False, (10, 10), 0.0, 1.0, (100, 100), 0.0)
    for pick, place in ((ours, (100, 100)), ((10, 10), (ours[0] + 90, ours[1] + 90))):
        answer = Inference(PickPlaceAction(pose, pose), pick, place, 1.0, 1.0, 0.0)
        assert _is_right(CellGrid(WorkspaceSpec(), 1), answer, expert) == right


class _Demos:
    """Samples that are finished or not."""

    def __init__(self, done: str) -> None:
        self.done, self.folder = [each == "x" for each in done], Path("set")

    def demo(self, index: int) -> Any:
        return type("Demo", (), {"done": self.done[index]})


@pytest.mark.parametrize(
    ("done", "share", "chances"),
    [
        ("x..x", 0.2, [0.1, 0.4, 0.4, 0.1]),
        ("....", 0.2, [0.25] * 4),
        ("xx", 0.2, [0.5, 0.5]),
        ("x.", 0.0, [0.0, 1.0]),
        ("x..", 1.0, [1.0, 0.0, 0.0]),
    ],
)
def test_finished_scenes_have_their_share(done: str, share: float, chances: list[float]) -> None:
    found = _probabilities(_Demos(done), range(len(done)), share)  # type: ignore[arg-type]
    assert found.tolist() == pytest.approx(chances)


def test_a_set_without_an_action_and_a_weight_that_is_none() -> None:
    with pytest.raises(DataError, match="set shows no action"):
        _probabilities(_Demos("xx"), range(2), 0)  # type: ignore[arg-type]
    for weight in (0.0, -1.0, math.inf, math.nan):
        with pytest.raises(DataError, match="give a positive number"):
            Source(_Demos("x"), weight)  # type: ignore[arg-type]


def test_a_card_as_plain_values() -> None:
    card = Card(NetworkConfig(), WorkspaceSpec(), "minilm", 0.45, {"a": 1}, {"b": 2}, "clip 1", {"pick": 2.0})
    assert (card.temperature("pick"), card.temperature("place"), card.primitive) == (2.0, 1.0, Primitive.PICK_PLACE)
    values = card.to_dict()
    assert (values["version"], values["primitive"], values["frozen"]) == (1, "pick_place", "clip 1")
    assert Card.from_dict(json.loads(json.dumps(values))) == card
    least = {name: values[name] for name in ("network", "workspace", "encoder", "min_similarity")}
    assert Card.from_dict(least) == Card(NetworkConfig(), WorkspaceSpec(), "minilm", 0.45)
    for wrong in ({"pick": 0.0}, {"place": math.inf}, {"yaw": 1.0}):
        with pytest.raises(ConfigError, match="a temperature must be positive and of pick or place"):
            replace(card, temperatures=wrong)
