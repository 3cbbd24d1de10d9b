"""Outlines of the kitting letters: bold capitals in the middle of their bounding boxes; sizes in mm, x by y.

See docs/benchmark.md, "Kitting shapes".
"""

from __future__ import annotations

from sim_bridge.objects.outline import Outline, arc


def letter_r() -> Outline:
    """Return an R, 40.5 x 56.7: a stem, a bowl with a counter, and a leg."""
    stem_and_leg = [(-8.25, -28.35), (-8.25, -5.0), (-3.0, -5.0), (7.0, -28.35), (20.25, -28.35), (9.0, -1.2)]
    bowl = arc((2.0, 13.15), (16.25, 15.2), -45.0, 112.5, 7)
    counter = [(-8.25, 18.65), (-8.25, 5.65), *arc((0.5, 12.15), (5.75, 6.5), -90.0, 120.0, 7)]
    return Outline.from_mm([*stem_and_leg, *bowl, (-20.25, 28.35), (-20.25, -28.35)], [counter])


def letter_a() -> Outline:
    """Return an A, 49.9 x 57.0: two legs, a tip cut off and a counter."""
    left = [(-4.6, 28.5), (-24.95, -28.5), (-12.2, -28.5), (-8.9, -18.0)]
    counter = [(-5.6, -7.5), (5.6, -7.5), (0.0, 11.5)]
    return Outline.from_mm([*left, *((-x, y) for x, y in reversed(left))], [counter])


def letter_t() -> Outline:
    """Return a T, 60 x 60, its bars 18 wide, its top towards +x."""
    return Outline.from_mm([(-30, -9), (12, -9), (12, -30), (30, -30), (30, 30), (12, 30), (12, 9), (-30, 9)])


def letter_g() -> Outline:
    """Return a G, 45.4 x 58.2: a bow, open to the right, that ends in a bar."""
    outer = arc((0.5, 0.0), (23.2, 29.1), 40.0, 318.0, 24)
    bar = [(22.7, -18.5), (22.7, 3.5), (3.0, 3.5), (3.0, -7.0), (10.7, -7.0)]
    inner = arc((0.5, 0.0), (11.0, 17.6), 312.0, 20.0, 14)
    return Outline.from_mm([*outer, *bar, *inner])


def letter_v() -> Outline:
    """Return a V, 47.0 x 56.7."""
    left = [(-5.1, -28.35), (-23.5, 28.35), (-10.6, 28.35)]
    return Outline.from_mm([*left, (0.0, -10.5), *((-x, y) for x, y in reversed(left))])


def letter_e() -> Outline:
    """Return an E, 32.0 x 56.7: a spine and three arms, the middle one shorter."""
    upper = [(15.0, 5.5), (-4.2, 5.5), (-4.2, 17.35), (16.0, 17.35), (16.0, 28.35), (-16.0, 28.35)]
    return Outline.from_mm([*upper, *((x, -y) for x, y in reversed(upper))])


def letter_l() -> Outline:
    """Return an L, 60 x 60, its bars 18 wide."""
    return Outline.from_mm([(-30, -30), (30, -30), (30, -12), (-12, -12), (-12, 30), (-30, 30)])


def letter_m() -> Outline:
    """Return an M, 54.0 x 56.7."""
    left = [(-11.0, 28.35), (-27.0, 28.35), (-27.0, -28.35), (-15.6, -28.35), (-15.6, 14.0), (-4.6, -24.0)]
    return Outline.from_mm([(0.0, -7.0), *left, *((-x, y) for x, y in reversed(left))])
