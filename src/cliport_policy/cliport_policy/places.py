"""Choice among the places that a network finds likely: by the side that a sentence names, by prints and by fits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from cliport_policy.fits import CLEAR, seen_fits, share_of_prints, shares_of, with_fits, with_prints
from cliport_policy.networks.policy_network import Goal, PolicyNetwork
from cliport_policy.networks.rotation import bin_angles
from cliport_policy.peaks import CellGrid, Peak, mass_of
from cliport_policy.shapes.prints import Pixel, Print, covered_at, outline_at, prints_at
from cliport_policy.sides import Side, at_own_side, at_side
from cliport_policy.turns import likeliest_turn, split_over

_MOST_ALIKE = 6  # places among which a side may be named,
_ALIKE = 0.15  # and how likely they are at least, relative to the likeliest
_HARDLY_ALIKE = 0.02  # the same where the side is one of a thing's own
_OUT = 30.0  # logits that put a place out
_CANDIDATES = 3  # places at most that an aligner is asked about,
_LEAST_SHARE = 0.05  # and after the first only those that are as likely as this
_PRINTS = 6  # places at most where prints of what is picked are looked for,
_LEAST_PRINT = 0.003  # and after the first only those that are as likely as this


class Printed(NamedTuple):
    """Action for a thing that belongs on a print.

    pick: midway between the jaws, so that it does not matter whether a hand takes a thing where it is picked or centres
    it between its jaws. yaws: (1, k) logits of jaws that are square with it; None without a rotator. places:
    (1, k, h, w) logits.
    """

    pick: Peak
    yaws: Tensor | None
    places: Tensor


class Places:
    """Places of one network on the grid of its cells; their logits are (1, k, h, w), of k rotations."""

    def __init__(self, network: PolicyNetwork, grid: CellGrid, fits_prints: bool) -> None:
        """fits_prints: whether prints are looked for."""
        self._network, self._grid, self._fits_prints = network, grid, fits_prints

    def at_side(self, side: Side, places: Tensor) -> Tensor:
        """Return the logits, with all but the one at a side of those that are alike put out."""
        alike = self._alike(places[0].float(), _ALIKE)
        found = at_side(side, [peak.pixel for peak in alike])
        if found is None:
            return places
        chosen = alike[found]
        return places - _OUT * torch.from_numpy(~chosen.near)

    def at_own_side(self, side: Side, front: Tensor, back: Tensor, places: Tensor) -> Tensor:
        """Return logits (k, h, w), with all but the likeliest at a thing's own side put out.

        front, back: (k, h, w), what is said of the same thing's front and back. Where no likely place lies there, all
        stay as they are.
        """
        likely = self._alike(places, _HARDLY_ALIKE)
        points = [
            [self._grid.workspace.pixel_to_xy(*peak.pixel) for peak in peaks]
            for peaks in (self._alike(front, _ALIKE), self._alike(back, _ALIKE), likely)
        ]
        found = at_own_side(side, *points)
        return places - _OUT * torch.from_numpy(~likely[found[0]].near) if found else places

    def on_prints(
        self, image: Tensor, pick: Peak, yaws: Tensor | None, places: Tensor, side: Side | None
    ) -> Printed | None:
        """Return what to do with a thing that belongs on a print; None without a print.

        What may be meant to be moved or turned where it lies hides what is under it, most of all where it lies well:
        then there is none, either, unless enough of a print is seen beside it.
        """
        if not self._fits_prints:
            return None
        logits, angles, pixel_size = places[0].float(), bin_angles(places.shape[1]), self._grid.workspace.pixel_size
        outline = outline_at(image, pick.pixel, _yaw(yaws), pixel_size)
        if outline is None:
            return None
        candidates = self._grid.peaks(mass_of(logits), _PRINTS, _LEAST_PRINT)
        shares, here = shares_of(logits, candidates), self._grid.cell_of(pick.pixel)
        least = float(shares.max()) + math.log(_ALIKE)
        own = [i for i, peak in enumerate(candidates) if peak.near[here] and shares[i] >= least]
        prints = prints_at(image, outline, [peak.pixel for peak in candidates], angles, pixel_size)
        dealt = share_of_prints(shares, prints)
        if dealt is None or any(prints[i].contrast < CLEAR for i in own):
            return None
        row, col = np.rint(outline.held + pick.pixel).astype(int).tolist()
        if side is not None:
            clearest = max(prints, key=lambda one: one.contrast)
            taken = covered_at(image, outline, pick.pixel, clearest, pixel_size) if side is Side.MIDDLE else []
            dealt = _at_side(side, prints, dealt, taken)
        return Printed(
            pick._replace(pixel=(row, col)),
            None if yaws is None else _logits_of(outline.yaw, yaws.shape[1]),
            with_prints(logits, prints, dealt, self._grid.cell_size)[None],
        )

    def with_fits(self, image: Tensor, goal: Goal, pick: Tensor, yaws: Tensor | None, places: Tensor) -> Tensor:
        """Return the logits, with what an aligner thinks of the likeliest places. pick: (1, 2) float pixel."""
        candidates = self._grid.peaks(mass_of(places[0].float()), _CANDIDATES, _LEAST_SHARE)
        yaw = torch.tensor([_yaw(yaws)])
        fits = seen_fits(self._network, image, goal, pick, yaw, candidates, places[0].float())
        return with_fits(places[0].float(), candidates, fits)[None]

    def _alike(self, places: Tensor, least: float) -> list[Peak]:
        """Return the places with logits (k, h, w) that are likely, relative to the likeliest, which comes first."""
        mass = mass_of(places)
        peaks = self._grid.peaks(mass, _MOST_ALIKE, 0.01)
        shares = [peak.confidence(mass.sum(0)) for peak in peaks]
        return [peak for peak, share in zip(peaks, shares, strict=True) if share >= least * max(shares)]


def _at_side(side: Side, prints: Sequence[Print], shares: Tensor, taken: Sequence[Pixel]) -> Tensor:
    """Return the logarithms of the shares (n,) of n prints, with all but the one at a side of those alike put out."""
    alike = (shares >= shares.max() + math.log(_ALIKE)).nonzero()[:, 0].tolist()
    found = at_side(side, [prints[index].centre for index in alike], taken)
    return shares if found is None else shares - _OUT * (torch.arange(len(shares)) != alike[found])


def _logits_of(turn: float, n_rotations: int) -> Tensor:
    """Return the logits (1, k) of a turn [rad]."""
    logits = torch.full((1, n_rotations), -_OUT)
    for rotation, share in split_over(turn, n_rotations):
        logits[0, rotation] = math.log(max(share, math.exp(-_OUT)))
    return logits


def _yaw(yaws: Tensor | None) -> float:
    """Return the angle [rad] that a rotator's logits (1, k) mean, 0 without a rotator."""
    return 0.0 if yaws is None else likeliest_turn(mass_of(yaws[0].float()))
