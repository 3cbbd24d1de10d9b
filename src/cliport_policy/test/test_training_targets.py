"""Recipes, learning rates, targets and what competes, by hand."""

import math
from dataclasses import asdict
from typing import Any

import pytest
import torch
from test_losses import _batch, _Flat
from torch import Tensor

from cliport_policy.config import FINE_TUNE, PAPER, RECIPES, NetworkConfig, TrainConfig
from cliport_policy.errors import ConfigError
from cliport_policy.networks.policy_network import Goal
from cliport_policy.training.losses import (
    Losses,
    _draw_competitors,
    cell_label,
    compute_losses,
    soft_cells,
    yaw_label,
    yaw_target,
)

OURS = {
    "steps": 6000, "batch_size": 16, "accumulate": 1, "learning_rate": 2e-3, "weight_decay": 1e-4,
    "schedule": "cosine", "warmup_steps": 200, "ema_decay": 0.998, "gradient_clip": 1.0, "targets": "soft",
    "rotator_rotations": 12, "transport_rotations": 4, "done_share": 0.15, "absent_share": 0.0, "strange_share": 0.0,
    "augment_probability": 0.6, "rotation_sigma_deg": 60.0, "directed_rotation_sigma_deg": 10.0,
    "translation_sigma_px": 26.67, "recolor": "none", "recolor_probability": 0.7, "rearrange_probability": 0.0,
    "mirror_probability": 0.0, "stretch_sigma": 0.0, "bend_sigma_px": 0.0, "jitter": True, "phrases_per_goal": 200,
    "precision": "auto", "seed": 0,
}  # fmt: skip
# docs/paper.md, "Training" and "Augmentation".
PAPERS = {
    "steps": 201_000, "batch_size": 1, "learning_rate": 1e-4, "weight_decay": 0.0, "schedule": "constant",
    "warmup_steps": 0, "ema_decay": 0.0, "gradient_clip": 0.0, "targets": "one_hot", "rotator_rotations": 0,
    "transport_rotations": 0, "done_share": 0.0, "augment_probability": 1.0, "directed_rotation_sigma_deg": 60.0,
    "jitter": False, "phrases_per_goal": 0,
}  # fmt: skip
TUNED = {"steps": 200, "learning_rate": 5e-4, "warmup_steps": 30, "ema_decay": 0.99, "phrases_per_goal": 40}


def test_recipes_are_those_that_were_published() -> None:
    assert asdict(TrainConfig()) == OURS and asdict(PAPER) == OURS | PAPERS and asdict(FINE_TUNE) == OURS | TUNED
    assert {"ours": TrainConfig(), "paper": PAPER, "fine_tune": FINE_TUNE} == RECIPES
    assert asdict(NetworkConfig()) == {
        "widths": (24, 40, 64, 96), "token_dim": 384, "goal_dim": 128, "transport_channels": 4, "query_cells": 31,
        "crop_pixels": 64, "n_rotations": 36, "language": True, "heights": True, "mask": True,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "good"),
    [
        ({"steps": 1, "batch_size": 1, "accumulate": 1, "warmup_steps": 0}, True),
        ({"steps": 0}, False), ({"batch_size": 0}, False), ({"accumulate": 0}, False), ({"warmup_steps": -1}, False),
        ({"learning_rate": 0}, False), ({"learning_rate": math.inf}, False), ({"weight_decay": -0.1}, False),
        ({"done_share": 1}, True), ({"done_share": 1.01}, False), ({"absent_share": 1.01}, False),
        ({"strange_share": 1.01}, False), ({"augment_probability": 1.01}, False), ({"ema_decay": 1.01}, False),
        ({"recolor_probability": 1.01}, False),
        ({"rearrange_probability": 1.01}, False), ({"rearrange_probability": 1.0}, True), ({"schedule": "x"}, False),
        ({"mirror_probability": 1.01}, False), ({"mirror_probability": 1.0}, True),
        ({"stretch_sigma": -0.1}, False), ({"bend_sigma_px": -1}, False),
    ],
)  # fmt: skip
def test_settings_to_either_side_of_their_bounds(changes: dict[str, Any], good: bool) -> None:
    if good:
        TrainConfig(**changes)
        return
    with pytest.raises(ConfigError):
        TrainConfig(**changes)


