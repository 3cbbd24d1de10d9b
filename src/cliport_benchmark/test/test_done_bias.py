"""Bias of "done": least wrong answers, each primitive by itself, on top of what the card says already."""

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from cliport_benchmark import understanding_cli
from cliport_benchmark.done_bias import fitted_done_bias
from cliport_benchmark.understanding import Asked, Question
from cliport_policy.card import resolve_checkpoint
from cliport_policy.checkpoint import load_checkpoint


def answers(primitive: str, left: list[float], reached: list[float]) -> list[Question]:
    """Return questions to which "done" was held so likely where work is left, and where the goal is reached."""
    kinds = [(Asked.OPEN, left), (Asked.REACHED, reached), (Asked.ABSENT, [0.99])]
    return [
        Question("t", 0, kind.value, "s", "act", primitive=primitive, done_probability=probability)
        for kind, probabilities in kinds
        for probability in probabilities
    ]


def logit(probability: float) -> float:
    return math.log(probability / (1 - probability))


def test_the_cut_lies_where_wrong_answers_weigh_least() -> None:
    questions = [
        *answers("pick_place", [0.001, 0.01, 0.3], [0.04, 0.09, 0.2, 0.9]),
        *answers("sweep", [0.2, 0.6], [0.5, 0.7]),  # too early once would be worse than too late once
        *answers("fold", [0.5], []),
    ]
    found = fitted_done_bias([*questions, Question("t", 0, Asked.OPEN.value, "s", "refused")], {"sweep": 1.0})
    assert set(found) == {"pick_place", "sweep"}, "nothing is known of folds that are done"
    picked, swept = found["pick_place"], found["sweep"]
    assert picked == pytest.approx((-(logit(0.01) + logit(0.04)) / 2, 3, 1, 7))
    assert swept == pytest.approx((1.0 - (logit(0.6) + logit(0.7)) / 2, 1, 1, 4))


def test_answers_that_are_sure_count_and_equal_ones_are_not_parted() -> None:
    (found,) = fitted_done_bias(answers("sweep", [0.0, 0.0], [1.0]), {}).values()
    assert found.wrong == 0 and math.isfinite(found.bias)
    (found,) = fitted_done_bias(answers("sweep", [0.4, 0.4], [0.4]), {}).values()
    assert (found.wrong_before, found.wrong) == (1, 1) and found.bias < 0.4


def test_the_bias_is_written_into_the_card_and_scenes_of_the_test_are_not_fitted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shipped = resolve_checkpoint("default")
    mine = tmp_path / "mine.safetensors"
    mine.symlink_to(shipped)
    _, card = load_checkpoint(shipped)
    mine.with_suffix(".json").write_text(json.dumps(replace(card, done_bias={"fold": 0.25}).to_dict()))
    examined = SimpleNamespace(questions=answers("sweep", [0.2, 0.6], [0.7]), whole=True)
    monkeypatch.setattr(understanding_cli, "_examine", lambda options, tasks: [examined])
    given = ["--checkpoint", str(mine), "--task", "separating-piles-seen-colors", "--calibrate"]
    assert understanding_cli.main([*given, "--split", "val", "--out", str(tmp_path / "u.json")]) == 0
    bias = round(-(logit(0.6) + logit(0.7)) / 2, 2)
    assert f"done, sweep: 0 of 3 wrong with a bias of {bias:+.2f}, 1 before" in capsys.readouterr().out
    assert load_checkpoint(mine)[1].done_bias == {"fold": 0.25, "sweep": bias}
    assert json.loads((tmp_path / "u.json").read_text())["done_bias"] == {"fold": 0.25, "sweep": bias}
    examined.questions = answers("fold", [0.2], [])
    assert understanding_cli.main([*given, "--split", "val", "--out", str(tmp_path / "v.json")]) == 0
    assert "done: nothing to fit" in capsys.readouterr().out
    assert load_checkpoint(mine)[1].done_bias == {"fold": 0.25, "sweep": bias}
    assert understanding_cli.main([*given, "--split", "test", "--out", str(tmp_path / "t.json")]) == 1
    assert "--calibrate fits the checkpoint to the scenes: give --split val, not test" in capsys.readouterr().err
    assert not (tmp_path / "t.json").exists()
