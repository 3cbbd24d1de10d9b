"""Evaluation: the expert in full physics, what results count, and how an interrupted one goes on."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cliport_benchmark import evaluate_cli
from cliport_benchmark.agents import Answer, ExpertAgent
from cliport_benchmark.episode import Episode, Step
from cliport_benchmark.evaluate import EvaluateConfig, Evaluator
from cliport_benchmark.journal import Discarded, Journal
from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.summary import summary
from cliport_benchmark.wording import Wording
from cliport_core import ActionResult, Heightmap, PickPlaceAction, PlanarPose
from cliport_core.source_state import source_state
from sim_bridge.errors import PhysicsError
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import PutBlocksInBowls, Task

SEEN = "put-blocks-in-bowls-seen-colors"
WITHOUT_ARM = EvaluateConfig("expert", SEEN, "test", 1, 1, without_arm=True)


@pytest.fixture(scope="module")
def expert() -> Iterator[Evaluator]:
    evaluator = Evaluator(EvaluateConfig("expert", SEEN, "test", 1, 1))
    yield evaluator
    evaluator.world.close()


@pytest.fixture(scope="module")
def first(expert: Evaluator) -> Episode:
    """Of the expert's scene, in full physics."""
    episode = expert.run(1)
    assert isinstance(episode, Episode)
    return episode


def test_expert_solves_a_scene_in_full_physics_and_again_the_same(expert: Evaluator, first: Episode) -> None:
    other = Evaluator(expert.config)
    other.run(3)  # what came before must not matter
    assert first == other.run(1)
    assert first.score == 1.0 and first.goals_reached == 1 and first.steps == first.max_steps - 1
    for step in first.actions:
        assert step.outcome == "SUCCEEDED" and step.primitive == "pick_place"
        assert step.pick_right and step.place_right and step.picked.endswith("block") and step.place_at.endswith("bowl")
        assert step.instruction == first.instruction
    other.world.close()


class Absent(ExpertAgent):
    """The expert, who first reaches into the void."""

    def __init__(self) -> None:
        self.slips = 1

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Answer:
        if self.slips:
            self.slips -= 1
            return PickPlaceAction(PlanarPose(0.63, 0.39, 0.0), PlanarPose(0.63, 0.37, 0.0), task.primitive), None
        return super().decide(task, observation, instruction)


def test_a_sequence_says_the_next_sentence_when_a_step_is_done() -> None:
    evaluator = Evaluator(replace(WITHOUT_ARM, task="stack-block-pyramid-seq-seen-colors"))
    evaluator.hand = KinematicHand(evaluator.world, np.random.default_rng(0))
    evaluator.agent = Absent()
    episode = evaluator.run(1)
    evaluator.world.close()
    assert isinstance(episode, Episode) and episode.chance is None
    assert episode.score == pytest.approx(1.0) and (episode.steps, episode.goals_reached) == (7, 6)
    slip, second, *rest = episode.actions
    assert slip.instruction == second.instruction == episode.instruction
    assert not slip.pick_right and not slip.place_right and slip.picked == "" and slip.score == 0.0
    assert len({step.instruction for step in rest}) == 5
    assert all(step.pick_right and step.place_right for step in (second, *rest))
    assert [step.score for step in (second, *rest)] == pytest.approx([i / 6 for i in range(1, 7)])


class Undoing(ExpertAgent):
    """The expert for one step, who then puts the block back onto the table and stops."""

    def __init__(self) -> None:
        self.calls = 0
        self.back: PickPlaceAction | None = None

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Answer:
        self.calls += 1
        if self.calls > 1:
            return (self.back if self.calls == 2 else None), None
        there, _ = super().decide(task, observation, instruction)
        assert there is not None
        self.back = replace(there, pick=there.place, place=there.pick)
        return there, None


def test_what_counts_is_the_score_at_the_end_not_the_best() -> None:
    evaluator = Evaluator(WITHOUT_ARM)
    evaluator.hand = KinematicHand(evaluator.world, np.random.default_rng(0))
    evaluator.agent = Undoing()
    several = next(seed for seed in range(50) if _blocks_to_move(reset_scene(evaluator.world, SEEN, "test", seed)) > 1)
    episode = evaluator.run(several)
    evaluator.world.close()
    assert isinstance(episode, Episode)
    first, second = (step.score for step in episode.actions)
    assert first > 0.0 and second == 0.0
    assert episode.score == 0.0


