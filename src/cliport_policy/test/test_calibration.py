"""Confidences: what temperature makes of them, and that a card's temperatures change them and nothing else."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import torch

from cliport_policy import load_policy
from cliport_policy.calibrate import main
from cliport_policy.calibration import JudgedAnswer, expected_calibration_error, fit_temperature
from cliport_policy.checkpoint import load_checkpoint
from cliport_policy.errors import CheckpointError, DataError

pytestmark = pytest.mark.usefixtures("one_thread")
SENTENCE = "put the red blocks in a blue bowl"


def _answers(true_temperature: float, n: int = 400) -> Iterator[JudgedAnswer]:
    """Of a policy that should divide its logits by true_temperature: labels are drawn from what that gives."""
    generator = torch.Generator().manual_seed(0)
    for _ in range(n):
        logits = 3 * torch.randn(2, 20, generator=generator)
        mass = (logits / true_temperature).flatten().softmax(0).reshape(logits.shape).sum(0)
        label = int(torch.multinomial(mass, 1, generator=generator))
        best = int(logits.flatten().softmax(0).reshape(logits.shape).sum(0).argmax())
        cells = torch.arange(20)
        yield JudgedAnswer(logits, cells == label, cells == best, best == label)


@pytest.mark.parametrize("true_temperature", [0.5, 1.0, 2.5])
def test_the_temperature_is_found_again(true_temperature: float) -> None:
    found = fit_temperature(_answers(true_temperature))
    assert found.temperature == pytest.approx(true_temperature, rel=0.2) and found.n == 400
    assert found.ece_after < 0.08
    assert found.ece_after <= found.ece_before + 0.01


def test_calibration_error_is_the_gap_of_confidence_and_hits() -> None:
    sure = np.full(100, 0.95)
    assert expected_calibration_error(sure, np.arange(100) < 95) == pytest.approx(0.0, abs=1e-9)
    assert expected_calibration_error(sure, np.arange(100) < 45) == pytest.approx(0.5)
    assert expected_calibration_error(np.array([0.0, 1.0]), np.array([True, False])) == pytest.approx(1.0)


def test_nothing_to_learn_from() -> None:
    with pytest.raises(DataError, match="nothing to calibrate on"):
        fit_temperature([])


def test_the_card_is_written_and_changes_confidences_only(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    path, data = tiny_checkpoint("compact"), make_flat_set(tmp_path / "data", 4, actions=1, pixel_size=0.0125)
    assert main(["--checkpoint", str(path), "--data", str(data)]) == 1  # an untrained policy never picks right
    assert "nothing to calibrate on" in capsys.readouterr().err
    card = json.loads(path.with_suffix(".json").read_text())
    observation = _some_observation(data)
    plain = load_policy(path).infer(observation, SENTENCE)
    path.with_suffix(".json").write_text(json.dumps(card | {"temperatures": {"pick": 0.5, "place": 3.0}}))
    warm = load_policy(path).infer(observation, SENTENCE)
    assert (warm.action.pick, warm.action.place) == (plain.action.pick, plain.action.place)
    assert warm.done_probability == plain.done_probability and warm.action.confidence == warm.confidence
    assert warm.pick_confidence > plain.pick_confidence and warm.place_confidence < plain.place_confidence
    path.with_suffix(".json").write_text(json.dumps(card | {"temperatures": {"pick": 0.0}}))
    with pytest.raises(CheckpointError, match="temperature must be positive"):
        load_checkpoint(path)


def test_calibrating_a_checkpoint(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    path, data = tiny_checkpoint("compact"), make_flat_set(tmp_path / "data", 4, actions=1, pixel_size=0.0125)
    monkeypatch.setattr("cliport_policy.peaks.CONFIDENCE_RADIUS", 1.0)  # every answer is near enough
    assert main(["--checkpoint", str(path), "--data", str(data), "--count", "3"]) == 0
    assert "on 3 demonstrations" in capsys.readouterr().out
    card = load_checkpoint(path)[1]
    assert set(card.temperatures) == {"pick", "place"} and card.scores["calibration"]["pick"]["n"] == 3
    other = make_flat_set(tmp_path / "other", 1, actions=1)
    for arguments, message in (
        (["--data", str(other)], "workspace"),
        (["--data", str(tmp_path)], "no data set"),
        (["--data", str(data), "--count", "0"], "--count is 0"),
    ):
        assert main(["--checkpoint", str(path), *arguments]) == 1
        assert message in (line := capsys.readouterr().err) and line.count("\n") == 1


def test_a_refused_sentence_is_left_out_and_counted(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    path, data = tiny_checkpoint("compact"), make_flat_set(tmp_path / "data", 3, actions=1, pixel_size=0.0125)
    odd = make_flat_set(tmp_path / "odd", 1, actions=1, pixel_size=0.0125, task="odd", sentence="qwertz uiop asdf")
    (odd / "part-00000.parquet").rename(data / "part-00001.parquet")
    monkeypatch.setattr("cliport_policy.peaks.CONFIDENCE_RADIUS", 1.0)
    assert main(["--checkpoint", str(path), "--data", str(data)]) == 0
    shown = capsys.readouterr().out
    assert "1 demonstrations left out, whose sentence the policy refuses" in shown and "on 3 demonstrations" in shown


def test_an_interruption_is_one_line(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("cliport_policy.calibrate.calibrate", interrupt)
    path, data = tiny_checkpoint("compact"), make_flat_set(tmp_path / "data", 1, actions=1, pixel_size=0.0125)
    assert main(["--checkpoint", str(path), "--data", str(data)]) == 130
    assert capsys.readouterr().err == "error: interrupted; nothing was written\n"


def _some_observation(folder: Path):  # type: ignore[no-untyped-def]
    from cliport_policy.data.demonstrations import load_demonstrations

    data = load_demonstrations(folder)
    return data.observation(data.frames[0])
