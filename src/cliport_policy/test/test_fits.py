"""What an aligner says of the likeliest places, and what becomes of their shares."""

import math

import numpy as np
import pytest
import torch
from distributions import two_bowls
from joint_networks import small_joint_network
from torch import Tensor

from cliport_core.workspace import WorkspaceSpec
from cliport_policy.fits import seen_fits, with_fits
from cliport_policy.networks.policy_network import Goal, Placings
from cliport_policy.networks.rotation import bin_angles
from cliport_policy.peaks import CellGrid, best_rotation

WORKSPACE = WorkspaceSpec()


def test_what_fits_better_takes_a_share_and_rotations_are_as_they_fit() -> None:
    grid, mass = CellGrid(WORKSPACE, 2), two_bowls()
    places, candidates = torch.from_numpy(mass).log(), grid.peaks(mass, 2, 0.02)
    was = [float(mass[:, peak.near].sum()) for peak in candidates]
    same = with_fits(places, candidates, torch.zeros(2, 3)).exp().numpy()
    assert [float(same[:, peak.near].sum()) for peak in candidates] == pytest.approx(was, rel=1e-4)
    assert same[:, 40, 20] == pytest.approx(np.full(3, mass[:, 40, 20].sum() / 3), rel=1e-4)
    fits = torch.tensor([[0.0, 0.0, 0.0], [4.0, 5.0, 4.0]])
    joint = with_fits(places, candidates, fits).exp().numpy()
    assert float(joint.sum()) == pytest.approx(1.0, rel=1e-4) and best_rotation(joint) == 1
    assert grid.cell_of(grid.peak(joint[1]).pixel) == (100, 60)
    odds = was[1] * float(fits[1].exp().sum()) / (was[0] * 3)
    now = [float(joint[:, peak.near].sum()) for peak in candidates]
    assert now[1] / now[0] == pytest.approx(odds, rel=1e-3) and sum(now) == pytest.approx(sum(was), rel=1e-4)
    assert joint[:, 100, 60] / joint[:, 100, 60].sum() == pytest.approx(fits[1].softmax(0).numpy(), rel=1e-4)
    assert joint[:, 41, 40] == pytest.approx(mass[:, 41, 40], rel=1e-4), "elsewhere nothing changes"


def test_the_likeliest_pairs_are_looked_at_from_four_sides() -> None:
    """A network that errs by the side it looks from is right on average."""
    grid, yaw = CellGrid(WORKSPACE, 2), 0.3
    mass = two_bowls().repeat(4, axis=0)[:10]  # ten rotations
    places, candidates = torch.from_numpy(mass / mass.sum()).log(), grid.peaks(mass / mass.sum(), 2, 0.02)
    right = torch.zeros(2, 10)
    right[0, 4], right[0, 7], right[1] = 6.0, 5.0, 1.0
    network, asked = small_joint_network(), list[Placings]()

    def score_fits(images: Tensor, goal: object, placings: Placings) -> Tensor:
        asked.append(placings)
        side = round(math.remainder(float(placings.yaw) - yaw, 2 * math.pi) / (math.pi / 2)) % 4
        rotation = (placings.angles[0] / (2 * math.pi / 10)).round().long()
        place = torch.tensor(
            [[peak.pixel for peak in candidates].index(tuple(map(int, at))) for at in placings.places[0]]
        )
        wrong = torch.tensor([3.0, -1.0, -1.0, -1.0])[side] * (rotation == 7)  # a first look takes it for the best
        return (right[place, rotation] + wrong + 10 * side)[None]  # how much a look says in all counts for nothing

    network.score_fits = score_fits  # type: ignore[assignment,method-assign]
    pick = torch.tensor([[9.0, 10.0]])
    found = seen_fits(network, torch.zeros(1, 5, 8, 8), Goal(), pick, torch.tensor([yaw]), candidates, places)
    assert [one.places.shape[1] for one in asked] == [20, 12, 12, 12] and found.shape == (2, 10)
    assert all(torch.equal(one.pick, pick) for one in asked)
    assert torch.equal(asked[0].angles[0], bin_angles(10).repeat(2))
    assert int(found[0].argmax()) == 4 and int(found[0].topk(2).indices[1]) == 7
    assert float(found[0, 4] - found[0, 7]) == pytest.approx(1.0, abs=1e-5)
    pairs = [
        (*map(int, at), round(float(turn), 4)) for at, turn in zip(asked[0].places[0], asked[0].angles[0], strict=True)
    ]
    again = {
        (*map(int, at), round(float(turn), 4)) for at, turn in zip(asked[1].places[0], asked[1].angles[0], strict=True)
    }
    once = [index for index, pair in enumerate(pairs) if pair not in again]
    assert len(once) == 8 and torch.equal(
        found.flatten()[once], right.flatten()[once] + 3.0 * (torch.tensor(once) % 10 == 7)
    )
