"""Cross-entropies of the three networks against an expert's action."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn import functional as F

from cliport_core.action import Primitive
from cliport_policy.config import TrainConfig
from cliport_policy.data.batches import Batch
from cliport_policy.networks.policy_network import Goal, Placings, PolicyNetwork
from cliport_policy.networks.rotation import bin_angles, straight_cells

YAW_SIGMA = math.radians(5.0)  # softness of the targets of yaws and turns: half a bin
HELD_SIGMA = math.radians(3.0)  # of the rotator's yaws around the right ones
WRONG_PLACES, WRONG_TURNS = 3, 3  # places with rotations each that compete with the right place under the aligner
BENDS = 4  # waves that bend what the aligner sees
NEAR_PIXELS = 12  # within which a place is not a wrong one: 3 cm of pixels of 2.5 mm
CELL_SIGMA = 0.8  # softness of the pick's and the place's target, in cells


class Losses(NamedTuple):
    """Losses (scalars).

    locator, done and absent are of the pick's softmax, summed over samples with an action, samples that are finished,
    and samples whose sentence names what is not there, each over the number of all samples; the others are means over
    the samples with an action. fit is the aligner's, 0 for what is swept or folded.
    """

    locator: Tensor
    rotator: Tensor
    transport: Tensor
    done: Tensor
    absent: Tensor
    primitive: Tensor
    fit: Tensor

    def total(self) -> Tensor:
        """Return the weighted sum that is minimised."""
        picks = self.locator + self.done + self.absent
        return picks + 0.3 * self.rotator + self.transport + 0.3 * self.primitive + self.fit


def compute_losses(
    network: PolicyNetwork, batch: Batch, config: TrainConfig, samples: int | None = None, actions: int | None = None
) -> Losses:
    """Return the losses of a batch of any network; 0 for a rotator or an aligner that it lacks.

    samples, actions: numbers of the whole step if this batch is a part of one: the parts' losses sum up to the whole's.
    """
    goal = network.look(batch.images, network.encode_goal(batch.phrases, batch.goal_images))
    act = batch.acts
    n_samples, n_actions = samples or len(act), actions or int(act.sum())
    cell = network.cell_size
    size = (batch.images.shape[-2] // cell, batch.images.shape[-1] // cell)
    picks = _pick_losses(network, batch, goal, size, config) / n_samples  # (B,)
    by_kind = [(picks * chosen).sum() for chosen in (act, batch.done, ~act & ~batch.done)]
    if not act.any():
        zero = picks.new_zeros(())
        return Losses(by_kind[0], zero, zero, by_kind[1], by_kind[2], zero, zero)
    noise = _SampleNoise(batch.seeds[act.cpu()], network.config.n_rotations, batch.images.device)
    images, goal = batch.images[act], goal.select(act)
    rotator = _rotator_losses(network, batch, images, goal, config, noise).sum() / n_actions
    transports, best = _transport_losses(network, batch, images, goal, size, config, noise)
    transport = transports.sum() / n_actions
    fits = _fit_losses(network, batch, images, goal, best, config, noise)
    if batch.primitive is not None:  # what is swept or folded fits nowhere
        fits = fits * (batch.primitive[act] == Primitive.PICK_PLACE)
    fit = fits.sum() / n_actions
    primitive = _primitive_losses(network, batch, images, goal).sum() / n_actions
    return Losses(by_kind[0], rotator, transport, by_kind[1], by_kind[2], primitive, fit)


def _pick_losses(
    network: PolicyNetwork, batch: Batch, goal: Goal, size: tuple[int, int], config: TrainConfig
) -> Tensor:
    """Return the losses (B,) of the softmax over cells and null actions."""
    cells = _cells(batch.pick, size, network.cell_size, config).flatten(1) * batch.acts[:, None]  # (B, h w)
    nulls = [batch.done, ~batch.acts & ~batch.done][: network.n_null]
    if network.n_null == 1:
        nulls = [~batch.acts]  # a network that can't tell them apart
    target = torch.cat((cells, torch.stack(nulls, dim=1).to(cells.dtype)), dim=1)
    return soft_cross_entropy(network.score_picks(batch.images, goal).float(), target)


def _primitive_losses(network: PolicyNetwork, batch: Batch, images: Tensor, goal: Goal) -> Tensor:
    """Return the losses (A,) of the samples with an action; 0 for a network that chooses no primitive."""
    logits = network.score_primitives(images, goal)
    if logits is None or batch.primitive is None:
        return images.new_zeros(len(images))
    return F.cross_entropy(logits.float(), batch.primitive[batch.acts], reduction="none")


class _SampleNoise:
    """Random numbers of each sample's own seed, so that they do not depend on how samples are batched.

    pick: (A, 2) standard normal; yaws, places: (A, k) uniform. For the aligner: turns: (A, k), wrong: (A, WRONG_PLACES)
    and elsewhere: (A, WRONG_PLACES * WRONG_TURNS) uniform; half_turn and mirrored: (A,) bool; near: (A, 2, 2),
    held: (A,), stretch: (A, 2) and bend: (A, BENDS, 2) standard normal; axis: (A,) and waves: (A, 3, BENDS) uniform.
    """

    def __init__(self, seeds: Tensor, k: int, device: torch.device) -> None:
        generators = [torch.Generator().manual_seed(int(seed)) for seed in seeds]

        def uniform(*shape: int) -> Tensor:
            return torch.stack([torch.rand(shape, generator=g) for g in generators]).to(device)

        def normal(*shape: int) -> Tensor:
            return torch.stack([torch.randn(shape, generator=g) for g in generators]).to(device)

        self.pick = normal(2)
        self.yaws, self.places = uniform(2, k).unbind(1)
        self.turns, self.half_turn = uniform(k), uniform() > 0.5
        self.near, self.held = normal(2, 2), normal()
        self.wrong, self.elsewhere = uniform(WRONG_PLACES), uniform(WRONG_PLACES * WRONG_TURNS)
        self.stretch, self.axis, self.mirrored = normal(2), uniform(), uniform() > 0.5
        self.bend, self.waves = normal(BENDS, 2), uniform(3, BENDS)


def _rotator_losses(
    network: PolicyNetwork, batch: Batch, images: Tensor, goal: Goal, config: TrainConfig, noise: _SampleNoise
) -> Tensor:
    """Return the losses (A,) of the samples with an action."""
    act = batch.acts
    make = yaw_target if config.targets == "soft" else yaw_label
    bins = make(batch.pick_yaw[act], batch.pick_yaw_period[act], network.config.n_rotations)  # (A, k)
    chosen, _ = _draw_competitors(bins.argmax(1), noise.yaws, config.rotator_rotations)  # (A, R) bin indices
    angles = bin_angles(bins.shape[1], bins.device)[chosen]
    # The predicted pixel is never exact: the crop is not centred exactly either.
    pick = batch.pick[act] + (noise.pick * 1.5 if config.jitter else 0.0)
    logits = network.score_yaws(images, goal, pick, angles)
    if logits is None:
        return images.new_zeros(len(images))
    target = bins.gather(1, chosen)
    return soft_cross_entropy(logits.float(), target / target.sum(1, keepdim=True))


def _transport_losses(
    network: PolicyNetwork,
    batch: Batch,
    images: Tensor,
    goal: Goal,
    size: tuple[int, int],
    config: TrainConfig,
    noise: _SampleNoise,
) -> tuple[Tensor, Tensor]:
    """Return the losses (A,) of the samples with an action, and each cell's best score (A, h, w), without gradient."""
    act = batch.acts
    angles = bin_angles(network.config.n_rotations, images.device)
    right = torch.round(batch.rotation[act] / (2 * math.pi / len(angles))).long() % len(angles)  # (A,)
    chosen, slot = _draw_competitors(right, noise.places, config.transport_rotations)  # (A, R), (A,)
    logits = network.score_places(images, goal, batch.pick[act], angles[chosen]).float()  # (A, R, h, w)
    target = _cells(batch.place[act], size, network.cell_size, config)  # (A, h, w), for the right rotation
    at_right = logits[torch.arange(len(slot), device=slot.device), slot]
    losses = logits.flatten(1).logsumexp(1) - (target * at_right).sum((1, 2))
    return losses, logits.detach().amax(1)


