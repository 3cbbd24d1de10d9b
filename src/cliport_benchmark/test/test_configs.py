"""Settings of data sets and evaluations at their limits, agents by name, and lines of progress."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_benchmark import evaluate_cli, generate, generate_cli
from cliport_benchmark.agents import BlindAgent, ExpertAgent, PolicyAgent, load_agent
from cliport_benchmark.episode import Episode, Step
from cliport_benchmark.errors import OptionError
from cliport_benchmark.evaluate import EvaluateConfig, Evaluator
from cliport_benchmark.generate import GenerateConfig, Mode, PartReport
from cliport_benchmark.journal import Discarded, Journal
from cliport_benchmark.record import RecordConfig
from cliport_benchmark.wording import Wording
from sim_bridge.errors import LayoutError, PhysicsError

TASK = "put-blocks-in-bowls-seen-colors"


KITS = "assembling-kits-seq-seen-colors"


@pytest.mark.parametrize(("episodes", "parts", "last"), [(1, 1, 1), (50, 1, 50), (51, 2, 1), (120, 3, 20)])
def test_a_data_set_is_made_in_parts_of_fifty(episodes: int, parts: int, last: int) -> None:
    config = GenerateConfig(TASK, "train", 3, episodes)
    assert config.n_parts == parts and len(config.episodes_of(parts - 1)) == last
    assert [number for part in range(parts) for number in config.episodes_of(part)] == list(range(episodes))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: GenerateConfig(TASK, "train", -1, 1), "--first-seed must be 0 or more, got -1"),
        (lambda: GenerateConfig(TASK, "train", 0, 0), "--episodes must be 1 or more, got 0"),
        (lambda: GenerateConfig(TASK, "train", 0, 1, 0), "--goals-per-scene must be 1 or more, got 0"),
        (lambda: GenerateConfig("align-rope", "train", 0, 1, 2), "--goals-per-scene must be 1 for align-rope"),
        (lambda: GenerateConfig(KITS, "train", 0, 1, mistakes=1.01), r"--mistakes must be in 0\.\.1, got 1\.01"),
        (lambda: GenerateConfig(KITS, "train", 0, 1, mistakes=float("nan")), r"--mistakes must be in 0\.\.1, got nan"),
        (lambda: GenerateConfig(TASK, "train", 0, 1, mistakes=0.1), f"--mistakes must be 0 for {TASK}"),
        (lambda: RecordConfig(TASK, "train", -1, 1), "--first-seed must be 0 or more, got -1"),
        (lambda: RecordConfig(TASK, "train", 0, 0), "--episodes must be 1 or more, got 0"),
        (lambda: EvaluateConfig("expert", TASK, "test", -1, 1), "--first-seed must be 0 or more, got -1"),
        (lambda: EvaluateConfig("expert", TASK, "test", 0, 0), "--episodes must be 1 or more, got 0"),
    ],
)
def test_numbers_that_make_nothing_are_refused(make, words: str) -> None:
    with pytest.raises(OptionError, match=f"^{words}"):
        make()


def test_the_least_numbers_will_do() -> None:
    assert GenerateConfig("align-rope", "train", 0, 1, 1).n_parts == 1 and GenerateConfig(TASK, "train", 0, 1, 2)
    assert GenerateConfig(KITS, "train", 0, 1, mistakes=1.0).settings()["mistakes"] == 1.0
    assert (
        GenerateConfig(KITS, "train", 0, 1).settings()["mistakes"] is None
    )  # as in folders made before there were any
    assert RecordConfig(TASK, "train", 0, 1).name(0) == f"{TASK}-train-000000"
    config = EvaluateConfig("expert", TASK, "test", 0, 1)
    assert list(config.seeds) == [0] and list(EvaluateConfig("expert", TASK, "test", 7, 3).seeds) == [7, 8, 9]
    assert not config.is_reworded and not config.exact_offset


def test_settings_say_what_a_score_is_of() -> None:
    config = EvaluateConfig("expert", TASK, "test", 7, 3, Wording(synonyms={"red": "crimson"}), exact_offset=True)
    settings = config.settings()
    assert {name: settings[name] for name in ("task", "split", "checkpoint", "first_seed", "offset", "randomize")} == {
        **{"task": TASK, "split": "test", "checkpoint": "expert", "first_seed": 7},
        **{"offset": "exact", "randomize": False},
    }
    assert settings["wording"] == {"patterns": (), "synonyms": {"red": "crimson"}} and settings["object_set"] == ""
    plain = EvaluateConfig("blind", TASK, "test", 7, 3).settings()
    assert plain["offset"] == "centred" and not {"wording", "weights_sha256"} & set(plain)
    made = GenerateConfig(TASK, "train", 2, 9, mode=Mode.PHYSICS).settings()
    names = ("task", "split", "first_seed", "episodes", "episodes_per_part", "goals_per_scene", "mode", "randomize")
    assert [made[name] for name in names] == [TASK, "train", 2, 9, 50, 1, "physics", False]


def test_agents_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    assert isinstance(load_agent("expert"), ExpertAgent) and isinstance(load_agent("blind"), BlindAgent)
    inference = SimpleNamespace(action="action", done_probability=0.25)
    policy = SimpleNamespace(infer=lambda seen, said: inference if (seen, said) == ("seen", "said") else None)
    monkeypatch.setattr(
        "cliport_policy.policy.load_policy", lambda name, left_out: policy if left_out == ("aligner",) else None
    )
    agent = load_agent("mine", ("aligner",))
    assert isinstance(agent, PolicyAgent) and agent.decide(None, "seen", "said") == ("action", 0.25)  # type: ignore[arg-type, comparison-overlap]
    task = SimpleNamespace(expert_action=lambda: "the expert's")
    assert ExpertAgent().decide(task, None, "") == ("the expert's", None)  # type: ignore[arg-type, comparison-overlap]
    assert BlindAgent().decide(task, None, "") == (None, None)  # type: ignore[arg-type]
    monkeypatch.undo()
    with pytest.raises(OptionError, match="no-such-checkpoint"):
        load_agent("no-such-checkpoint")


def test_a_sentence_without_slots_is_said_as_it_is() -> None:
    evaluator = object.__new__(Evaluator)
    evaluator.config = EvaluateConfig("expert", TASK, "test", 0, 1, Wording(("{block} into {bowl}", "{bowl}: {block}")))
    evaluator._said_as_it_was = False
    own = "put the {block} blocks in a {bowl} bowl"
    task = SimpleNamespace(instruction="own", sentence_pattern=own, sentence_slots={"block": "red", "bowl": "blue"})
    wording = evaluator.config.wording
    said = [evaluator._sentence(task, wording, index) for index in (0, 1, 2)]  # type: ignore[arg-type]
    assert said == ["red into blue", "blue: red", "red into blue"] and not evaluator._said_as_it_was
    task.sentence_slots = {}
    assert evaluator._sentence(task, wording, 0) == "own" and evaluator._said_as_it_was  # type: ignore[arg-type]


@pytest.mark.parametrize("error", [LayoutError("no place"), PhysicsError("it flew off")])
def test_a_scene_that_cannot_be_made_is_discarded(monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fails(*_: object) -> None:
        raise error

    evaluator = object.__new__(Evaluator)
    evaluator.config, evaluator.world = EvaluateConfig("expert", TASK, "test", 0, 1), None  # type: ignore[assignment]
    monkeypatch.setattr("cliport_benchmark.evaluate.reset_scene", fails)
    assert evaluator.run(4) == Discarded(4, str(error))
    monkeypatch.setattr(generate, "reset_scene", fails)
    assert generate._make_episode(GenerateConfig(TASK, "train", 0, 1), None, None, None, 0) is None  # type: ignore[arg-type]


def test_a_part_counts_its_rows_and_what_was_discarded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    closed: list[int] = []
    written: list[Any] = []
    found = {50: [1, 2, 3], 51: None, 52: [4], 53: []}
    monkeypatch.setattr(
        generate, "SimWorld", lambda config: SimpleNamespace(config=config, close=lambda: closed.append(1))
    )
    monkeypatch.setattr(generate, "Observer", lambda *_, **__: None)
    monkeypatch.setattr(generate, "_make_episode", lambda config, world, observer, arm, episode: found[episode])
    monkeypatch.setattr(generate, "write_part", lambda path, rows: written.append((path, rows)))
    config = GenerateConfig(TASK, "train", 0, 54)
    assert generate.make_part(config, tmp_path, 1) == PartReport(1, 4, 4, 1)
    assert written == [(generate.part_path(tmp_path, 1), [1, 2, 3, 4])] and closed == [1]


def test_the_rate_and_the_time_left_are_said(monkeypatch: pytest.MonkeyPatch, capsys) -> None:
    clock = iter([100.0, 130.0, 160.0])
    monkeypatch.setattr(generate_cli.time, "monotonic", lambda: next(clock))
    progress = generate_cli._Progress(GenerateConfig(TASK, "train", 0, 250))
    progress.report(PartReport(0, 50, 60, 2), 4)
    progress.report(PartReport(1, 50, 90, 1), 3)
    assert capsys.readouterr().out.splitlines() == [
        "part 1/5: 60 observations, 2.0/s, 2 episodes discarded, ETA 2.0 min",
        "part 2/5: 150 observations, 2.5/s, 3 episodes discarded, ETA 1.5 min",
    ]


def test_an_evaluation_says_its_mean_and_the_time_left(monkeypatch: pytest.MonkeyPatch, capsys, tmp_path: Path) -> None:
    at = (0.4, 0.0, 0.0)
    missed = Step("put it", "pick_place", at, at, "", "", False, False, "GRASP_MISSED", "nothing held", None, 0.0)
    fine = Step("put it", "pick_place", at, at, "", "", True, True, "SUCCEEDED", "done", None, 0.0)

    def episode(seed: int, score: float, error: str, *steps: Step) -> Episode:
        return Episode(seed, score, len(steps), 4, 0, "put it", None, 1.0, error, steps)

    config = EvaluateConfig("expert", TASK, "test", 1, 4)
    journal = Journal(tmp_path / "r.json", config.settings())
    journal.outcomes = {1: episode(1, 1.0, ""), 9: episode(9, 0.0, "")}
    clock = iter([100.0, 160.0, 220.0])
    monkeypatch.setattr(evaluate_cli.time, "monotonic", lambda: next(clock))
    progress = evaluate_cli._Progress(config, journal)
    progress.report(episode(2, 0.0, "it saw nothing", missed, fine))
    progress.report(Discarded(3, "no place"))
    assert capsys.readouterr().out.splitlines() == [
        f"continuing {TASK}: 1 of 4 episodes are there",
        "[2/4] seed 2: score 0.00 in 2 steps, GRASP_MISSED: nothing held, it saw nothing; mean 50.0, ETA 2.0 min",
        "[3/4] seed 3: discarded, no place; mean 50.0, ETA 1.0 min",
    ]


@pytest.mark.parametrize(("first", "complete"), [(None, 3), (2, 2), (9, 3)])
def test_the_parts_that_are_complete_are_counted(monkeypatch, capsys, tmp_path: Path, first, complete: int) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(
        generate_cli, "generate", lambda config, out, processes, *more: asked.append((processes, more[2]))
    )
    options = ["--task", TASK, "--episodes", "101", "--out", str(tmp_path)]
    assert generate_cli.main([*options, *(["--first-parts", str(first)] if first else [])]) == 0
    assert capsys.readouterr().out == f"{complete} parts complete in {tmp_path}\n" and asked == [(2, first)]
