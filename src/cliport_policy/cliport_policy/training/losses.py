"""Cross-entropies of the three networks against an expert's action."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from cliport_policy.batches import Batch
from cliport_policy.config import TrainConfig
from cliport_policy.networks.policy_network import Goal, PolicyNetwork

YAW_SIGMA = math.radians(5.0)  # softness of the rotator's target: half a bin
CELL_SIGMA = 0.8  # softness of the pick's and the place's target, in cells


class Losses(NamedTuple):
    """Mean losses of a batch (scalars); locator counts every sample, the others those with an action."""

    locator: Tensor
    rotator: Tensor
    transport: Tensor

    def total(self) -> Tensor:
        return self.locator + 0.3 * self.rotator + self.transport


def compute_losses(
    network: PolicyNetwork,
    batch: Batch,
    config: TrainConfig,
    generator: torch.Generator,
    goal_images: Tensor | None = None,
) -> Losses:
    """Losses of a batch of any network; goal_images: (B, 5, H, W) for one that needs them."""
    goal = network.encode_goal(batch.phrases, goal_images)
    act = ~batch.done
    cell = network.cell_size
    size = (batch.images.shape[-2] // cell, batch.images.shape[-1] // cell)
    location = soft_cells(batch.pick, size, cell).flatten(1)  # (B, h w)
    target = torch.cat((location * act[:, None], batch.done[:, None].float()), dim=1)
    locator = soft_cross_entropy(network.score_picks(batch.images, goal).float(), target).mean()
    if not act.any():
        return Losses(locator, locator.new_zeros(()), locator.new_zeros(()))
    images, goal = batch.images[act], goal.select(act)
    rotator = _rotator_loss(network, batch, images, goal, config, generator)
    transport = _transport_loss(network, batch, images, goal, size, config, generator)
    return Losses(locator, rotator, transport)


def _rotator_loss(
    network: PolicyNetwork,
    batch: Batch,
    images: Tensor,
    goal: Goal,
    config: TrainConfig,
    generator: torch.Generator,
) -> Tensor:
    act = ~batch.done
    bins = yaw_target(batch.pick_yaw[act], batch.pick_yaw_period[act], network.config.n_rotations)  # (A, k)
    chosen = _subset(bins, config.rotator_rotations, generator)  # (A, R) bin indices
    angles = chosen.float() * (2 * math.pi / network.config.n_rotations)
    # The predicted pixel is never exact: the crop is not centred exactly either.
    pick = batch.pick[act] + torch.randn(batch.pick[act].shape, generator=generator) * 1.5
    logits = network.score_yaws(images, goal, pick, angles)
    if logits is None:
        return images.new_zeros(())
    target = bins.gather(1, chosen)
    return soft_cross_entropy(logits.float(), target / target.sum(1, keepdim=True)).mean()


def _transport_loss(
    network: PolicyNetwork,
    batch: Batch,
    images: Tensor,
    goal: Goal,
    size: tuple[int, int],
    config: TrainConfig,
    generator: torch.Generator,
) -> Tensor:
    act = ~batch.done
    k = network.config.n_rotations
    right = torch.round(batch.rotation[act] / (2 * math.pi / k)).long() % k  # (A,)
    chosen = _subset(F.one_hot(right, k).float(), config.transport_rotations, generator)  # (A, R)
    angles = chosen.float() * (2 * math.pi / k)
    logits = network.score_places(images, goal, batch.pick[act], angles)  # (A, R, h, w)
    cells = soft_cells(batch.place[act], size, network.cell_size)  # (A, h, w)
    target = (chosen == right[:, None]).float()[:, :, None, None] * cells[:, None]
    return soft_cross_entropy(logits.flatten(1), target.flatten(1)).mean()


def soft_cells(pixels: Tensor, size: tuple[int, int], cell: int = 2) -> Tensor:
    """A narrow Gaussian around each float (row, col) pixel on the grid of cells: (B, h, w), sums to 1.

    It is 0 everywhere for a pixel far outside, as a done frame's meaningless ones may be.
    """
    cells = (pixels - (cell - 1) / 2) / cell
    rows = torch.arange(size[0])[None, :] - cells[:, 0, None]
    cols = torch.arange(size[1])[None, :] - cells[:, 1, None]
    weight = torch.exp(-(rows[:, :, None].square() + cols[:, None, :].square()) / (2 * CELL_SIGMA**2))
    return weight / weight.sum((1, 2), keepdim=True).clamp_min(1e-20)


def yaw_target(yaw: Tensor, period: Tensor, n_rotations: int) -> Tensor:
    """Soft target over the rotation bins: every bin that shows the object the same way is right. (B, k), sums to 1.

    A parallel gripper looks the same after half a turn, so the period is at most pi.
    """
    angles = torch.arange(n_rotations) * (2 * math.pi / n_rotations)
    period = torch.clamp(period, max=math.pi)[:, None]
    error = torch.remainder(angles[None] - yaw[:, None] + period / 2, period) - period / 2
    weight = torch.exp(-error.square() / (2 * YAW_SIGMA**2))
    return weight / weight.sum(1, keepdim=True)


def soft_cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    """(B, N) logits and a distribution (B, N) -> (B,)."""
    return -(target * F.log_softmax(logits, dim=1)).sum(1)


def _subset(target: Tensor, size: int, generator: torch.Generator) -> Tensor:
    """Bin indices (B, size): the likeliest bin of each row first, the others drawn without replacement."""
    noise = torch.rand(target.shape, generator=generator)
    noise.scatter_(1, target.argmax(1, keepdim=True), 2.0)
    return noise.topk(min(size, target.shape[1]), dim=1).indices