def _fit_losses(
    network: PolicyNetwork,
    batch: Batch,
    images: Tensor,
    goal: Goal,
    best: Tensor,
    config: TrainConfig,
    noise: _SampleNoise,
) -> Tensor:
    """Return the losses (A,) of the samples with an action; 0 for a network that has no aligner.

    The expert's rotation at its place competes with other rotations there, and with wrong places that are drawn as
    the transport would have it: best, (A, h, w), its scores of the cells.
    """
    if not network.has_aligner:
        return images.new_zeros(len(images))
    act, k = batch.acts, network.config.n_rotations
    bins = turn_target(batch.rotation[act], k)  # (A, k)
    chosen, _ = _draw_competitors(bins.argmax(1), noise.turns, config.rotator_rotations)
    # Predicted pixels and yaws are not exact, and a parallel gripper may hold the thing the other way round.
    off_pick, off_place = (noise.near * config.jitter).unbind(1)
    yaw = batch.pick_yaw[act].float() + HELD_SIGMA * noise.held * config.jitter + math.pi * noise.half_turn
    right = (batch.place[act] + off_place)[:, None].expand(-1, chosen.shape[1], -1)  # (A, R, 2)
    wrong = wrong_places(best, batch.place[act], network.cell_size, noise.wrong).repeat_interleave(WRONG_TURNS, dim=1)
    turns = (noise.elsewhere * k).long()  # (A, WRONG_PLACES * WRONG_TURNS)
    angles = bin_angles(k, images.device)[torch.cat((chosen, turns), dim=1)]
    places = torch.cat((right, wrong), dim=1)
    cells = None
    if config.stretch_sigma or config.bend_sigma_px:
        cells = _distorted_cells(network.config.crop_pixels, noise, config)
    placings = Placings(batch.pick[act] + off_pick, yaw, places, angles, cells)
    logits = network.score_fits(images, goal, placings).float()
    stands_for = _shares_of_rotations(chosen.shape[1], k).to(images.device)  # (R + WRONG_PLACES * WRONG_TURNS,)
    target = bins.gather(1, chosen) * stands_for[: chosen.shape[1]]
    at_right = (target / target.sum(1, keepdim=True) * logits[:, : chosen.shape[1]]).sum(1)
    return (logits + stands_for.log()).logsumexp(1) - at_right


