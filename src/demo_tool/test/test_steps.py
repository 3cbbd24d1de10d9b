"""From a draft to a recorded step, and what becomes of an episode."""

import threading

import numpy as np
import pytest
from station_fakes import BLOCKS

from cliport_core.action import Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import Source


def test_two_steps_are_executed_recorded_and_read_back(bench) -> None:
    bench.begin()
    for block, to in ((BLOCKS[0], (0.5, -0.28)), (BLOCKS[1], (0.34, 0.25))):
        bench.draw(block, to, rotation=9)
        bench.do("execute")
        assert bench.view["last"] == {"ok": True, "words": "recorded; succeeded: done"}
        assert bench.view["draft"]["pick"] is None
    assert [step["outcome"] for step in bench.steps] == ["succeeded", "succeeded"]
    assert "before the arm came to rest" in bench.refused("end_episode", success=True)
    threading.Timer(0.2, bench.rest).start()  # the picture of the finished scene is waited for
    bench.do("end_episode", success=True)
    assert bench.view["episode"] is None
    episode = bench.episode()
    assert episode.success is True and episode.finished and episode.final is not None and not episode.complaints
    assert len(episode.steps) == 2
    first = episode.steps[0].record
    assert first.source is Source.CLICKED and first.result == bench.arm.result
    pick = first.action.pick
    assert pick.x == pytest.approx(BLOCKS[0].x, abs=0.01) and pick.yaw == pytest.approx(np.pi / 2)
    assert (first.pick_rotation, first.n_rotations) == (9, 36)
    assert first.instruction == "put the red block aside" and first.action.primitive is Primitive.PICK_PLACE
    box = first.pick_box
    assert [box.top, box.left, box.bottom, box.right] == bench.table.box_around(BLOCKS[0])
    goal = bench.arm.goals[0]
    assert goal.stamp_ns == first.stamp_ns
    for asked, kept in ((goal.action.pick, first.action.pick), (goal.action.place, first.action.place)):
        assert (asked.x, asked.y, asked.yaw) == pytest.approx((kept.x, kept.y, kept.yaw))
    assert not goal.plan_only and goal.instruction == first.instruction


def test_the_observation_is_the_one_from_before_the_motion(bench) -> None:
    bench.begin()
    bench.draw()
    before = bench.station.picture("color", 0, 0.0)

    def carried(goal) -> None:
        bench.table.move(goal.action.pick, goal.action.place)
        bench.now += 5.0
        bench.see()  # pictures come while the arm moves

    bench.arm.on_success = carried
    bench.do("execute")
    observation = bench.episode().steps[0].observation()
    assert observation.stamp_ns == before.stamp_ns and np.array_equal(observation.color, before.pixels)
    assert bench.state == "stale" and "before the arm came to rest" in bench.view["words"]
    assert "before the arm came to rest" in bench.refused("pick", box=[0, 0, 9, 9], rotation=0)
    now = bench.station.picture("color", before.sequence, 0.0)
    assert now is not None and not np.array_equal(now.pixels, before.pixels)


@pytest.mark.parametrize(
    ("outcome", "words"),
    [
        (Outcome.GRASP_MISSED, "the fingers closed on nothing"),
        (Outcome.DROPPED, "the object was lost on the way"),
        (Outcome.EXECUTION_FAILED, "failed on the way"),
    ],
)
def test_a_failed_grasp_is_recorded_and_said(bench, outcome, words) -> None:
    bench.arm.result = ActionResult(outcome, "so it went")
    bench.begin()
    bench.draw()
    bench.do("execute")
    assert bench.state == "failed" and words in bench.last and "Undo" in bench.last
    assert bench.steps[0]["outcome"] == words
    record = bench.episode().steps[0].record
    assert record.result == ActionResult(outcome, "so it went")
    bench.rest()
    bench.do("instruction", text="again")
    assert bench.state == "ready"


