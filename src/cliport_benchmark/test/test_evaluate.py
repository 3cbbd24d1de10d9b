"""Evaluation: the expert in full physics, chance, wording, and what is said about bad input."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_benchmark import evaluate_cli
from cliport_benchmark.chance import chance_score
from cliport_benchmark.errors import OptionError
from cliport_benchmark.evaluate import EvaluateConfig, Evaluator, summary
from cliport_benchmark.wording import Wording, load_patterns, load_synonyms
from sim_bridge.tasks import TASKS, ColorGoal, PutBlocksInBowls
from sim_bridge.world import SimWorld

SEEN = "put-blocks-in-bowls-seen-colors"


@pytest.mark.parametrize("task", sorted(TASKS))
def test_expert_solves_a_scene_in_full_physics_and_again_the_same(task: str) -> None:
    config = EvaluateConfig("expert", task, "test", 1, 1)
    episodes = [Evaluator(config).run(1) for _ in range(2)]
    first = episodes[0]
    assert first is not None and first == episodes[1]
    assert first.score == 1.0 and first.steps == first.max_steps - 1
    assert all(step.outcome == "SUCCEEDED" and step.block_right and step.bowl_right for step in first.actions)


def test_command_line_writes_the_scores(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "results.json"
    arguments = ["--checkpoint", "expert", "--task", SEEN, "--split", "val", "--first-seed", "3"]
    assert evaluate_cli.main([*arguments, "--episodes", "2", "--processes", "2", "--out", str(out)]) == 0
    result = json.loads(out.read_text())
    assert result["mean_score"] == 100.0 and result["discarded"] == 0 and 0 < result["chance"] < 60
    assert [(e["seed"], e["score"]) for e in result["episodes"]] == [(3, 1.0), (4, 1.0)]
    assert result["command"].startswith("ros2 run cliport_benchmark evaluate --checkpoint expert")
    assert result["machine"]["cores"] >= 1 and result["commit"]
    assert "ETA" in capsys.readouterr().out
    assert [path.name for path in out.parent.iterdir()] == ["results.json"]


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
        kinds = [(o.kind.value, o.color) for o in task.objects]
        blocks = [color for kind, color in kinds if kind == "block"]
        bowls = [color for kind, color in kinds if kind == "bowl"]
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


def test_summary_counts_a_refusal_as_wrong() -> None:
    config = EvaluateConfig("some policy", SEEN, "test", 1, 1)
    episode = Evaluator(replace(config, checkpoint="expert")).run(1)
    assert episode is not None
    refused = replace(episode, score=0.0, steps=0, actions=(), error="not understood")
    result = summary(config, [episode, refused])
    assert result["mean_score"] == 50.0
    assert result["choices"]["first_action_both_right"] == 50.0 and result["choices"]["refused"] == 1