def _blocks_to_move(task: Task) -> int:
    assert isinstance(task, PutBlocksInBowls)
    return sum(block.color == task.goal.block for block in task.blocks())


class Bursting(KinematicHand):
    """Moves two things; the third flies off, and takes along what was placed."""

    calls = 0

    def execute(self, *arguments: Any) -> ActionResult:
        self.calls += 1
        if self.calls < 3:
            return super().execute(*arguments)
        for thing in self._world.objects:
            if not thing.fixed:
                self._world.move_object(thing, PlanarPose(30.0, 0.0, 0.0).as_pose(5.0))
        self._world.settle()
        raise AssertionError("what lies 30 m away is an error")


def test_physics_that_explodes_leaves_the_score_that_stood_before_it(expert: Evaluator) -> None:
    evaluator = Evaluator(replace(WITHOUT_ARM, task="stack-block-pyramid-seq-seen-colors"))
    evaluator.hand = Bursting(evaluator.world, np.random.default_rng(0))
    episode = evaluator.run(1)
    evaluator.world.close()
    assert isinstance(episode, Episode) and episode.broken and "flew off" in episode.error
    assert episode.steps == 2 and episode.score == pytest.approx(2 / 6)
    result = summary(expert.config.settings(), [episode])
    assert result["mean_score"] == pytest.approx(33.33) and (result["broken"], result["discarded"]) == (1, 0)


def test_a_scene_that_breaks_before_the_first_action_is_drawn_again_and_counted(
    expert: Evaluator, monkeypatch: pytest.MonkeyPatch
) -> None:
    settle, calls = expert.world.settle, 0

    def explode_once() -> bool:
        nonlocal calls
        calls += 1
        if calls == 1:
            raise PhysicsError("the red block flew off")
        return settle()

    with monkeypatch.context() as patch:
        patch.setattr(expert.world, "settle", explode_once)
        patch.setattr(expert, "agent", Idle())
        episode = expert.run(1)
    assert isinstance(episode, Episode) and (episode.redraws, episode.score, episode.steps) == (1, 0.0, 0)
    result = summary(expert.config.settings(), [episode, replace(episode, redraws=3), replace(episode, redraws=0)])
    assert (result["redrawn"], result["redraws"]) == (2, 4)


class Idle(ExpertAgent):
    """Does nothing."""

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Answer:
        return None, None


def test_the_agent_without_words_is_the_same_again_and_knows_no_order() -> None:
    kits = "assembling-kits-seq-unseen-colors"
    evaluator = Evaluator(replace(WITHOUT_ARM, checkpoint="blind", task=kits))
    episodes = [evaluator.run(seed) for seed in (0, 1, 2, 0)]
    evaluator.world.close()
    assert episodes[0] == episodes[3]
    assert all(isinstance(episode, Episode) and episode.steps == 5 for episode in episodes)
    steps = [step for episode in episodes for step in episode.actions if isinstance(episode, Episode)]
    assert 0.0 < np.mean([step.pick_right for step in steps]) < 1.0
    result = summary(evaluator.config.settings(), episodes)
    assert result["without_arm"] is True and result["mean_score"] < result["mean_score_with_next"] < 100.0


def test_a_score_with_the_next_goal_is_of_the_step_that_would_have_been_the_last() -> None:
    step = Step("", "fold", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), "", "", True, True, "SUCCEEDED", "", None, 0.5, 0.6)
    none = Episode(0, 0.5, 1, 2, 0, "", None, 0.0, "", ())
    whole = replace(none, actions=(step, replace(step, score_with_next=1.0), replace(step, score_with_next=0.8)))
    result = summary({"checkpoint": "blind"}, [none, whole, replace(none, actions=(step,))])
    assert result["mean_score_with_next"] == pytest.approx((0 + 100 + 60) / 3, abs=0.01)
    assert "mean_score_with_next" not in summary({"checkpoint": "expert"}, [none])