@pytest.mark.parametrize("outcome", [Outcome.REJECTED, Outcome.PLANNING_FAILED])
def test_where_nothing_moved_nothing_is_recorded(bench, outcome) -> None:
    bench.arm.result = ActionResult(outcome, "the hand cannot reach")
    bench.begin()
    bench.draw()
    bench.do("execute")
    assert bench.state == "failed" and "nothing was recorded" in bench.last and "cannot reach" in bench.last
    assert bench.steps == [] and bench.view["draft"]["pick"] is not None


def test_a_preview_says_whether_the_arm_could(bench) -> None:
    bench.begin()
    bench.draw()
    bench.do("preview")
    assert bench.arm.goals[-1].plan_only
    assert bench.view["plan"] == {"reachable": True, "words": "a way was found"} and bench.state == "ready"
    bench.draw(BLOCKS[1])
    assert bench.view["plan"] is None
    bench.arm.result = ActionResult(Outcome.PLANNING_FAILED, "out of reach")
    bench.do("preview")
    assert bench.view["plan"] == {"reachable": False, "words": "out of reach"} and bench.state == "failed"
    bench.do("clear")
    assert bench.view["plan"] is None, "what is no longer drawn has no plan"
    assert bench.steps == []


def test_recording_only_moves_nothing(bench) -> None:
    bench.begin()
    bench.do("primitive", name="fold")
    bench.draw()
    bench.do("record")
    assert bench.arm.goals == [] and bench.steps[0]["outcome"] == "recorded without moving"
    record = bench.episode().steps[0].record
    assert record.result is None and record.action.primitive is Primitive.FOLD


def test_a_sweep_is_drawn_asked_for_and_recorded_across_its_way(bench) -> None:
    bench.begin()
    bench.do("primitive", name="sweep")
    bench.rest()
    bench.do("pick", box=bench.table.box_at(0.40, -0.25), rotation=7)
    assert bench.view["draft"]["pick"]["rotation"] == 7
    bench.do("place", box=bench.table.box_at(0.55, -0.25), rotation=0)
    shown = bench.view["draft"]
    assert shown["pick"]["rotation"] == shown["place"]["rotation"] == 9  # along x, so the jaws stand along y
    fingers = np.array(shown["pick"]["footprint"])
    assert np.abs(fingers[0] - fingers[1]).min() < 2.0  # the hand is closed
    bench.do("execute")
    (goal,) = bench.arm.goals
    bench.rest()
    bench.do("end_episode", success=True)
    record = bench.episode().step(0).record
    assert (record.action.primitive, record.source) == (Primitive.SWEEP, Source.CLICKED)
    assert record.action == goal.action
    assert (record.pick_rotation, record.place_rotation) == (9, 9)
    assert goal.action.pick.yaw == goal.action.place.yaw == pytest.approx(np.pi / 2, abs=0.05)
    bench.do("primitive", name="fold")
    bench.draw(rotation=7)
    assert bench.view["draft"]["pick"]["rotation"] == 7


def test_undo_drops_the_last_step_and_says_that_the_arm_stays(bench) -> None:
    bench.begin()
    for _ in range(2):
        bench.draw()
        bench.do("record")
    assert "the arm does not go back" in bench.do("undo")["words"]
    assert len(bench.steps) == 1 == len(bench.episode().steps)
    bench.do("undo")
    assert "no step to undo" in bench.refused("undo")
    assert "no steps" in bench.refused("end_episode", success=True)
    bench.do("discard_episode")
    assert bench.view["episode"] is None and bench.do("episodes") == {"episodes": []}