def _shares_of_rotations(drawn: int, k: int) -> Tensor:
    """Return how many of a place's k rotations each of the aligner's logits stands for.

    First those of the right place, the right rotation before the others where not all of them were drawn, then those
    of the wrong places.
    """
    at_right = torch.full((drawn,), (k - 1) / max(drawn - 1, 1))
    at_right[0] = 1.0
    return torch.cat((at_right, torch.full((WRONG_PLACES * WRONG_TURNS,), k / WRONG_TURNS)))


def _distorted_cells(side: int, noise: _SampleNoise, config: TrainConfig) -> Tensor:
    """Return the cells of crops (A, side, side, 2) as rotated_windows takes them, bent and stretched about the middle.

    Waves of some 0.5 to 2 a crop bend them; then they are stretched along two perpendicular axes, turned any way, and
    every other one is mirrored.
    """
    straight = straight_cells(side, noise.axis.device)
    across, way, phase = noise.waves.unbind(1)  # (A, BENDS) each
    rate, way = 2 * math.pi * (0.5 + 1.5 * across) / side, 2 * math.pi * way
    along = torch.stack((rate * torch.cos(way), rate * torch.sin(way)), dim=-1)  # (A, BENDS, 2)
    waves = torch.sin(torch.einsum("hwc,akc->akhw", straight, along) + 2 * math.pi * phase[..., None, None])
    waves = waves - torch.sin(2 * math.pi * phase)[..., None, None]  # the middle stays where it is
    bent = straight + config.bend_sigma_px * torch.einsum("akhw,akc->ahwc", waves, noise.bend)
    cos, sin = torch.cos(math.pi * noise.axis), torch.sin(math.pi * noise.axis)
    turn = torch.stack((torch.stack((cos, -sin), dim=1), torch.stack((sin, cos), dim=1)), dim=1)
    factors = torch.exp(config.stretch_sigma * noise.stretch)
    factors = torch.stack((factors[:, 0], factors[:, 1] * (1 - 2.0 * noise.mirrored)), dim=1)
    return torch.einsum("aij,ahwj->ahwi", turn @ torch.diag_embed(factors) @ turn.mT, bent)