def test_a_scene_without_room_is_discarded(expert: Evaluator, monkeypatch: pytest.MonkeyPatch) -> None:
    def explode() -> bool:
        raise PhysicsError("the red block flew off")

    with monkeypatch.context() as patch:
        patch.setattr(expert.world, "settle", explode)  # each time that the scene is drawn
        patch.setattr(expert.world, "config", replace(expert.world.config, max_layouts=2))
        outcome = expert.run(1)
    assert outcome == Discarded(1, "the red block flew off")
    result = summary(expert.config.settings(), [outcome])
    assert result["mean_score"] is None and result["discarded"] == 1
    assert result["discarded_episodes"] == [{"seed": 1, "reason": "the red block flew off"}]


def test_an_interrupted_evaluation_continues_where_it_stopped(
    expert: Evaluator, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "results.json"
    config = EvaluateConfig("expert", SEEN, "val", 3, 2, without_arm=True)
    record = tmp_path / "new" / "results.episodes.jsonl"
    journal = Journal(out, config.settings() | source_state().to_dict())
    out.parent.mkdir()
    evaluator = Evaluator(config)
    episode = evaluator.run(3)
    evaluator.world.close()
    assert isinstance(episode, Episode)
    marked = replace(episode, error="kept from before")
    journal.add(marked)
    with record.open("a") as file:
        file.write('{"episode": {"seed": 4, "sc')  # killed while it wrote
    arguments = ["--checkpoint", "expert", "--task", SEEN, "--split", "val", "--first-seed", "3", "--episodes", "2"]
    arguments += ["--without-arm"]
    assert evaluate_cli.main([*arguments, "--split", "test", "--out", str(out)]) == 1
    assert "begun with other settings (split val not test)" in capsys.readouterr().err
    assert evaluate_cli.main([*arguments, "--processes", "2", "--out", str(out)]) == 0
    result = json.loads(out.read_text())
    assert result["mean_score"] == 100.0 and result["discarded"] == 0 and 0 < result["chance"] < 60
    assert [(e["seed"], e["score"]) for e in result["episodes"]] == [(3, 1.0), (4, 1.0)]
    assert Episode.from_dict(result["episodes"][0]) == marked
    assert result["command"].startswith("ros2 run cliport_benchmark evaluate --checkpoint expert")
    assert result["machine"]["cores"] >= 1 and result["commit"]
    assert "1 of 2 episodes are there" in (said := capsys.readouterr().out) and "ETA" in said
    assert [path.name for path in out.parent.iterdir()] == ["results.json"]
    record.write_text("what?\n")
    assert evaluate_cli.main([*arguments, "--out", str(out)]) == 1
    assert "is no record of an evaluation" in capsys.readouterr().err


def test_sentences_that_could_not_be_reworded_are_counted(expert: Evaluator, monkeypatch: pytest.MonkeyPatch) -> None:
    config = replace(expert.config, wording=Wording(synonyms={"blue": "azure"}))
    with monkeypatch.context() as patch:
        patch.setattr(expert, "agent", Idle())
        patch.setattr(expert, "config", config)
        reworded = expert.run(1)
        patch.setattr(PutBlocksInBowls, "sentence_slots", {})  # a sentence of another form than the pattern
        as_it_was = expert.run(1)
    assert isinstance(reworded, Episode) and isinstance(as_it_was, Episode)
    assert (reworded.own_wording, as_it_was.own_wording) == (False, True)
    assert summary(config.settings(), [reworded, as_it_was])["own_wording"] == 1
    assert "own_wording" not in summary(expert.config.settings(), [reworded])


def test_summary_counts_a_refusal_as_wrong(first: Episode) -> None:
    refused = replace(first, score=0.0, steps=0, actions=(), error="not understood")
    burst = replace(first, error="the red block flew off", broken=True)
    result = summary({"checkpoint": "some policy"}, [first, refused, burst, burst])
    assert result["mean_score"] == 75.0 and result["broken"] == 2
    assert result["choices"]["first_action_both_right"] == 75.0 and result["choices"]["refused"] == 1
