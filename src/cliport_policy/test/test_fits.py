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


def test_the_likeliest_pairs_are_looked_at_beside_their_places_and_from_four_sides() -> None:
    """A network that errs by the side it looks from, of a thing that fits 5 mm beside its place, is right at last."""
    grid, yaw, quarter = CellGrid(WORKSPACE, 2), 0.3, math.pi / 2
    mass = two_bowls().repeat(4, axis=0)[:10]  # ten rotations
    places, candidates = torch.from_numpy(mass / mass.sum()).log(), grid.peaks(mass / mass.sum(), 2, 0.02)
    middles = torch.tensor([peak.pixel for peak in candidates], dtype=torch.float32)
    network, asked = small_joint_network(), list[Placings]()

    def score_fits(images: Tensor, goal: object, placings: Placings) -> Tensor:
        asked.append(placings)
        side = round(math.remainder(float(placings.yaw) - yaw, 2 * math.pi) / quarter) % 4
        rotation = (placings.angles[0] / (2 * math.pi / 10)).round().long()
        offset = placings.places[0, :, None] - middles  # (R, 2, 2)
        first = offset[:, 0].abs().amax(1) < 3
        fits = 3.0 * (first & (rotation == 4)) + 4.0 * (first & (rotation == 7))  # where they are taken to be
        fits += 3.0 * (first & (rotation == 4) & (offset[:, 0] == torch.tensor([2.0, -2.0])).all(1))  # 5 mm beside
        wrong = torch.tensor([3.0, 3.0, -3.0, -3.0])[side] * (rotation == 7)
        return (fits + wrong + 10 * side)[None]  # how much a look says in all counts for nothing

    network.score_fits = score_fits  # type: ignore[assignment,method-assign]
    pick = torch.tensor([[9.0, 10.0]])
    found = seen_fits(network, torch.zeros(1, 5, 8, 8), Goal(), pick, torch.tensor([yaw]), candidates, places)
    assert [one.places.shape[1] for one in asked] == [20, 8 * 9, 8, 8, 8] and found.shape == (2, 10)
    sides = [round(math.remainder(float(one.yaw) - yaw, 2 * math.pi) / quarter) % 4 for one in asked]
    assert sides == [0, 1, 0, 2, 3] and all(torch.equal(one.pick, pick) for one in asked)
    assert torch.equal(asked[0].angles[0], bin_angles(10).repeat(2))
    assert torch.equal(asked[0].places[0], middles.repeat_interleave(10, 0))
    assert found[0].topk(2).indices.tolist() == [4, 7]
    assert float(found[0, 4] - found[0, 7]) == pytest.approx(2.0, abs=1e-5)
    others = found.flatten()[[index for index in range(20) if index not in (4, 7)]]
    assert float(others.max()) < float(found[0, 7]) - 1.0, "what one look alone found counts for less"
