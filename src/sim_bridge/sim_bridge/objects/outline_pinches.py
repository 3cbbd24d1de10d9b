"""Pinches of an upright prism, from its outline."""

from __future__ import annotations

import math

import numpy as np

from sim_bridge.objects.block import WIDEST_PINCH
from sim_bridge.objects.outline import FloatArray, Outline
from sim_bridge.objects.shape import Pinch
from sim_bridge.robot import HAND

_POINT_SPACING = 0.00025  # of the points on the outline [m]
_N_ANGLES = 180  # that are tried, over half a turn
_NEIGHBOURS = 5  # angles on either side at which a good one must not be narrower
_WIDTH_TOLERANCE = 0.0002  # widths that differ less count as the same [m]
_JAW_MARGIN = 0.002  # uncertainty of each edge of a jaw [m]
_MAX_SLOPE = 0.0022  # of a contact over that uncertainty [m]
_MIN_YAW_DIFFERENCE = math.radians(25.0)  # at least, between two pinches


def outline_pinches(outline: Outline) -> tuple[Pinch, ...]:
    """Return pinches over the area's centroid, narrowest first, at least 25 degrees apart.

    The width is that of what the jaws meet, a strip as wide as they are. Only angles where it is smallest among those
    beside it: a thing squeezed elsewhere turns. And none where jaws a little wider or narrower would meet something
    else: there they slide along a slope or get stuck in a notch.
    """
    centroid = outline.centroid
    points = _points_along(outline.corners) - centroid
    yaws = np.arange(_N_ANGLES) * (math.pi / _N_ANGLES)
    ends = np.array([_ends(points, yaw, HAND.finger_width) for yaw in yaws])  # (angles, 2) along the closing direction
    widths = np.ptp(ends, axis=1)
    beside = [np.roll(widths, shift) for shift in range(-_NEIGHBOURS, _NEIGHBOURS + 1)]
    good = widths <= np.min(beside, axis=0) + _WIDTH_TOLERANCE
    good &= widths <= WIDEST_PINCH
    good &= [_slope(points, yaw) < _MAX_SLOPE for yaw in yaws]
    found: list[Pinch] = []
    for i in sorted(np.flatnonzero(good), key=lambda i: (round(widths[i] / _WIDTH_TOLERANCE), i)):
        yaw, middle = float(yaws[i]), float(ends[i].mean())
        if all(abs(math.remainder(yaw - other.yaw, math.pi)) > _MIN_YAW_DIFFERENCE - 1e-6 for other in found):
            x, y = centroid + middle * np.array([math.cos(yaw), math.sin(yaw)])
            found.append(Pinch(float(x), float(y), yaw, float(widths[i])))
    return tuple(found)


def _slope(points: FloatArray, yaw: float) -> float:
    """Return how much farther out jaws meet a side when they are wider than when they are narrower [m]."""
    wide, narrow = (_ends(points, yaw, HAND.finger_width + margin) for margin in (2 * _JAW_MARGIN, -2 * _JAW_MARGIN))
    return max(narrow[0] - wide[0], wide[1] - narrow[1])


def _points_along(ring: FloatArray) -> FloatArray:
    """Return (N, 2) dense points on a closed polygon [m]."""
    pieces = []
    for start, end in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        share = np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(end - start) / _POINT_SPACING))[:, None]
        pieces.append(start + share * (end - start))
    return np.concatenate(pieces)


def _ends(points: FloatArray, yaw: float, jaw: float) -> tuple[float, float]:
    """Return the places along `yaw` at which jaws `jaw` wide that close about the origin meet points (N, 2) [m]."""
    c, s = math.cos(yaw), math.sin(yaw)
    along = points @ (c, s)
    met = along[np.abs(points @ (-s, c)) <= jaw / 2]
    return float(met.min()), float(met.max())
