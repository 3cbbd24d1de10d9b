"""Targets and losses: symmetric yaws are equally right, and the loss falls to its floor at the target."""

import math

import pytest
import torch

from cliport_policy.losses import soft_cells, soft_cross_entropy, yaw_target


def test_a_cubes_four_yaws_share_the_target() -> None:
    target = yaw_target(torch.tensor([math.radians(20)]), torch.tensor([math.pi / 2]), 36)[0]
    best = sorted(target.topk(4).indices.tolist())
    assert best == [2, 11, 20, 29]
    assert math.isclose(float(target.sum()), 1, abs_tol=1e-5)


def test_a_grippers_half_turn_is_always_right() -> None:
    target = yaw_target(torch.tensor([0.0]), torch.tensor([2 * math.pi]), 36)[0]
    assert torch.isclose(target[0], target[18])
    assert target[9] < 1e-6


def test_cells_are_centred_on_the_pixel() -> None:
    cells = soft_cells(torch.tensor([[41.0, 20.5]]), (160, 80))[0]
    rows = (cells.sum(1) * torch.arange(160)).sum()
    cols = (cells.sum(0) * torch.arange(80)).sum()
    assert float(rows) == pytest.approx((41.0 - 0.5) / 2, abs=1e-3)
    assert float(cols) == pytest.approx((20.5 - 0.5) / 2, abs=1e-3)


def test_a_pixel_far_outside_gives_no_target() -> None:
    assert float(soft_cells(torch.tensor([[-400.0, 900.0]]), (160, 80)).sum()) == 0


def test_cross_entropy_is_lowest_at_the_target() -> None:
    target = torch.tensor([[0.7, 0.2, 0.1]])
    at_target = soft_cross_entropy(target.log(), target)
    assert at_target < soft_cross_entropy(torch.tensor([[0.5, 0.3, 0.2]]).log(), target)
