"""What the commands do when they are not told otherwise, and which words they take."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cliport_benchmark import demo, evaluate_cli, evaluate_graph, experiment_cli, gallery_cli, generate_cli, record_cli
from cliport_benchmark.errors import OptionError
from cliport_benchmark.own_setup import condition_words, variation_of
from cliport_benchmark.variation import Aspect, MountingErrors, Variation

TASK = "put-blocks-in-bowls-seen-colors"
SETUP = {"workspace": None, "camera": None, "camera_kind": "plain"}
VARIED = {"randomize": None, "mounting_error": None}


@pytest.mark.parametrize(
    ("parser", "given", "options"),
    [
        (
            evaluate_cli._parser,
            ["--checkpoint", "expert", "--task", TASK, "--out", "r.json"],
            {
                "checkpoint": "expert",
                "task": TASK,
                "split": "test",
                "first_seed": 0,
                "episodes": 100,
                "out": Path("r.json"),
                "processes": 2,
                "ray": None,
                "num_gpus": 0.0,
                "phrasings": None,
                "exact_offset": False,
                "synonyms": None,
                "survey_colors": False,
                "without_arm": False,
                "leave_out": "",
                **SETUP,
                **VARIED,
            },
        ),
        (
            evaluate_graph._parser,
            ["--out", "r.json"],
            {
                "checkpoint": "default",
                "task": TASK,
                "split": "test",
                "first_seed": 0,
                "episodes": 10,
                "real_time_factor": 1.0,
                "out": Path("r.json"),
            },
        ),
        (
            generate_cli._parser,
            ["--task", TASK, "--episodes", "5", "--out", "data"],
            {
                "task": TASK,
                "split": "train",
                "first_seed": 0,
                "episodes": 5,
                "out": Path("data"),
                "processes": 2,
                "first_parts": None,
                "goals_per_scene": 1,
                "mistakes": 0.0,
                "mode": "fast",
                **SETUP,
                **VARIED,
            },
        ),
        (
            record_cli._parser,
            ["--task", TASK, "--episodes", "5", "--out", "data"],
            {
                "task": TASK,
                "split": "train",
                "first_seed": 0,
                "episodes": 5,
                "instructions": None,
                "out": Path("data"),
                **SETUP,
                **VARIED,
            },
        ),
        (
            gallery_cli._parser,
            [],
            {"out": Path("docs/benchmark.png"), "videos": None, "tasks": "all", "split": "test", "seed": 0},
        ),
        (
            demo._parser,
            [],
            {"task": TASK, "seed": 3, "instruction": "", "checkpoint": "default", "out": "out/demo"},
        ),
        (
            experiment_cli._parser,
            ["--task", TASK, "--out", "all"],
            {
                "task": TASK,
                "config": "compact",
                "n_demos": "100",
                "steps": 6000,
                "keep_steps": None,
                "val_episodes": 100,
                "test_episodes": 100,
                "also_test": None,
                "settings": [],
                "train_options": "",
                **SETUP,
                "randomize": None,
                "randomize_scores": None,
                "exact_offset": False,
                "processes": 2,
                "jobs": 1,
                "ray": None,
                "num_gpus": 0.0,
                "out": Path("all"),
            },
        ),
    ],
)
def test_options_that_are_not_given(
    parser: Callable[[], argparse.ArgumentParser], given: list[str], options: dict[str, Any]
) -> None:
    assert vars(parser().parse_args(given)) == options


def test_options_without_a_value_mean_all() -> None:
    given = ["--task", TASK, "--episodes", "1", "--out", "data", "--randomize"]
    options = record_cli._parser().parse_args([*given, "--mounting-error", "2", "0.5"])
    assert variation_of(options).aspects == frozenset(Aspect) and options.mounting_error == [2.0, 0.5]
    assert variation_of(options).mounting == Variation.parse("mounting", (2.0, 0.5)).mounting
    chosen = experiment_cli._parser().parse_args(["--task", TASK, "--out", "x", "--randomize-scores"])
    assert (chosen.randomize, chosen.randomize_scores) == (None, "all")


def test_an_experiment_keeps_a_quarter_half_and_all_of_the_steps() -> None:
    def kept(*options: str) -> list[tuple[int, ...]]:
        given = experiment_cli._parser().parse_args(["--task", TASK, "--out", "x", *options])
        return [experiment.keep_steps for experiment in experiment_cli._experiments(given)]

    assert kept("--steps", "10") == [(2, 5, 10)] and kept("--steps", "1") == [(1,)] and kept() == [(1500, 3000, 6000)]
    assert kept("--steps", "9", "--keep-steps", "3,9") == [(3, 9)]
    several = ["--task", TASK, "--out", "x", "--config", "compact,cliport", "--n-demos", "1,10", "--also-test", TASK]
    made = experiment_cli._experiments(experiment_cli._parser().parse_args(several))
    pairs = [("compact", 1), ("compact", 10), ("cliport", 1), ("cliport", 10)]
    assert [(e.config, e.n_demos) for e in made] == pairs and {e.also_test for e in made} == {(TASK,)}


@pytest.mark.parametrize(("option", "value"), [("--processes", "0"), ("--jobs", "0")])
def test_an_experiment_needs_a_process(option: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert experiment_cli.main(["--task", TASK, "--out", "x", option, value]) == 1
    assert "must be 1 or more" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "value"), [("--processes", "0"), ("--first-parts", "0")])
def test_demonstrations_need_a_process_and_a_part(option: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert generate_cli.main(["--task", TASK, "--episodes", "1", "--out", "x", option, value]) == 1
    assert capsys.readouterr().err == f"error: {option} must be 1 or more, got 0\n"


def test_what_varies_is_said_with_its_ranges() -> None:
    settings = Variation.parse("all").settings()
    assert set(settings["light"]) == {"light_elevation", "brightness", "diffuse_share", "exposure"}
    assert set(settings["texture"]) == {"table_grey", "table_tint", "texture_contrast", "texture_period"}
    assert settings["clutter"] == {"least": 2, "most": 5, "margin": 0.08}
    assert settings["mounting"] == {"shift": 0.0015, "turn": 0.0015}
    assert MountingErrors().turn == pytest.approx(0.086 * 3.14159 / 180.0, rel=1e-2), "as --mounting-error has it"


@pytest.mark.parametrize("errors", [(0.0, -1.0), (float("nan"), 0.0), (float("inf"), 0.0)])
def test_impossible_mounting_errors(errors: tuple[float, float]) -> None:
    assert Variation.parse("mounting", (0.0, 0.0)).mounting == MountingErrors(0.0, 0.0)
    with pytest.raises(OptionError, match="--mounting-error must be zero or more"):
        Variation.parse("mounting", errors)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, ""),
        ({"offset": "centred", "randomize": False, "graph": False}, ""),
        ({"wording": {}}, ", other wording"),
        ({"graph": True, "offset": "exact"}, ", through the graph, exact offset"),
        ({"without_arm": True, "offset": "exact"}, ", without the arm, exact offset"),
        ({"workspace": {"x_min": 0.0}}, ", own set-up"),
        ({"randomize": {"light": {}, "clutter": {}}, "camera": None}, ", own set-up, randomized: light, clutter"),
    ],
)
def test_what_was_unusual_about_a_score(values: dict[str, Any], words: str) -> None:
    assert condition_words(values) == words


@pytest.mark.parametrize(
    ("program", "needed"),
    [
        (evaluate_cli, ["--checkpoint", "--task", "--out"]),
        (evaluate_graph, ["--out"]),
        (generate_cli, ["--task", "--episodes", "--out"]),
        (record_cli, ["--task", "--episodes", "--out"]),
        (experiment_cli, ["--task", "--out"]),
    ],
)
def test_what_must_be_given_is_named(program: Any, needed: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as refusal:
        program.main([])
    assert refusal.value.code == 2 and capsys.readouterr().err.strip().endswith(", ".join(needed))


class Interrupted:
    """Whatever a command begins with: somebody interrupts it."""

    def __init__(self, *_: object, **__: object) -> None:
        raise KeyboardInterrupt


GOES_ON = "error: interrupted; the same command continues where this one stopped\n"


@pytest.mark.parametrize(
    ("program", "first", "options", "said"),
    [
        (evaluate_cli, "make_task", ["--checkpoint", "expert", "--out", "r.json"], GOES_ON),
        (evaluate_graph, "EvaluateConfig", ["--out", "r.json"], GOES_ON),
        (generate_cli, "GenerateConfig", ["--episodes", "1", "--out", "d"], GOES_ON),
        (record_cli, "RecordConfig", ["--episodes", "1", "--out", "d"], GOES_ON),
        (experiment_cli, "Experiment", ["--out", "d"], GOES_ON),
        (gallery_cli, "task_names", [], "error: interrupted\n"),
        (demo, "_run", [], "error: interrupted\n"),
    ],
)
def test_an_interrupted_command_says_what_becomes_of_it(
    program: Any,
    first: str,
    options: list[str],
    said: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(program, first, Interrupted)
    given = [] if program is gallery_cli else ["--task", TASK]
    assert program.main([*given, *options]) == 130
    assert capsys.readouterr().err == said


@pytest.mark.parametrize(
    ("program", "options"),
    [
        (evaluate_cli, ["--checkpoint", "expert", "--out", "r.json"]),
        (evaluate_graph, ["--out", "r.json"]),
        (generate_cli, ["--episodes", "1", "--out", "d"]),
        (record_cli, ["--episodes", "1", "--out", "d"]),
        (experiment_cli, ["--out", "d"]),
    ],
)
def test_a_task_that_is_not_known_is_one_line(
    program: Any,
    options: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert program.main(["--task", "juggling", *options]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: unknown task 'juggling'") and error.count("\n") == 1