def test_an_undone_step_comes_back(bench) -> None:
    bench.begin()
    for text in ("the first", "the second"):
        bench.draw()
        bench.do("record", text=text)
    assert not bench.view["episode"]["restorable"]
    bench.do("undo")
    assert bench.view["episode"]["restorable"] and bench.do("trash")["undone_steps"] == 1
    assert bench.do("restore_step")["words"] == "the step is back"
    assert [step["instruction"] for step in bench.steps] == ["the first", "the second"]
    assert [step.record.instruction for step in bench.episode().steps] == ["the first", "the second"]
    assert "no step to bring back" in bench.refused("restore_step")
    bench.do("undo")
    bench.do("empty_trash")
    assert "no step to bring back" in bench.refused("restore_step")


def test_marks(bench) -> None:
    bench.begin()
    bench.draw()
    bench.do("record")
    bench.do("mark", success=False)
    name = bench.view["episode"]["name"]
    bench.do("end_episode")
    assert bench.episode().success is False
    bench.do("mark", success=True)
    assert bench.episode().success is True
    bench.do("mark", success=None, episode=name)
    assert bench.episode().success is None


def test_a_step_is_recorded_once_whatever_the_arm_says(held) -> None:
    held.begin()
    held.draw()
    held.do("execute")
    on_phase, on_end = held.arm.on_phase, held.arm.on_end
    on_phase("CARRY", 0.6)
    assert held.state == "executing" and held.view["progress"] == 0.6 and held.view["phase"] == "carrying"
    for _ in range(3):
        on_end(ActionResult(Outcome.SUCCEEDED, "done"))
        on_phase("RETREAT", 0.9)
    held.rest()
    assert len(held.steps) == 1 and held.state == "ready"


def test_editing(bench) -> None:
    bench.begin()
    for _ in range(3):
        bench.draw()
        bench.do("record")
    bench.do("end_episode", success=True)
    (info,) = bench.do("episodes")["episodes"]
    assert info["n_steps"] == 3 and info["success"] is True and info["finished"]
    name = info["name"]
    bench.do("relabel", name=name, text="clear the table", step=1)
    bench.do("trim", name=name, first=1, last=2)
    episode = bench.do("episode", name=name)
    assert [step["instruction"] for step in episode["steps"]] == ["clear the table", "put the red block aside"]
    assert bench.station.episode_picture(name, 1).shape == (270, 480, 3)
    assert bench.station.episode_picture(name, 1, "blocks").shape == (270, 480, 3)
    assert bench.do("statistics")["statistics"]["n_steps"] == 2
    assert bench.station.statistics_picture().startswith(b"\x89PNG")
    bench.do("delete", name=name)
    assert bench.do("trash") == {"trashed": [name], "undone_steps": 0} and bench.do("episodes") == {"episodes": []}
    bench.do("restore", name=name)
    bench.do("delete", name=name)
    bench.do("empty_trash")
    assert bench.do("trash")["trashed"] == []
    assert "no episode" in bench.refused("relabel", name=name, text="x")
    assert "name" in bench.refused("delete", name="../blocks")


def test_data_sets_are_merged_and_split(bench) -> None:
    def recorded(data_set: str, episodes: int) -> None:
        bench.do("open_data_set", name=data_set)
        for _ in range(episodes):
            bench.draw()
            bench.do("record")
            bench.do("end_episode", success=True)

    bench.begin("more")
    recorded("more", 1)
    recorded("blocks", 4)
    assert bench.do("merge", other="more")["words"] == "1 of the 1 episodes of more are added"
    assert bench.do("merge", other="more")["words"].startswith("0 of the 1 episodes")
    answer = bench.do("split", parts=[["train", 0.8], ["val", 0.2]])
    assert answer["words"] == "blocks_train: 4 episodes, blocks_val: 1 episodes; blocks stays as it is"
    assert bench.view["data_sets"] == ["blocks", "blocks_train", "blocks_val", "more"]
    bench.do("split", parts=[["few", 2]], seed=5)
    parts = [DataSet.open(bench.root / f"blocks_{part}").episodes() for part in ("train", "val", "few")]
    assert [len(part) for part in parts] == [4, 1, 2] and len(bench.do("episodes")["episodes"]) == 5
