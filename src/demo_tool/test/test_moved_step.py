"""The step that moved the arm, until it is on the disk."""

from __future__ import annotations

import math

import pytest
from station_fakes import BLOCKS

from cliport_core.outcome import ActionResult, Outcome
from cliport_episodes.errors import DiskFullError
from cliport_episodes.writer import EpisodeWriter


@pytest.mark.parametrize(
    ("measured", "kept"),
    [
        (((0.4, -0.1, 0.02), math.nan), ((0.4, -0.1, 0.02), 0.0)),
        (((math.nan, -0.1, 0.02), 0.04), (None, 0.04)),
    ],
)
def test_a_step_is_recorded_though_the_hand_could_not_be_measured(bench, measured, kept) -> None:
    bench.arm.result = ActionResult(Outcome.EXECUTION_FAILED, "the joint states ended", *measured)
    bench.begin()
    bench.draw()
    bench.do("execute")
    assert bench.view["unsaved"] is None and bench.steps[0]["outcome"] == "failed on the way"
    record = bench.episode().steps[0].record
    assert record.result == ActionResult(Outcome.EXECUTION_FAILED, "the joint states ended", *kept)


def test_no_alarm_is_raised_while_a_step_is_written(bench) -> None:
    seen = []

    def writing(job) -> None:
        add = bench.station._recorder.add_step

        def noting(*arguments) -> None:
            seen.append((bench.state, bench.view["unsaved"]))
            add(*arguments)

        bench.station._recorder.add_step = noting
        job()

    bench.run = writing
    bench.begin()
    bench.draw()
    bench.do("execute")
    assert seen == [("recording", None)] and len(bench.steps) == 1


def test_the_view_survives_a_step_that_is_saved_while_it_is_made(bench, monkeypatch) -> None:
    """The thread that writes does not hold the lock of the view."""
    kept = iter([type("Step", (), {"words": "succeeded"})(), None])
    monkeypatch.setattr(type(bench.station._work), "unsaved", property(lambda work: next(kept)))
    assert bench.view["unsaved"] == "succeeded"


def test_a_disk_that_fills_up_during_the_motion(bench, monkeypatch) -> None:
    bench.begin()
    bench.draw()
    bench.do("execute")

    def full(*_):
        raise DiskFullError(bench.root, "no space is left", "Make room.")

    monkeypatch.setattr(EpisodeWriter, "add_step", full)
    bench.draw(BLOCKS[1])
    bench.do("execute")
    assert bench.state == "failed" and "the arm moved" in bench.last and "was not recorded" in bench.last
    assert "no space is left" in bench.last and len(bench.steps) == 1
    assert bench.view["unsaved"] == "succeeded: done"
    for command in ("execute", "record", "undo", "end_episode"):
        assert "save it again" in bench.refused(command)
    assert "save it again" in bench.refused("open_data_set", name="other")
    assert "no space is left" in bench.refused("save_again") and bench.view["unsaved"]
    monkeypatch.undo()
    bench.rest()
    bench.do("instruction", text="something else meanwhile")
    assert bench.do("save_again")["words"] == "recorded; succeeded: done"
    assert bench.view["unsaved"] is None and bench.state == "ready" and len(bench.steps) == 2
    assert "every step is saved" in bench.refused("save_again")
    steps = bench.episode().steps
    assert steps[1].record.result is not None and steps[1].record.instruction == "put the red block aside"
    assert steps[1].record.action.pick.x == pytest.approx(BLOCKS[1].x, abs=0.01)


@pytest.mark.parametrize("end", ["drop_unsaved", "discard_episode", "close"])
def test_a_step_that_could_not_be_saved_is_dropped_or_saved_at_the_end(bench, monkeypatch, end) -> None:
    bench.begin()
    bench.draw()
    bench.do("record")

    def full(*_):
        raise DiskFullError(bench.root, "no space is left", "Make room.")

    monkeypatch.setattr(EpisodeWriter, "add_step", full)
    bench.draw(BLOCKS[1])
    bench.do("execute")
    monkeypatch.undo()
    bench.rest()
    if end == "close":
        bench.station.close()
        assert len(bench.episode().steps) == 2
        return
    bench.do(end)
    assert bench.view["unsaved"] is None
    bench.draw(BLOCKS[1])
    bench.do("execute")
    assert len(bench.steps) == (2 if end == "drop_unsaved" else 1)
