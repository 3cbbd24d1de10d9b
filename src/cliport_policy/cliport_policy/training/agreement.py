"""Agreement of a network with the expert in held-out demonstrations."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import torch

from cliport_policy.config import TrainConfig
from cliport_policy.data.batches import Phrasebook, collate, make_sample
from cliport_policy.data.mixture import Mixture
from cliport_policy.networks.policy_network import PolicyNetwork
from cliport_policy.peaks import CONFIDENCE_RADIUS

AGREE_YAW = math.radians(10)


@dataclass(frozen=True)
class Agreement:
    """Shares of held-out demonstrations in which the policy agrees: 3 cm for positions, 10 degrees for yaw.

    pick is a lower bound: if several objects would do, another choice than the expert's counts as wrong.
    """

    pick: float
    yaw: float
    place: float
    done: float
    n: int

    def shares(self) -> dict[str, float]:
        """Return the shares by name."""
        return {"pick": self.pick, "yaw": self.yaw, "place": self.place, "done": self.done}


@torch.inference_mode()
def agreement(network: PolicyNetwork, data: Mixture, indices: Iterable[int]) -> Agreement:
    """Compare a network with demonstrations, in their canonical wording and without augmentation."""
    network.eval()
    rng = np.random.default_rng(0)
    plain = TrainConfig(augment_probability=0.0, jitter=False)
    phrasebook = Phrasebook(dict.fromkeys(data.instructions(), 0), rng)
    device = next(network.parameters()).device
    cell, radius = network.cell_size, CONFIDENCE_RADIUS / data.workspace.pixel_size
    hits = {"pick": [0, 0], "yaw": [0, 0], "place": [0, 0], "done": [0, 0]}
    n = 0
    for index in indices:
        n += 1
        demo = data[index].demo
        batch = collate([make_sample(data[index], phrasebook, None, plain, rng)]).to(device)
        goal = network.look(batch.images, network.encode_goal(batch.phrases, batch.goal_images))
        logits = network.score_picks(batch.images, goal)[0]
        _tally(hits["done"], (float(logits.softmax(0)[-network.n_null]) > 0.5) == demo.done)
        if demo.done:
            continue
        cols = batch.images.shape[-1] // cell
        best = int(logits[: -network.n_null].argmax())
        _tally(hits["pick"], _within((cell * (best // cols), cell * (best % cols)), demo.pick_pixel, radius))
        yaws, places = network.score_rotations(batch.images, goal, batch.pick)
        yaw = 0.0 if yaws is None else int(yaws[0].argmax()) * 2 * math.pi / network.config.n_rotations
        period = min(demo.pick_yaw_period, math.pi)
        _tally(hits["yaw"], abs(math.remainder(yaw - demo.pick_yaw, period)) < AGREE_YAW)
        best = int(places[0].max(0).values.argmax())
        _tally(hits["place"], _within((cell * (best // cols), cell * (best % cols)), demo.place_pixel, radius))
    share = {name: right / max(total, 1) for name, (right, total) in hits.items()}
    return Agreement(share["pick"], share["yaw"], share["place"], share["done"], n)


def _tally(tally: list[int], right: bool) -> None:
    tally[0] += int(right)
    tally[1] += 1


def _within(a: tuple[int, int], b: tuple[int, int], radius: float) -> bool:
    return math.hypot(a[0] - b[0], a[1] - b[1]) < radius