def wrong_places(scores: Tensor, place: Tensor, cell: int, noise: Tensor) -> Tensor:
    """Draw places (A, n, 2) that are not near the right one, as often as their scores say: float pixels.

    scores: (A, h, w) logits of the cells. place: (A, 2) pixels. noise: (A, n) in 0..1.
    """
    rows, cols = _offsets(place, (scores.shape[1], scores.shape[2]), cell)
    near = rows[:, :, None].square() + cols[:, None, :].square() < (NEAR_PIXELS / cell) ** 2
    shares = scores.masked_fill(near, -math.inf).flatten(1).softmax(1).cumsum(1)
    index = torch.searchsorted(shares, noise * shares[:, -1:], right=True).clamp_max(shares.shape[1] - 1)
    at = torch.stack((index // scores.shape[2], index % scores.shape[2]), dim=-1)
    return cell * at.to(place.dtype) + (cell - 1) / 2


def _cells(pixels: Tensor, size: tuple[int, int], cell: int, config: TrainConfig) -> Tensor:
    return soft_cells(pixels, size, cell) if config.targets == "soft" else cell_label(pixels, size, cell)


def soft_cells(pixels: Tensor, size: tuple[int, int], cell: int = 2) -> Tensor:
    """Return a narrow Gaussian around each float (row, col) pixel on the grid of cells: (B, h, w), sums to 1.

    It is 0 everywhere for a pixel far outside, such as the meaningless ones of a finished scene.
    """
    rows, cols = _offsets(pixels, size, cell)
    weight = torch.exp(-(rows[:, :, None].square() + cols[:, None, :].square()) / (2 * CELL_SIGMA**2))
    return weight / weight.sum((1, 2), keepdim=True).clamp_min(1e-20)


def cell_label(pixels: Tensor, size: tuple[int, int], cell: int = 2) -> Tensor:
    """Return 1 in the one cell that holds each pixel, otherwise 0: (B, h, w)."""
    rows, cols = _offsets(torch.round(pixels), size, cell)
    return ((rows.abs() < 0.5)[:, :, None] & (cols.abs() < 0.5)[:, None, :]).float()


def _offsets(pixels: Tensor, size: tuple[int, int], cell: int) -> tuple[Tensor, Tensor]:
    """Return each cell's distance in cells from the pixel: rows (B, h), columns (B, w)."""
    cells = (pixels - (cell - 1) / 2) / cell
    rows, cols = (torch.arange(n, device=pixels.device)[None] for n in size)
    return rows - cells[:, 0, None], cols - cells[:, 1, None]


def yaw_target(yaw: Tensor, period: Tensor, n_rotations: int) -> Tensor:
    """Return a soft target over the rotation bins, (B, k), that sums to 1.

    Every bin that shows the object the same way is right. A parallel gripper looks the same after half a turn, so the
    period is at most pi.
    """
    period = torch.clamp(period, max=math.pi)[:, None]
    angles = bin_angles(n_rotations, yaw.device)[None]
    error = torch.remainder(angles - yaw[:, None] + period / 2, period) - period / 2
    weight = torch.exp(-error.square() / (2 * YAW_SIGMA**2))
    return weight / weight.sum(1, keepdim=True)


def yaw_label(yaw: Tensor, period: Tensor, n_rotations: int) -> Tensor:
    """Return 1 in the one bin nearest to the least of the right yaws, otherwise 0: (B, k)."""
    least = torch.remainder(yaw, torch.clamp(period, max=math.pi))
    return F.one_hot(torch.round(least / (2 * math.pi / n_rotations)).long() % n_rotations, n_rotations).float()


def turn_target(rotation: Tensor, n_rotations: int) -> Tensor:
    """Return a soft target over the rotation bins, (B, k), that sums to 1, of rotations (B,) from pick to place."""
    error = bin_angles(n_rotations, rotation.device)[None] - rotation[:, None]
    error = torch.remainder(error + math.pi, 2 * math.pi) - math.pi
    return torch.softmax(-error.square() / (2 * YAW_SIGMA**2), dim=1)


def soft_cross_entropy(logits: Tensor, target: Tensor) -> Tensor:
    """Return the cross-entropy (B,) of logits (B, N) against a distribution (B, N)."""
    return logits.logsumexp(1) * target.sum(1) - (target * logits).sum(1)


def _draw_competitors(right: Tensor, noise: Tensor, size: int) -> tuple[Tensor, Tensor]:
    """Draw the bins that compete in a softmax: (A, size), the right one first and others in random order.

    All k bins in their own order compete if size is 0 or at least k. The second value is the right one's place: (A,).
    right: (A,) bins. noise: (A, k) in 0..1.
    """
    k = noise.shape[1]
    if not 0 < size < k:
        return torch.arange(k, device=right.device).expand(len(right), -1), right
    noise = noise.scatter(1, right[:, None], 2.0)
    return noise.topk(size, dim=1).indices, torch.zeros_like(right)
