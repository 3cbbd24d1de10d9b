"""The commands that let a policy learn from the open data set and be used."""

from __future__ import annotations

import pytest

REPORT = {
    "learned": ["one", "two", "three"],
    "held_out": ["four"],
    "table": [["pick, median", "200 mm", "1 mm"]],
    "policy": "learned/blocks/12ab34cd/training",
}


def taught(bench):
    """A bench with one episode, whose data set is being learned."""
    bench.begin()
    bench.draw()
    bench.do("record")
    bench.do("end_episode")
    bench.do("teach")
    return bench.lessons


def lesson(bench) -> dict:
    return bench.view["lesson"]


def test_what_is_learned_is_shown_and_used(bench) -> None:
    assert lesson(bench) == {"state": "none", "data_set": "", "words": "", "share": None, "table": [], "policy": None}
    assert "nothing has been learned" in bench.refused("use_learned")
    lessons = taught(bench)
    assert lessons.data_sets == [bench.root / "blocks"]
    assert (lesson(bench)["state"], lesson(bench)["share"]) == ("running", None)
    lessons.on_line("3 episodes to learn from, 1 held out; learned/blocks/12ab34cd")
    assert lesson(bench)["words"].startswith("3 episodes to learn from") and lesson(bench)["share"] is None
    before = bench.station.changed
    lessons.on_line("[######------------------] 50/200  locator 2.310  31.0 samples/s  4 min left")
    assert bench.station.changed > before
    assert lesson(bench)["share"] == 0.25 and lesson(bench)["words"] == "locator 2.310  31.0 samples/s  4 min left"
    lessons.on_end(0, REPORT)
    assert lesson(bench) == {
        "state": "learned", "data_set": "blocks", "words": "3 episodes learned, 1 held out", "share": 1.0,
        "table": REPORT["table"], "policy": REPORT["policy"],
    }  # fmt: skip
    bench.do("use_learned")
    assert bench.policy.loaded == [REPORT["policy"]]
    bench.policy.failure = "the server is EXECUTING: end that first"
    bench.do("use_learned")
    assert bench.policy.loaded == 2 * [REPORT["policy"]]


def test_recording_goes_on_while_something_is_learned(bench) -> None:
    lessons = taught(bench)
    bench.draw()
    bench.do("execute")
    assert len(bench.arm.goals) == 1
    assert "the data set blocks is being learned: stop that first" in _refused_after_the_episode(bench)
    assert len(lessons.data_sets) == 1


def _refused_after_the_episode(bench) -> str:
    assert "end or discard it before anything is learned" in bench.refused("teach")
    bench.rest()
    bench.do("end_episode")
    return bench.refused("teach")


def test_a_stopped_lesson_can_go_on(bench) -> None:
    lessons = taught(bench)
    lessons.on_line("[######------------------] 50/200  locator 2.310")
    bench.do("stop_teaching")
    assert lessons.stops == 1 and lesson(bench)["state"] == "running"
    lessons.on_line("error: stopped before its end; the same command goes on")
    lessons.on_end(130, None)
    assert (lesson(bench)["state"], lesson(bench)["share"]) == ("stopped", 0.25)
    assert bench.view["last"] == {"ok": True, "words": "learning has stopped, and what it has is saved"}
    assert "nothing is being learned" in bench.refused("stop_teaching")
    bench.do("teach")
    assert len(lessons.data_sets) == 2 and lesson(bench)["state"] == "running"


def test_what_a_stopped_lesson_has_can_be_used(bench) -> None:
    lessons = taught(bench)
    lessons.on_line("[######------------------] 50/200  locator 2.310")
    bench.do("stop_teaching")
    lessons.on_end(130, {**REPORT, "steps_done": 50, "steps": 200})
    shown = lesson(bench)
    assert (shown["state"], shown["share"], shown["table"]) == ("stopped", 0.25, REPORT["table"])
    assert shown["words"].endswith("; stopped after 50 of 200 steps; begun again, it goes on")
    assert bench.view["last"]["words"].startswith("learning has stopped: what it has can be used")
    bench.do("use_learned")
    assert bench.policy.loaded == [REPORT["policy"]]


@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        ({}, ["--init", "auto"]),
        ({"minutes": None, "init": "none"}, ["--init", "none"]),
        ({"minutes": 20, "init": "auto"}, ["--init", "auto", "--minutes", "20"]),
    ],
)
def test_how_long_and_from_what_is_chosen(bench, arguments, options) -> None:
    lessons = taught(bench)
    lessons.on_end(1, None)
    assert "'minutes' must be 1 to 1440" in bench.refused("teach", minutes=0)
    assert "'minutes' must be a whole number" in bench.refused("teach", minutes="5; ls")
    assert "'init' must be auto, none" in bench.refused("teach", init="/etc/passwd")
    bench.do("teach", **arguments)
    assert lessons.options == options


def test_why_nothing_was_learned_is_one_line(bench) -> None:
    lessons = taught(bench)
    lessons.on_line("error: the data is of a sweep, the policy picks and places")
    lessons.on_line("and more")
    lessons.on_end(1, None)
    assert lesson(bench)["state"] == "failed"
    assert lesson(bench)["words"] == "the data is of a sweep, the policy picks and places"
    assert bench.view["last"]["words"] == f"nothing was learned: {lesson(bench)['words']}"
    bench.do("teach")
    lessons.on_line("Killed")
    lessons.on_end(-9, None)
    assert lesson(bench)["words"] == "it ended with status -9: Killed"
    bench.do("teach")
    lessons.on_line("done")
    lessons.on_end(0, {**REPORT, "table": [["too", "short"]]})
    assert lesson(bench)["words"] == "it ended with status 0: done"
    bench.do("teach")
    lessons.on_end(1, REPORT)
    assert lesson(bench)["state"] == "failed", "what ended badly is not learned, whatever it left"
    bench.do("teach")
    lessons.on_line("done")
    lessons.on_end(0, None)
    lessons.fault = "learning cannot be started: No such file or directory"
    assert lessons.fault in bench.refused("teach")
    assert lesson(bench)["words"] == "it ended with status 0: done"


def test_nothing_is_learned_of_nothing(bench) -> None:
    assert "open a data set first" in bench.refused("teach")
    bench.begin()
    assert "the data set blocks has no step that could be learned" in bench.refused("teach")
    bench.station.close()
    assert bench.lessons.closed and not bench.lessons.data_sets
