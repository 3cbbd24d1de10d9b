"""Stop in every state; what is lost ends in words, never in a hang."""

import time

import pytest
from station_fakes import BLOCKS, FakeArm, FakePolicy, FakeTable

from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose
from demo_tool.ports import ACCEPTED
from demo_tool.recording import Recorder
from demo_tool.station import Station
from demo_tool.station_config import StationConfig


def drawn(bench):
    bench.begin()
    bench.draw()
    return bench


def test_stop_works_in_every_state_at_once_and_latches(held) -> None:
    held.do("stop")  # no camera, no data set
    assert held.arm.stops == 1 and held.state == "stopped"
    held.do("stop")
    assert held.arm.stops == 2 and held.state == "stopped"
    drawn(held)  # drawing does no harm
    for command in ("execute", "preview", "propose"):
        assert "resume first" in held.refused(command)
    held.do("resume")
    assert not held.arm.stopped and held.state == "ready"
    held.do("resume")
    held.do("execute")
    held.do("stop")
    assert held.arm.stopped and held.state == "stopped" and "still planning" in held.view["words"]
    held.arm.on_end(ActionResult(Outcome.CANCELLED, "cancelled during planning; nothing moved"))
    assert held.steps == [] and "nothing was recorded" in held.last and held.state == "stopped"


def test_a_stop_on_the_way_is_recorded_as_it_went(held) -> None:
    drawn(held)
    held.do("execute")
    held.arm.on_phase("GO_ABOVE_PICK", 0.2)
    held.do("stop")
    assert held.state == "stopped" and "still executing" in held.view["words"]
    held.arm.on_end(ActionResult(Outcome.CANCELLED, "cancelled during go_above_pick; the arm holds"))
    assert held.steps[0]["outcome"] == "stopped on the way" and held.state == "stopped"
    assert "the arm does not go back" in held.last


def test_a_stop_says_when_nobody_heard_it(bench) -> None:
    bench.arm.fault_words = "the executor is not there"
    answer = bench.do("stop")
    assert answer == {"ok": False, "words": "STOP may not have reached the arm: the executor is not there"}
    assert bench.view["last"] == answer and bench.state == "stopped"


def test_a_stop_that_did_not_reach_the_arm_is_no_stop(bench) -> None:
    assert bench.do("stop")["ok"] and "nothing moves" in bench.view["words"]
    bench.arm.on_stop_failure("STOP did not reach the executor")
    assert bench.state == "stopped" and bench.view["words"] == "Stopped: STOP did not reach the executor."
    assert bench.view["last"] == {"ok": False, "words": "STOP did not reach the executor"}
    bench.do("resume")
    bench.arm.on_stop_failure("STOP did not reach the executor")  # of a stop that was ended since
    assert bench.view["last"]["ok"]
    bench.do("stop")
    assert "nothing moves" in bench.view["words"]


@pytest.mark.parametrize("end", ["stopped", "lost"])
def test_a_plan_that_was_not_made_says_nothing_about_reach(held, end) -> None:
    drawn(held)
    held.do("preview")
    held.arm.on_phase("GRASP_PLANNING", 0.1)
    if end == "stopped":
        held.do("stop")
        held.arm.on_end(ActionResult(Outcome.CANCELLED, "cancelled during planning; nothing moved"))
    else:
        held.arm.fault_words = "the executor gives no sign of life for 1 s"
        held.wait(0.1)
        held.wait(1.1)
    assert held.view["plan"] is None and "it was not found out whether the arm can do this" in held.last


def test_a_stop_that_comes_while_the_disk_works_keeps_the_arm_still(bench, monkeypatch) -> None:
    drawn(bench)
    begin = Recorder.begin_episode

    def slow(recorder, setup) -> None:
        begin(recorder, setup)
        bench.do("stop")

    monkeypatch.setattr(Recorder, "begin_episode", slow)
    bench.do("execute")
    assert bench.arm.goals == [] and bench.state == "stopped" and bench.steps == []


def test_an_executor_that_never_answers(held) -> None:
    drawn(held)
    held.do("execute")
    held.wait(4.9)
    assert held.state == "planning"
    held.wait(0.2)
    held.see()
    assert held.state == "failed" and "no answer for 5 s" in held.last and held.steps == []
    held.arm.on_end(ActionResult(Outcome.SUCCEEDED, "too late"))
    assert held.steps == [] and held.state == "failed"
    held.do("execute")  # it can be tried again
    assert len(held.arm.goals) == 2


@pytest.mark.parametrize("moving", [False, True])
def test_an_executor_that_is_lost_on_the_way(held, moving) -> None:
    drawn(held)
    held.do("execute")
    held.arm.on_phase("CARRY" if moving else "VALIDATING", 0.6)
    held.arm.fault_words = "the executor gives no sign of life for 1 s"
    held.wait(0.1)
    held.wait(0.5)
    assert held.state == ("executing" if moving else "planning")
    held.wait(0.6)
    held.see()
    assert held.state == "failed" and "the arm was lost: the executor gives no sign of life" in held.last
    assert [step["outcome"] for step in held.steps] == (["failed on the way"] if moving else [])