def test_learning_rates_by_hand() -> None:
    constant = TrainConfig(schedule="constant", learning_rate=1.0, warmup_steps=4, steps=10)
    assert [constant.learning_rate_at(step) for step in range(6)] == [0.25, 0.5, 0.75, 1, 1, 1]
    cosine = TrainConfig(learning_rate=1.0, warmup_steps=0, steps=100)
    rates = [cosine.learning_rate_at(step) for step in (0, 50, 100, 200)]
    assert rates == pytest.approx([1.0, 0.01 + 0.99 / 2, 0.01, 0.01])
    assert TrainConfig(learning_rate=1.0, warmup_steps=2, steps=100).learning_rate_at(0) == pytest.approx(0.5)


def test_targets_are_as_narrow_as_they_were() -> None:
    """A bin of 10 degrees is two spreads of 5 away; a cell is 1 / 0.8 of one."""
    yaws = yaw_target(torch.zeros(1), torch.tensor([math.pi]), 36)[0]
    assert float(yaws[1] / yaws[0]) == pytest.approx(math.exp(-2), rel=1e-4)
    assert float(yaws[35] / yaws[18]) == pytest.approx(math.exp(-2), rel=1e-4)
    for cell, pixel in ((2, [[8.5, 6.5]]), (1, [[4.0, 3.0]])):
        cells = soft_cells(torch.tensor(pixel), (9, 7), cell)[0]
        assert divmod(int(cells.argmax()), 7) == (4, 3) and float(cells.sum()) == pytest.approx(1, abs=1e-5)
        for row, col, squared in ((5, 3, 1), (4, 2, 1), (5, 4, 2), (2, 3, 4)):
            assert float(cells[row, col] / cells[4, 3]) == pytest.approx(math.exp(-squared / 1.28), rel=1e-4)


@pytest.mark.parametrize(
    ("pixel", "cell", "held"),
    [((8.4, 6.6), 1, (8, 7)), ((9.0, 6.0), 2, (4, 3)), ((0.0, 0.0), 2, (0, 0)), ((1.4, 1.6), 2, (0, 1))],
)
def test_a_label_is_the_cell_that_holds_the_pixel(pixel: tuple[float, float], cell: int, held: tuple[int, int]) -> None:
    found = cell_label(torch.tensor([pixel]), (10, 10), cell)[0]
    assert found.sum() == 1 and found[held] == 1


@pytest.mark.parametrize(
    ("yaw", "period", "bin_"), [(94, 90, 0), (96, 90, 1), (-10, 90, 8), (355, 360, 18), (176, 180, 18), (20, 60, 2)]
)
def test_a_yaws_label_is_the_least_right_bin(yaw: float, period: float, bin_: int) -> None:
    """A gripper turned by half a turn is the same, whatever the thing's own period."""
    found = yaw_label(torch.tensor([math.radians(yaw)]), torch.tensor([math.radians(period)]), 36)[0]
    assert found.sum() == 1 and int(found.argmax()) == bin_


def test_a_total_weighs_yaws_and_primitives_less() -> None:
    parts = Losses(*(torch.tensor(10.0**i) for i in range(7)))
    assert float(parts.total()) == 1 + 3 + 100 + 1000 + 10_000 + 30_000 + 1_000_000


def test_competitors_are_the_right_one_and_the_luckiest() -> None:
    noise = torch.tensor([[0.9, 0.2, 0.7, 0.1], [0.3, 0.8, 0.5, 0.6]])
    right = torch.tensor([3, 0])
    chosen, slot = _draw_competitors(right, noise, 3)
    assert chosen.tolist() == [[3, 0, 2], [0, 1, 3]] and slot.tolist() == [0, 0]
    for size in (0, 4, 5):
        chosen, slot = _draw_competitors(right, noise, size)
        assert chosen.tolist() == [[0, 1, 2, 3]] * 2 and slot.tolist() == [3, 0]


@pytest.mark.parametrize("jitter", [False, True])
def test_the_rotators_crop_is_a_pixel_and_a_half_off(jitter: bool) -> None:
    """By the sample's own seed; that of the transport is not."""
    asked: list[Tensor] = []

    class Watching(_Flat):
        def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
            asked.append(pick)
            return super().score_yaws(images, goal, pick, angles)

        def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
            asked.append(pick)
            return super().score_places(images, goal, pick, angles)

    compute_losses(Watching(), _batch(2), TrainConfig(jitter=jitter))  # type: ignore[arg-type]
    offsets = [torch.randn(2, generator=torch.Generator().manual_seed(seed)) for seed in (0, 1)]
    expected = 9 + 1.5 * torch.stack(offsets) * jitter
    assert torch.allclose(asked[0], expected) and (asked[1] == 9).all()
