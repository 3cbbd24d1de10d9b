"""The training loop on a clock of its own: what is saved, told and averaged when, by hand."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch import nn

from cliport_policy.config import TrainConfig
from cliport_policy.training import trainer
from cliport_policy.training.distributed import Group
from cliport_policy.training.trainer import Progress, Trainer


class Clock:
    """Seconds that pass only when told."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now


class Quick(Trainer):
    """The loop alone: each step takes a minute, and nothing is computed."""

    def __init__(self, clock: Clock, steps: int = 6) -> None:
        self.clock, self.folder, self.group, self.step = clock, Path("run"), Group(), 0
        self.config = TrainConfig(steps=steps, batch_size=8, warmup_steps=0)
        self.loader = SimpleNamespace(steps=self._steps)  # type: ignore[assignment]
        self.saved: list[Any] = []
        self.workers: int | None = None

    def _steps(self, first: int, workers: int) -> Iterator[int]:
        self.workers = workers
        yield from range(first, 1000)

    def _train_step(self, step: Any) -> dict[str, float]:
        assert step == self.step
        self.clock.now += 60
        return {"locator": 2.0}

    def save(self) -> None:
        self.saved.append(self.step)

    def save_policy(self, path: Path) -> None:
        self.saved.append(str(path))


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(trainer, "time", made)
    return made


@pytest.mark.parametrize(
    ("limits", "saved"),
    [
        ({"save_minutes": 100}, [6]),
        ({"save_minutes": 1.5}, [2, 4, 6, 6]),
        ({"save_minutes": 2.0}, [3, 6, 6]),
        ({"save_minutes": 100, "max_minutes": 2.5}, [3]),
        ({"save_minutes": 100, "max_minutes": 3.0}, [4]),
        ({"save_minutes": 100, "keep_steps": {2}}, ["run/checkpoints/step-0000002.safetensors", 6]),
    ],
)
def test_what_is_saved_when(clock: Clock, limits: dict[str, Any], saved: list[Any]) -> None:
    quick, told = Quick(clock), []
    quick.run(lambda _: None, **limits, on_save=lambda: told.append(quick.step))
    assert quick.saved == saved and told == [each for each in saved if isinstance(each, int)]
    kept: list[int] = []
    quick = Quick(clock)
    quick.run(lambda _: None, **limits, on_keep=lambda: kept.append(quick.step))
    assert kept == sorted(limits.get("keep_steps", ()))
    assert quick.workers == 0  # the training itself uses all cores of a CPU


def test_a_training_that_is_told_to_stop_saves(clock: Clock) -> None:
    quick = Quick(clock)
    quick.run(lambda _: None, should_stop=lambda: quick.step == 2, save_minutes=100)
    assert quick.saved == [2]


def test_progress_by_hand(clock: Clock) -> None:
    seen: list[Progress] = []
    quick = Quick(clock)
    quick.step = 2  # resumed: the pace is that of this start
    quick.run(seen.append, save_minutes=100)
    rates = [quick.config.learning_rate_at(step) for step in (2, 3, 4, 5)]
    assert [each.step for each in seen] == [3, 4, 5, 6] and [each.learning_rate for each in seen] == rates
    assert [each.minutes_left for each in seen] == pytest.approx([3, 2, 1, 0])
    assert all(each.samples_per_s == pytest.approx(8 / 60) and each.steps == 6 for each in seen)
    assert seen[0].losses == {"locator": 2.0}


def test_other_processes_neither_report_nor_save(clock: Clock) -> None:
    quick, seen = Quick(clock), []
    quick.group = Group(rank=1)
    quick.run(seen.append, save_minutes=0.1, keep_steps={1})
    assert quick.step == 6 and not seen and not quick.saved


@pytest.mark.parametrize(("step", "decay"), [(0, 0.1), (2, 0.25), (10_000, 0.9)])
def test_an_average_forgets_its_beginning_sooner(step: int, decay: float) -> None:
    network, average = nn.BatchNorm1d(2), nn.BatchNorm1d(2)
    nn.init.constant_(network.weight, 3.0)
    network.num_batches_tracked.fill_(7)
    fake = SimpleNamespace(network=network, average=average, config=TrainConfig(ema_decay=0.9), step=step)
    Trainer._update_average(fake)  # type: ignore[arg-type]
    assert torch.allclose(average.weight, torch.full((2,), decay + 3 * (1 - decay)))
    assert int(average.num_batches_tracked) == 7
    fake.average = network
    Trainer._update_average(fake)  # type: ignore[arg-type]
    assert (network.weight == 3).all()


@pytest.mark.parametrize(
    ("precision", "device", "fast", "casts"),
    [
        ("auto", "cpu", False, False), ("auto", "cpu", True, True), ("auto", "cuda", False, True),
        ("float32", "cuda", True, False), ("bfloat16", "cpu", False, True),
    ],
)  # fmt: skip
def test_when_half_precision_is_used(
    precision: str, device: str, fast: bool, casts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trainer, "has_fast_bfloat16", lambda: fast)
    fake = SimpleNamespace(config=TrainConfig(precision=precision), group=Group(device=torch.device(device)))
    assert Trainer._autocasts(fake) is casts  # type: ignore[arg-type]


def test_anchors_are_far_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    angles = torch.tensor([0.0, 0.1, 1.5, 3.0, 2.0])
    vectors = torch.stack((angles.cos(), angles.sin()), dim=1)
    monkeypatch.setattr(trainer, "N_ANCHORS", 3)
    assert torch.equal(trainer._farthest_points(vectors), vectors[[0, 3, 2]])
    assert torch.equal(trainer._farthest_points(vectors[:2]), vectors[:2])


def test_a_fine_tuning_adds_anchors_only_for_what_is_far_from_those_that_it_has() -> None:
    angles = torch.tensor([0.1, 1.5, 0.3, 1.6])
    vectors = torch.stack((angles.cos(), angles.sin()), dim=1)

    def anchors(known: list[list[float]], drawn: torch.Tensor) -> torch.Tensor:
        fake = SimpleNamespace(
            encoder=SimpleNamespace(encode_cached=lambda _: SimpleNamespace(sentence_vectors=lambda: drawn)),
            initial=SimpleNamespace(anchors=torch.tensor(known)),
        )
        return Trainer._anchor_vectors(fake, SimpleNamespace(all_phrases=lambda: ["a"]))  # type: ignore[arg-type]

    found = anchors([[1.0, 0.0], [1.0, 0.0]], vectors)
    assert torch.equal(found[0], torch.tensor([1.0, 0.0])) and len(found) == 3
    assert torch.equal(found[1:], vectors[[1, 3]])
    assert torch.equal(anchors([[1.0, 0.0]], vectors[[0, 2]]), torch.tensor([[1.0, 0.0]]))


def test_phrases_are_embedded_a_part_at_a_time() -> None:
    asked: list[list[str]] = []

    def encode(phrases: list[str]) -> SimpleNamespace:
        asked.append(phrases)
        return SimpleNamespace(sentence_vectors=lambda: torch.tensor([[float(ord(p))] for p in phrases]))

    found = trainer.phrase_vectors(SimpleNamespace(encode_cached=encode), list("abcde"), chunk=2)  # type: ignore[arg-type]
    assert asked == [["a", "b"], ["c", "d"], ["e"]] and found[:, 0].tolist() == [97, 98, 99, 100, 101]
