"""What a training shows: agreement, lines, curves; and the options it was begun with."""

import io
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from cliport_policy.config import NetworkConfig
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.mixture import Mixture, Source
from cliport_policy.networks.policy_network import Goal
from cliport_policy.networks.rotation import bin_angles
from cliport_policy.training import log
from cliport_policy.training.agreement import Agreement, agreement
from cliport_policy.training.log import EventLog, ProgressLine
from cliport_policy.training.options import parse_options
from cliport_policy.training.trainer import Progress


class _Expert(nn.Module):
    """It knows the demonstrations, and errs by some cells and bins."""

    cell_size, n_null = 2, 1

    def __init__(self, data: Mixture, cells: tuple[int, int], bins: int, done: float) -> None:
        super().__init__()
        self.config, self.weight = NetworkConfig(n_rotations=40), nn.Parameter(torch.zeros(1))
        self.demos = iter([data[i].demo for i in range(len(data))])
        self.cells, self.bins, self.done = cells, bins, done

    def encode_goal(self, phrases: list[str], images: Tensor | None = None) -> Goal:
        assert not self.training
        return Goal()

    def look(self, images: Tensor, goal: Goal) -> Goal:
        self.demo, self.shape = next(self.demos), (images.shape[-2] // 2, images.shape[-1] // 2)
        return goal

    def _map(self, pixel: tuple[int, int]) -> Tensor:
        out = torch.zeros(self.shape)
        out[pixel[0] // 2 + self.cells[0], pixel[1] // 2 + self.cells[1]] = 1e-3
        return out

    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        cells = self._map(self.demo.pick_pixel).flatten()
        others = math.log(len(cells)) + 1e-6
        null = torch.tensor([others + math.log(self.done / (1 - self.done))])
        return torch.cat((cells, null))[None]

    def score_rotations(self, images: Tensor, goal: Goal, pick: Tensor) -> tuple[Tensor, Tensor]:
        yaws = torch.zeros(1, 40)
        yaws[0, self.bins % 40] = 1
        places = torch.zeros(1, 40, *self.shape)
        places[0, 7] = self._map(self.demo.place_pixel)
        return yaws, places


@pytest.mark.parametrize(
    ("cells", "bins", "done", "found"),
    [
        ((0, 0), 0, 0.4, Agreement(1, 1, 1, 4 / 6, 6)),
        ((0, 0), 1, 0.6, Agreement(1, 1, 1, 2 / 6, 6)),  # 9 degrees of 10
        ((5, 2), 2, 0.4, Agreement(1, 0, 1, 4 / 6, 6)),  # 10.8 pixels of 2.5 mm, and 18 degrees
        ((2, 5), -1, 0.4, Agreement(1, 1, 1, 4 / 6, 6)),
        ((5, 4), 10, 0.4, Agreement(0, 1, 0, 4 / 6, 6)),  # 12.8 pixels, and the quarter turn that is the same
        ((-4, 5), 5, 0.4, Agreement(0, 0, 0, 4 / 6, 6)),
    ],
)
def test_agreement_by_hand(
    make_flat_set: Callable[..., Path], tmp_path: Path, cells: tuple[int, int], bins: int, done: float, found: Agreement
) -> None:
    """Yaws are 0 and alike every quarter turn; a third of the scenes are finished."""
    data = Mixture([Source(load_demonstrations(make_flat_set(tmp_path / "data", 6)))])
    network = _Expert(data, cells, bins, done).train()
    shares = agreement(network, data, range(6))  # type: ignore[arg-type]
    assert asdict(shares) == pytest.approx(asdict(found))


class Clock:
    """Seconds that pass only when told."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic(self) -> float:
        return self.now


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def _progress(step: int, loss: float = 1.0, steps: int = 120) -> Progress:
    return Progress(step, steps, {"locator": loss}, 1e-3, 20.0, 3.6)


def test_a_log_has_rarer_lines_the_longer_it_gets() -> None:
    clock, out = Clock(), io.StringIO()
    line = ProgressLine(out, lambda: clock.now)
    began = clock.now
    for step in range(1, 601):  # a step a second
        clock.now = began + step
        line(_progress(step, 2.0 if step == 1 else 1.0, steps=600))
    lines = out.getvalue().splitlines()
    shown = [int(text.split("] ")[1].split("/")[0]) for text in lines]
    assert shown[:5] == [1, 7, 13, 19, 25] and shown[-3:-1] == [576, 588] and shown[-1] == 600
    assert lines[1] == f"[{24 * '-'}] 7/600  locator {1 + 0.98**6:.3f}  20.0 samples/s  4 min left"
    assert lines[-1].startswith(f"[{24 * '#'}] 600/600  ")


def test_a_terminal_is_refreshed_twice_a_second() -> None:
    clock, out = Clock(), _Terminal()
    line = ProgressLine(out, lambda: clock.now)
    for step, seconds in ((1, 0.0), (2, 0.4), (3, 0.6), (4, 1.0), (5, 1.2), (6, 1.2)):
        clock.now = 1000 + seconds
        line(_progress(step, steps=6))
    shown = [part.split("] ")[1].split(" ")[0] for part in out.getvalue().split("\r")[1:]]
    assert shown == ["1/6", "3/6", "5/6", "6/6"]
    assert out.getvalue().count("\x1b[K") == 4 and out.getvalue().count("\n") == 1 and out.getvalue()[-1] == "\n"


def test_curves_have_a_point_every_ten_steps_and_at_the_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    points: list[tuple[Any, ...]] = []

    class Writer:
        def __init__(self, folder: str, purge_step: int) -> None:
            points.append((folder, purge_step))

        def add_scalar(self, *point: Any) -> None:
            points.append(point)

        def add_image(self, name: str, picture: Any, step: int, dataformats: str) -> None:
            points.append((name, step, dataformats))

        def flush(self) -> None:
            points.append(("flush",))

        def close(self) -> None:
            points.append(("close",))

    monkeypatch.setattr(log, "SummaryWriter", Writer)
    monkeypatch.setattr(log, "read_curves", lambda folder, last: {})
    events = EventLog(tmp_path, 3)  # goes on after step 3: what was logged from 4 on is discarded
    for step in range(1, 13):
        events(_progress(step, steps=12))
    events.picture("samples", np.zeros((1, 1, 3), np.uint8), 4)
    events.close()
    each = [[("loss/locator", 1.0, n), ("learning_rate", 1e-3, n), ("samples_per_s", 20.0, n)] for n in (10, 12)]
    assert points == [(str(tmp_path), 4), *each[0], *each[1], ("samples", 4, "HWC"), ("flush",), ("close",)]


def test_options_that_nobody_gave() -> None:
    options = parse_options(["--data", "a", "--out", "o"])
    assert (options.config_name, options.network, options.initial) == ("compact", NetworkConfig(), None)
    assert (options.device, options.save_minutes, options.max_minutes) == ("auto", 3.0, math.inf)
    assert (options.n_demos, options.val, options.keep_steps) == (None, None, frozenset())
    assert options.cache_bytes == 4 * 2**30 and options.data[0].weight == 1.0 and options.out == Path("o")
    given = ["--n-demos", "1", "--keep-steps", "5,,7", "--minutes", "0", "--cache-gb", "0.5", "--val", "v"]
    options = parse_options(["--data", "a:2.5", "--data", "b:c", "--out", "o", *given, "--set", "train.jitter=false"])
    assert [(entry.folder, entry.weight) for entry in options.data] == [(Path("a"), 2.5), (Path("b:c"), 1.0)]
    assert (options.n_demos, options.keep_steps, options.max_minutes) == (1, {5, 7}, 0.0)
    assert options.cache_bytes == 2**29 and options.val == Path("v") and not options.train.jitter


@pytest.mark.parametrize(("turns", "pairs"), [(2, True), (3, False), (4, True), (36, True)])
def test_bins_go_once_around(turns: int, pairs: bool) -> None:
    angles = bin_angles(turns)
    assert angles.tolist() == pytest.approx([2 * math.pi * i / turns for i in range(turns)])