def test_a_short_absence_is_no_loss(held) -> None:
    drawn(held)
    held.do("execute")
    held.arm.on_phase(ACCEPTED, 0.0)
    held.arm.fault_words = "gone"
    held.wait(0.8)
    held.arm.fault_words = None
    held.wait(0.8)
    held.arm.fault_words = "gone"
    held.wait(0.8)
    assert held.state == "planning"


def test_a_goal_that_never_ends_is_cancelled_and_given_up(held) -> None:
    drawn(held)
    held.do("execute")
    held.arm.on_phase("CARRY", 0.6)
    held.wait(126.0)
    held.wait(4.9)
    assert held.state == "executing"
    held.wait(0.2)
    held.see()
    assert held.state == "failed" and "no answer to a cancel" in held.last
    assert held.steps[0]["outcome"] == "stopped on the way"


def test_every_state_has_words(held) -> None:
    seen = {}

    def note() -> None:
        seen[held.state] = held.view["words"]

    note()
    drawn(held)
    note()
    held.do("execute")
    note()
    held.arm.on_phase("CARRY", 0.6)
    note()
    held.arm.on_end(ActionResult(Outcome.GRASP_MISSED, "nothing between the fingers"))
    note()
    held.do("stop")
    note()
    held.do("resume")
    held.rest()
    held.policy.instruct = lambda text: None
    held.do("propose")
    note()
    held.do("stop")
    held.do("resume")
    held.wait(2.0)
    note()
    expected = {"waiting_for_camera", "ready", "planning", "executing", "failed", "stopped", "proposing", "stale"}
    assert set(seen) == expected
    assert all(len(words) > 10 and words[-1] in ".?" for words in seen.values()), seen


def test_recording_is_a_state_of_its_own(bench) -> None:
    jobs = []
    bench.run = jobs.append
    drawn(bench)
    bench.do("execute")
    assert bench.state == "recording" and "busy recording" in bench.refused("execute")
    jobs.pop()()
    bench.rest()
    assert bench.state == "ready" and len(bench.steps) == 1


def test_a_real_thread_does_the_writing(tmp_path) -> None:
    table, arm = FakeTable(), FakeArm(pace=0.01)
    policy = FakePolicy(PlanarPose(0.42, -0.12, 0.0), PlanarPose(0.5, -0.28, 0.0))
    station = Station(StationConfig(), arm, policy, tmp_path)
    station.on_camera(table.live_view(10**9))
    station.command("open_data_set", {"name": "blocks"})
    station.command("instruction", {"text": "put it aside"})
    station.command("pick", {"box": table.box_around(BLOCKS[0]), "rotation": 0})
    station.command("place", {"box": table.box_at(0.5, -0.28), "rotation": 0})
    station.command("execute", {})
    after, end = station.changed, time.monotonic() + 10.0
    while not station.view(None)["last"]["words"].startswith("recorded") and time.monotonic() < end:
        after = station.wait_change(after, 1.0)
    assert station.view(None)["episode"]["steps"][0]["outcome"] == "succeeded"
    station.close()


@pytest.mark.parametrize("answers", [True, False])
def test_who_closes_the_station_waits_six_seconds_for_the_end(held, monkeypatch, answers) -> None:
    drawn(held)
    held.do("execute")
    held.arm.on_phase("CARRY", 0.6)
    began = held.now

    def pass_time(seconds: float) -> None:
        held.now += seconds
        if answers and held.now > began + 0.5:
            held.arm.on_end(ActionResult(Outcome.CANCELLED, "the arm holds"))

    monkeypatch.setattr("demo_tool.arm_work.time.sleep", pass_time)
    held.station.close()
    assert held.now - began == pytest.approx(0.51 if answers else 6.0, abs=0.02)
    assert len(held.episode().steps) == (1 if answers else 0)


@pytest.mark.parametrize("command", ["record", "undo", "end_episode", "open_data_set"])
def test_nothing_else_begins_while_the_disk_is_written_to(bench, monkeypatch, command) -> None:
    drawn(bench)
    bench.do("record")
    bench.draw()
    method = {"record": "add_step", "undo": "undo_step", "end_episode": "finish", "open_data_set": "open"}[command]
    write, seen = getattr(Recorder, method), []

    def noting(recorder, *arguments):
        seen.append((bench.state, bench.refused("clear")))
        return write(recorder, *arguments)

    monkeypatch.setattr(Recorder, method, noting)
    bench.do(command, **({"name": "blocks"} if command == "open_data_set" else {}))
    assert seen == [("recording", "busy recording (writing to the disk): wait for its end, or stop")]
    bench.do("clear")


def test_the_draft_is_not_judged_while_the_arm_works_or_no_picture_came(held, monkeypatch) -> None:
    judged: list[object] = []
    monkeypatch.setattr(held.station._desk, "judge", judged.append)
    held.station._judge_draft()
    assert not judged, "there is no picture"
    monkeypatch.undo()
    drawn(held)
    held.do("execute")
    monkeypatch.setattr(held.station._desk, "judge", judged.append)
    held.station._judge_draft()
    assert not judged, "the arm is in the picture"
    held.arm.on_end(ActionResult(Outcome.CANCELLED, "cancelled during planning; nothing moved"))
    held.station._judge_draft()
    assert len(judged) == 1
