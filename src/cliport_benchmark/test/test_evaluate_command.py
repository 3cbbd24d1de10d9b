"""The evaluate command: results of other settings or weights, several tasks, and one line about bad input."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from cliport_benchmark import evaluate_cli
from cliport_benchmark.errors import BenchmarkError, DataFolderError, OptionError
from cliport_benchmark.evaluate import EvaluateConfig, evaluate
from cliport_benchmark.journal import Discarded, Journal
from cliport_benchmark.own_setup import condition_words
from cliport_benchmark.summary import summary
from cliport_policy.card import load_card, resolve_checkpoint
from cliport_policy.named_configs import load_network_config

SEEN = "put-blocks-in-bowls-seen-colors"


def test_outcomes_are_those_of_the_seeds_asked_for_in_their_order(tmp_path: Path) -> None:
    config = EvaluateConfig("expert", SEEN, "val", 3, 3)
    journal = Journal(tmp_path / "results.json", config.settings())
    for seed in (9, 5, 3, 4):
        journal.add(Discarded(seed, "flew apart"))
    heard: list[object] = []
    assert [outcome.seed for outcome in evaluate(config, 1, journal, heard.append)] == [3, 4, 5]
    assert not heard  # all were there


def test_a_policy_that_was_trained_again_does_not_continue_the_old_ones_evaluation(tmp_path: Path) -> None:
    weights = tmp_path / "policy.safetensors"
    config = EvaluateConfig(str(weights), SEEN, "val", 0, 2)
    weights.write_bytes(b"weights of old")
    weights.with_suffix(".json").write_text(json.dumps(load_card(resolve_checkpoint("default")).to_dict()))
    Journal(tmp_path / "results.json", config.settings()).add(Discarded(0, "flew apart"))
    assert Journal(tmp_path / "results.json", config.settings()).outcomes.keys() == {0}
    weights.write_bytes(b"weights of new")  # as many bytes
    with pytest.raises(OptionError, match=r"begun with other settings .*weights_sha256"):
        Journal(tmp_path / "results.json", config.settings())


def test_without_the_arm_is_another_evaluation_and_for_those_who_know_the_scene(tmp_path: Path) -> None:
    config = EvaluateConfig("expert", SEEN, "val", 0, 2, without_arm=True)
    out = tmp_path / "results.json"
    out.write_text(json.dumps(summary(config.settings(), [Discarded(0, "flew apart")])))
    assert Journal(out, config.settings()).outcomes.keys() == {0}
    for other in (replace(config, without_arm=False), replace(config, without_arm=False, exact_offset=True)):
        with pytest.raises(DataFolderError, match=r"holds results of other settings .*without_arm True not None"):
            Journal(out, other.settings())
    with pytest.raises(OptionError, match=r"--without-arm is for expert and blind, who know .*; got default"):
        replace(config, checkpoint="default")
    with pytest.raises(OptionError, match=r"--exact-offset is of the arm: with --without-arm .* as it is held"):
        replace(config, exact_offset=True)


def test_results_say_which_weights_and_method_they_are_of(tmp_path: Path) -> None:
    """And a network that needs a goal image is refused before an hour is spent on its zeros."""
    settings = EvaluateConfig("default", SEEN, "val", 0, 2).settings()
    assert (settings["method"], settings["own_encoders"], settings["met_surveyed_colors"]) == (
        "multi[open]",
        True,
        False,
    )
    assert len(settings["weights_sha256"]) == 64
    weights = tmp_path / "policy.safetensors"
    weights.write_bytes(b"")
    card = replace(load_card(resolve_checkpoint("default")), network=load_network_config("image_goal_rotator"))
    weights.with_suffix(".json").write_text(json.dumps(card.to_dict()))
    with pytest.raises(OptionError, match=r"policy.safetensors reads an image of the goal, which evaluate does not"):
        EvaluateConfig(str(weights), SEEN, "val", 0, 2).settings()


def test_a_policy_without_a_part_is_another_evaluation() -> None:
    whole = EvaluateConfig("default", SEEN, "val", 0, 2)
    parts = ("fits_prints", "reads_sides")
    settings = replace(whole, left_out=parts).settings()
    assert settings == whole.settings() | {"left_out": list(parts)}
    assert condition_words(settings) == ", without fits_prints and reads_sides"


def test_parts_are_named_in_any_order() -> None:
    given = [
        "--checkpoint",
        "default",
        "--task",
        SEEN,
        "--out",
        "r.json",
        "--leave-out",
        "reads_sides, aligner,aligner",
    ]
    config = evaluate_cli._config(evaluate_cli._parser().parse_args(given), SEEN)
    assert config.left_out == ("aligner", "reads_sides")


def test_several_tasks_make_a_folder_and_complete_ones_are_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    both = f"{SEEN},put-block-in-bowl-unseen-colors"
    arguments = ["--checkpoint", "expert", "--task", both, "--episodes", "1", "--first-seed", "1", "--processes", "1"]
    arguments += ["--out", str(tmp_path / "all"), "--without-arm"]
    assert evaluate_cli.main(arguments) == 0
    names = [SEEN, "put-blocks-in-bowls-unseen-colors"]
    assert sorted(path.stem for path in (tmp_path / "all").iterdir()) == names
    assert "mean_score" in capsys.readouterr().out
    assert evaluate_cli.main(arguments) == 0
    said = capsys.readouterr().out
    assert f"{SEEN}: {tmp_path}/all/{SEEN}.json is kept" in said and "mean_score" not in said
    assert evaluate_cli.main([*arguments, "--first-seed", "2"]) == 1
    assert "holds results of other settings (first_seed 1 not 2)" in capsys.readouterr().err


def test_a_task_that_fails_does_not_end_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fails(config: EvaluateConfig, *_: object) -> list[Discarded]:
        if config.task == SEEN:
            raise BenchmarkError("seed 3: a worker died")
        return [Discarded(0, "flew apart")]

    monkeypatch.setattr(evaluate_cli, "evaluate", fails)
    arguments = ["--checkpoint", "expert", "--episodes", "1", "--out", str(tmp_path / "r")]
    several = f"align-rope,{SEEN},sweeping-piles"
    assert evaluate_cli.main([*arguments, "--task", several]) == 1
    assert sorted(path.stem for path in (tmp_path / "r").iterdir()) == ["align-rope", "sweeping-piles"]
    *_, last = capsys.readouterr().err.splitlines()
    assert last.startswith("error: 1 of 3 tasks failed") and last.endswith(f": {SEEN}: seed 3: a worker died")
    monkeypatch.setattr(evaluate_cli, "evaluate", lambda *_: [Discarded(0, "flew apart")])
    assert evaluate_cli.main([*arguments, "--task", several]) == 0


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
        (["--leave-out", "aligner"], "--leave-out leaves out parts of a policy's network, and expert has none"),
        (["--checkpoint", "default", "--leave-out", "rotator"], "'rotator' is no part that can be left out: name some"),
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
