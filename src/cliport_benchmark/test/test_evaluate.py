"""Evaluation: the expert in full physics, chance, wording, and what is said about bad input."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cliport_benchmark import evaluate_cli
from cliport_benchmark.agents import Decision, ExpertAgent
from cliport_benchmark.chance import chance_score
from cliport_benchmark.episode import Episode
from cliport_benchmark.errors import OptionError
from cliport_benchmark.evaluate import EvaluateConfig, Evaluator
from cliport_benchmark.journal import Discarded, Journal
from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.provenance import commit
from cliport_benchmark.summary import summary
from cliport_benchmark.wording import Wording, load_patterns, load_synonyms
from cliport_perception import Heightmap, PlanarPose
from cliport_perception.primitive import Outcome
from panda_executor.request import PickPlaceResult
from sim_bridge.errors import PhysicsError
from sim_bridge.tasks import ColorGoal, PutBlocksInBowls, Task
from sim_bridge.world import SimWorld

SEEN = "put-blocks-in-bowls-seen-colors"


@pytest.fixture(scope="module")
def expert() -> Iterator[Evaluator]:
    evaluator = Evaluator(EvaluateConfig("expert", SEEN, "test", 1, 1))
    yield evaluator
    evaluator.world.close()


def test_expert_solves_a_scene_in_full_physics_and_again_the_same(expert: Evaluator) -> None:
    other = Evaluator(expert.config)
    other.run(2)  # what came before must not matter
    first = expert.run(1)
    assert isinstance(first, Episode) and first == other.run(1)
    assert first.score == 1.0 and first.goals_reached == 1 and first.steps == first.max_steps - 1
    for step in first.actions:
        assert step.outcome == "SUCCEEDED" and step.primitive == "pick_place"
        assert step.pick_right and step.place_right and step.picked.endswith("block") and step.place_at.endswith("bowl")
        assert step.instruction == first.instruction
    other.world.close()


class QuickHand(KinematicHand):
    """Moves things without the arm."""

    def new_scene(self) -> None:
        """Nothing to forget."""

    def execute(self, *arguments: Any) -> PickPlaceResult:
        super().execute(*arguments)
        return PickPlaceResult(Outcome.SUCCEEDED, "moved", None, 0.0)


class Absent(ExpertAgent):
    """The expert, who first reaches into the void."""

    def __init__(self) -> None:
        self.slips = 1

    def decide(self, task: Task, observation: Heightmap, instruction: str) -> Decision | None:
        if self.slips:
            self.slips -= 1
            return Decision(PlanarPose(0.63, 0.39, 0.0), PlanarPose(0.63, 0.37, 0.0), task.primitive)
        return super().decide(task, observation, instruction)


def test_a_sequence_says_the_next_sentence_when_a_step_is_done(expert: Evaluator) -> None:
    evaluator = Evaluator(replace(expert.config, task="stack-block-pyramid-seq-seen-colors"))
    evaluator.hand = QuickHand(evaluator.world, np.random.default_rng(0))  # type: ignore[assignment]
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


def test_physics_that_explodes_discards_the_episode(expert: Evaluator, monkeypatch: pytest.MonkeyPatch) -> None:
    def explode() -> bool:
        raise PhysicsError("the red block flew off")

    with monkeypatch.context() as patch:
        patch.setattr(expert.hand, "execute", lambda *arguments: explode())
        outcome = expert.run(1)
    assert outcome == Discarded(1, "the red block flew off")
    result = summary(expert.config.settings(), [outcome])
    assert result["mean_score"] is None and result["discarded"] == 1
    assert result["discarded_episodes"] == [{"seed": 1, "reason": "the red block flew off"}]


def test_an_interrupted_evaluation_continues_where_it_stopped(
    expert: Evaluator, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "results.json"
    config = EvaluateConfig("expert", SEEN, "val", 3, 2)
    record = tmp_path / "new" / "results.episodes.jsonl"
    journal = Journal(out, config.settings() | {"commit": commit()})
    out.parent.mkdir()
    episode = Evaluator(config).run(3)
    assert isinstance(episode, Episode)
    marked = replace(episode, error="kept from before")
    journal.add(marked)
    with record.open("a") as file:
        file.write('{"episode": {"seed": 4, "sc')  # killed while it wrote
    arguments = ["--checkpoint", "expert", "--task", SEEN, "--split", "val", "--first-seed", "3", "--episodes", "2"]
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


def test_several_tasks_make_a_folder_and_complete_ones_are_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = f"{SEEN},put-block-in-bowl-unseen-colors"
    arguments = ["--checkpoint", "expert", "--task", both, "--episodes", "1", "--first-seed", "1", "--processes", "1"]
    arguments += ["--out", str(tmp_path / "all")]
    assert evaluate_cli.main(arguments) == 0
    names = [SEEN, "put-blocks-in-bowls-unseen-colors"]
    assert sorted(path.stem for path in (tmp_path / "all").iterdir()) == names
    assert "mean_score" in capsys.readouterr().out
    assert evaluate_cli.main(arguments) == 0
    said = capsys.readouterr().out
    assert f"{SEEN}: {tmp_path}/all/{SEEN}.json is kept" in said and "mean_score" not in said
    assert evaluate_cli.main([*arguments, "--first-seed", "2"]) == 1
    assert "holds results of other settings (first_seed 1 not 2)" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--task", "put-blocks-in-bowl-seen-colors"], "did you mean put-blocks-in-bowls-seen-colors"),
        (["--split", "tests"], "did you mean test"),
        (["--checkpoint", "/nowhere/policy.safetensors"], "/nowhere/policy.safetensors"),
        (["--episodes", "-1"], "--episodes must be 1 or more, got -1"),
        (["--first-seed", "-1"], "--first-seed must be 0 or more, got -1"),
        (["--processes", "0"], "--processes must be 1 or more"),
        (["--out", "/proc/none/results.json"], "cannot write --out /proc/none/results.json"),
        (["--out", "/"], "it is a folder"),
        (["--phrasings", "/nowhere.txt"], "cannot read --phrasings /nowhere.txt"),
        (["--task", f"{SEEN},stack-block-pyramids"], "unknown task 'stack-block-pyramids'"),
    ],
)
def test_bad_input_is_one_clear_line(
    extra: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [
        "--checkpoint",
        "expert",
        "--task",
        SEEN,
        "--episodes",
        "1",
        "--out",
        str(tmp_path / "r.json"),
    ]
    assert evaluate_cli.main([*arguments, *extra]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and message in error and error.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_chance_lies_where_counting_says() -> None:
    world = SimWorld()
    for seed in range(20):
        task = world.reset(SEEN, "test", seed)
        assert isinstance(task, PutBlocksInBowls)
        blocks = [o.color for o in task.objects if o.name == "block"]
        bowls = [o.color for o in task.objects if o.name == "bowl"]
        if task.max_steps != 2:
            continue
        hit = 1 / len(blocks) * bowls.count(task.goal.bowl) / len(bowls)
        expected = hit + (1 - hit) * hit  # at once, or with the second and last step
        assert chance_score(task, np.random.default_rng(0)) == pytest.approx(expected, abs=0.08)
    world.close()


def test_wording_fills_patterns_in_turn_and_swaps_words(tmp_path: Path) -> None:
    patterns = tmp_path / "patterns.txt"
    patterns.write_text("# new\n\nevery {block} cube into the {bowl} dish\n{bowl} bowl: {block} blocks\n")
    synonyms = tmp_path / "synonyms.txt"
    synonyms.write_text("red = crimson\n")
    wording = Wording(load_patterns(patterns), load_synonyms(synonyms))
    goal = ColorGoal("red", "green")
    assert wording.sentence(goal, 0) == "every crimson cube into the green dish"
    assert wording.sentence(goal, 3) == "green bowl: crimson blocks"
    assert replace(wording, patterns=()).sentence(goal, 0) == "put the crimson blocks in a green bowl"
    assert Wording().sentence(goal, 5) == goal.sentence
    patterns.write_text("fine {block} {bowl}\nput {block} away\n")
    with pytest.raises(OptionError, match=r"line 2: the pattern lacks \{bowl\}"):
        load_patterns(patterns)
    synonyms.write_text("mauve = purple\n")
    with pytest.raises(OptionError, match="line 1: write 'colour = word'"):
        load_synonyms(synonyms)


def test_summary_counts_a_refusal_as_wrong(expert: Evaluator) -> None:
    episode = expert.run(1)
    assert isinstance(episode, Episode)
    refused = replace(episode, score=0.0, steps=0, actions=(), error="not understood")
    result = summary({"checkpoint": "some policy"}, [episode, refused])
    assert result["mean_score"] == 50.0
    assert result["choices"]["first_action_both_right"] == 50.0 and result["choices"]["refused"] == 1
