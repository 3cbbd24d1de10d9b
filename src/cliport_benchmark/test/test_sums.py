"""Scores, summaries and texts, worked out by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cliport_benchmark.contact_sheet import Captioned, captioned, contact_sheet
from cliport_benchmark.doubts import doubts_about
from cliport_benchmark.episode import Episode, Step, _step
from cliport_benchmark.errors import BenchmarkError, DataFolderError, OptionError
from cliport_benchmark.evaluation import (
    DEMO_TEST,
    DEMO_VAL,
    OTHER,
    OWN_OBJECTS,
    TEST,
    TOLD,
    VAL,
    Evaluation,
    Section,
    language_blind,
)
from cliport_benchmark.experiment import choose
from cliport_benchmark.experiment_report import TestScore as Score
from cliport_benchmark.experiment_report import _is_comparable, table
from cliport_benchmark.journal import Discarded
from cliport_benchmark.json_files import check_writable, differences, read_json
from cliport_benchmark.paper_scores import YARDSTICK, PaperRow
from cliport_benchmark.parallel import run_parallel
from cliport_benchmark.ray_cluster import failure_line
from cliport_benchmark.summary import summary
from cliport_core import ActionResult, PickPlaceAction, PlanarPose, Primitive
from cliport_core.outcome import Outcome
from sim_bridge.tasks import JudgedAction

SEEN, UNSEEN = "put-blocks-in-bowls-seen-colors", "put-blocks-in-bowls-unseen-colors"
OBJECTS, SWEEP = "packing-seen-google-objects-seq", "sweeping-piles"


def step(pick: bool, place: bool, outcome: str = "SUCCEEDED", score: float = 0.0) -> Step:
    at = (0.4, 0.0, 0.0)
    return Step("put it there", "pick_place", at, at, "block", "bowl", pick, place, outcome, "", None, score)


def episode(seed: int, score: float, *steps: Step, **others: Any) -> Episode:
    values = {"chance": None, "error": ""} | others
    return Episode(seed, score, len(steps), 4, 0, "put it there", simulated_s=1.0, actions=steps, **values)


def test_a_summary_counts_episodes_and_choices() -> None:
    outcomes = [
        episode(0, 1.0, step(True, True), step(True, False, "GRASP_MISSED"), chance=0.25, redraws=2),
        episode(1, 0.5, step(False, True), chance=0.5, redraws=1, error="it saw nothing", own_wording=True),
        episode(2, 0.0, error="objects flew apart", broken=True),
        Discarded(3, "no place"),
    ]
    found = summary({"checkpoint": "default", "wording": {}}, outcomes)
    assert (found["mean_score"], found["chance"], found["n_episodes"], found["discarded"]) == (50.0, 37.5, 3, 1)
    assert (found["redrawn"], found["redraws"], found["broken"], found["own_wording"]) == (2, 3, 1, 1)
    assert found["outcomes"] == {"GRASP_MISSED": 1, "SUCCEEDED": 2}
    assert found["choices"] == {
        "pick_right": 66.67,
        "place_right": 66.67,
        "both_right": 33.33,
        "first_action_both_right": 33.33,
        "refused": 1,
    }
    assert [e["seed"] for e in found["episodes"]] == [0, 1, 2]
    assert found["discarded_episodes"] == [{"seed": 3, "reason": "no place"}]
    plain = summary({"checkpoint": "expert"}, outcomes[3:])
    assert plain["mean_score"] is None and plain["chance"] is None
    assert "choices" not in plain and "own_wording" not in plain


def test_a_step_is_written_to_a_tenth_of_a_millimetre() -> None:
    action = PickPlaceAction(
        PlanarPose(0.123456, -0.2, math.tau + 0.123456), PlanarPose(0.4, 0.1, -math.pi - 0.5), Primitive.FOLD
    )
    meant = JudgedAction("block", "bowl", True, False)
    found = _step("fold it", action, 0.123456, meant, ActionResult(Outcome.DROPPED, "lost"), (0.5, 0.7))
    turned = round(math.pi - 0.5, 4)
    assert found == Step(
        *("fold it", "fold", (0.1235, -0.2, 0.1235), (0.4, 0.1, turned)),
        *("block", "bowl", True, False, "DROPPED", "lost", 0.1235, 0.5, 0.7),
    )
    assert _step("", action, None, meant, ActionResult(Outcome.DROPPED, ""), (0.0, 0.0)).done_probability is None


@pytest.mark.parametrize(
    ("task", "split", "others", "section"),
    [
        (SEEN, "test", {}, TEST),
        (SEEN, "val", {}, VAL),
        (SEEN, "train", {}, OTHER),
        (SEEN, "test", {"set_up": "randomized: light"}, OTHER),
        ("put-blocks-in-bowls-full", "test", {}, OTHER),
        (SWEEP, "test", {}, DEMO_TEST),
        (SWEEP, "val", {}, DEMO_VAL),
        (OBJECTS, "test", {"object_set": "own-56"}, OWN_OBJECTS),
        (OBJECTS, "val", {"object_set": "google OBJ folder"}, VAL),
        (UNSEEN, "test", {"knew_colors": True}, TOLD),
        (UNSEEN, "test", {}, TEST),
        (SEEN, "test", {"knew_colors": True, "object_set": "own-56"}, TEST),
    ],
)
def test_the_table_that_a_score_belongs_to(task: str, split: str, others: dict[str, Any], section: Section) -> None:
    assert Evaluation(task, "expert", split, 50.0, 100, **others).section is section


def test_the_blind_agent_stands_beside_a_score_of_the_same_looks() -> None:
    mine = Evaluation(SEEN, "mine", "test", 90.0, 50, set_up="randomized: light")
    others = [
        Evaluation(SEEN, "blind", "test", 30.0, 50, set_up=looks, is_blind=True)
        for looks in ("", "colours of the survey", "randomized: light")
    ]
    assert language_blind(mine, others) is others[2]
    assert language_blind(mine, others[:2]) is None


@pytest.mark.parametrize(
    ("values", "doubts"),
    [
        ({"commit": "0123456789"}, ()),
        ({}, ("t test was measured at an unknown commit",)),
        ({"commit": "0123456789", "dirty": True}, ("t test was measured on changes to commit 0123456",)),
    ],
)
def test_doubts_about_a_score(values: dict[str, Any], doubts: tuple[str, ...]) -> None:
    assert doubts_about({"task": "t", "split": "test", "checkpoint": "expert", **values}) == doubts


def test_the_first_of_several_best_checkpoints_is_chosen() -> None:
    assert choose([100, 200, 300], [50.0, 70.0, 70.0]) == 200 and choose([5], [0.0]) == 5


@pytest.mark.parametrize(
    ("result", "task", "test", "comparable"),
    [
        ({}, SEEN, {}, True),
        ({"camera": "mine.yaml"}, SEEN, {}, False),
        ({"workspace": "mine.yaml"}, SEEN, {}, False),
        ({"randomize_scores": "light"}, SEEN, {}, False),
        ({"randomize": "light"}, SEEN, {}, True),
        ({}, OBJECTS, {"object_set": "own-56"}, False),
        ({}, OBJECTS, {"object_set": "google OBJ folder"}, True),
        ({"settings": ["train.recolor = surveyed"]}, UNSEEN, {}, False),
        ({"settings": ["train.recolor=surveyed"]}, SEEN, {}, True),
        ({"settings": ["train.recolor=surveyed"], "met_surveyed_colors": False}, UNSEEN, {}, True),
        ({"met_surveyed_colors": True}, UNSEEN, {}, False),
    ],
)
def test_what_stands_beside_the_papers_scores(result, task: str, test, comparable: bool) -> None:
    assert _is_comparable(result, task, test) is comparable


def test_a_line_of_the_experiments_table() -> None:
    score = Score(SEEN, "compact", 100, 500, 81.25, 90.04, None, 99, SEEN, exact=70.55)
    other = Score(UNSEEN, "mine", 7, 500, 1.0, None, 20.0, 1, SEEN)
    lines = table([score, other]).splitlines()
    paper = (YARDSTICK.score("1", SEEN, 100), YARDSTICK.score("4", SEEN, 100))
    assert None not in paper
    unknown = " | ".join(["unknown"] * 3)
    cells = f"90.0 | 70.5 | {paper[0]:.1f} |  | 99 | 81.2 | {paper[1]:.1f}"
    assert lines[2] == f"| {SEEN} | compact | 100 | {cells} | 500 | CLIPORT (single) | {unknown} |"
    assert lines[3] == f"| {UNSEEN} | mine | 7 |  |  |  | 20.0 | 1 | 1.0 |  | 500 |  | {unknown} |"
    assert replace(score, comparable=False).paper_test is None and replace(score, own_task=UNSEEN).paper_val is None
    assert replace(score, own_task="a task before it").paper_val is None


def test_a_network_has_the_name_of_its_first_table() -> None:
    assert [PaperRow(*names).name for names in (("a", "b", "c"), ("", "b", "c"), ("", "", "c"))] == ["a", "b", "c"]


def test_settings_are_compared_as_a_file_holds_them(tmp_path: Path) -> None:
    assert differences({"a": [1, 2]}, {"a": (1, 2)}) == ""
    assert differences({"a": 1, "b": 2}, {"a": 1, "c": None}) == "b 2 not None"
    long = "x" * 40
    assert differences({"a": long, "b": 1}, {"a": long + "y", "b": 2}) == f"a {long} not {'x' * 37}..., b 1 not 2"
    (tmp_path / "list.json").write_text("[]")
    with pytest.raises(DataFolderError, match="holds no JSON object"):
        read_json(tmp_path / "list.json")
    for path, words in ((tmp_path, "it is a folder"), (tmp_path / "list.json" / "x.json", "cannot write")):
        with pytest.raises(OptionError, match=words):
            check_writable(path)
    check_writable(tmp_path / "new" / "r.json")
    assert (tmp_path / "new").is_dir()


class Cluster:
    """A cluster in which so many items fail."""

    def __init__(self, failing: int) -> None:
        self.failing, self.workers = failing, 0

    def run(self, function, items, workers, set_up, failures):
        self.workers = workers
        for number, item in enumerate(items):
            if number < self.failing:
                failures.append(f"{item} failed")
            else:
                yield item, function(item)


@pytest.mark.parametrize(
    ("failing", "words"),
    [(1, "0 failed"), (3, "0 failed; 1 failed; 2 failed"), (5, "0 failed; 1 failed; 2 failed; and 2 more")],
)
def test_three_failures_are_named(failing: int, words: str) -> None:
    cluster, found = Cluster(failing), []

    def run() -> None:
        for pair in run_parallel(lambda n: 2 * n, range(6), 99, lambda: None, cluster):  # type: ignore[arg-type]
            found.append(pair)

    with pytest.raises(BenchmarkError, match=f"^{words}$"):
        run()
    assert found == [(n, 2 * n) for n in range(failing, 6)] and cluster.workers == 6


def test_there_is_one_process_at_least_and_none_for_nothing() -> None:
    cluster = Cluster(0)
    assert list(run_parallel(abs, [-3], 0, lambda: None, cluster)) == [(-3, 3)] and cluster.workers == 1  # type: ignore[arg-type]
    assert list(run_parallel(abs, [], 5, lambda: None, Cluster(9))) == []  # type: ignore[arg-type]


def test_a_failure_is_one_short_line() -> None:
    assert failure_line("x" * 70, ValueError("no\n  luck")) == f"{'x' * 60}: ValueError: no luck"
    wrapped = RuntimeError("with a traceback")
    wrapped.cause = KeyError("y" * 300)  # type: ignore[attr-defined]
    assert failure_line(3, wrapped) == f"3: KeyError: '{'y' * 199}"


def test_a_captioned_picture_has_its_margins() -> None:
    picture = np.full((90, 160, 3), 77, np.uint8)
    for lines, below in ((1, 36), (2, 62)):  # lines of 26.25 pixels and a margin
        cell = captioned(Captioned("title", picture, "put it there"), lines)
        assert cell.shape == (90 + 28 + below + 20, 180, 3)
        assert (cell[38:128, 10:170] == 77).all() and not (cell[:38] == 77).all(axis=-1).any()
    texts = [Captioned("", picture, ""), Captioned("title", picture, ""), Captioned("title", picture, "put it there")]
    plain, titled, whole = (captioned(text, 1).astype(int) for text in texts)
    assert {tuple(color) for color in plain.reshape(-1, 3)} == {(77, 77, 77), (250, 250, 248)}
    rows, cols = np.nonzero((titled != plain).any(axis=-1))
    assert rows.min() >= 5 and rows.max() < 38 and 10 <= cols.min() < 14
    rows, cols = np.nonzero((whole != titled).any(axis=-1))
    assert rows.min() >= 133 and rows.max() < 133 + 27 and 10 <= cols.min() < 14
    sheet = contact_sheet([texts[0]] * 5, 3)
    assert sheet.shape == (2 * 174, 3 * 180, 3) and (sheet[174:, 360:] == (250, 250, 248)).all()
    assert (sheet[174 + 38 : 174 + 128, 190:350] == 77).all() and contact_sheet(texts[:1], 3).shape == (174, 180, 3)
