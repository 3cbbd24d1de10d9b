"""Shoes and hats; lengths in millimetres (see primitives)."""

from __future__ import annotations

from collections.abc import Sequence

from sim_bridge.colors import Rgb
from sim_bridge.everyday.primitives import Ball, Parts, Primitive, Prism, Rod, Turned, block, rounded

_HALF = 27.0  # of a shoe's width


def shoe(
    upper: Rgb,
    sole: Rgb,
    stripes: Rgb,
    laces: Rgb,
    toe: Rgb | None = None,
    studs: Rgb | None = None,
    inside: Rgb = (70, 66, 64),
) -> Parts:
    """Return a low shoe with three slanting stripes on both sides; with studs it is for the lawn."""
    side = ((-70, -18), (62, -18), (66, 0), (40, 8), (4, 26), (-24, 30), (-72, 34))
    body = Prism(upper, side, 2 * _HALF - 4, turn=(90, 0, 0), pieces=((0, 1, 2, 3), (0, 3, 4, 5, 6)))
    cap = Ball(toe or upper, (26, _HALF - 1, 19), at=(52, 0, -12))
    heel = Ball(upper, (16, _HALF - 2, 26), at=(-60, 0, 8), solid=False)
    bands = [
        Prism(
            stripes,
            ((x - 8, -17), (x + 2, -17), (x + 14, 22), (x + 4, 22)),
            2 * _HALF - 2.5,
            turn=(90, 0, 0),
            solid=False,
        )
        for x in (-38, -18, 2)
    ]
    ties = [
        Rod(laces, (x, -15, z), (x, 15, z), 3, solid=False) for x, z in ((12, 23.5), (22, 18.5), (32, 13.5), (42, 9))
    ]
    spikes = [Rod(studs, (x, y, -30), (x, y, -42), 6, 4) for x in (-58, 10, 48) for y in (-15, 15)] if studs else []
    return (
        body,
        cap,
        heel,
        *bands,
        *ties,
        Ball(inside, (25, 18, 4), at=(-46, 0, 33), solid=False),
        Prism(sole, rounded(75, _HALF, 24), 15, at=(2, 0, -24)),
        *spikes,
    )


def boot(leather: Rgb, sole: Rgb, laces: Rgb) -> Parts:
    """Return a boot with a high shaft and laces up its front."""
    side = ((-64, -44), (54, -44), (60, -22), (34, -12), (-4, 10), (-8, 54), (-66, 54))
    body = Prism(leather, side, 2 * _HALF - 4, turn=(90, 0, 0), pieces=((0, 1, 2, 3), (0, 3, 4), (0, 4, 5, 6)))
    heights = (-6, 4, 16, 28, 40)
    ties = [Rod(laces, (_front(z) + 2, -14, z), (_front(z) + 2, 14, z), 3.4, solid=False) for z in heights]
    return (
        body,
        Ball(leather, (26, _HALF - 1, 22), at=(46, 0, -34)),
        *ties,
        Turned(((24, -6, leather), (24, 6, leather)), at=(-37, 0, 52), oval=1.1, hollow=(20, 9)),
        block(laces, (60, 2 * _HALF - 2, 8), (-37, 0, 44), solid=False),
        Prism(sole, rounded(71, _HALF, 24), 14, at=(0, 0, -50)),
        block(sole, (38, 2 * _HALF - 4, 10), (-48, 0, -61), 6),
    )


def _front(z: float) -> float:
    """Return where a boot's front is at that height."""
    return 18.0 - 1.6 * (z + 4.0) if z < 10.0 else -5.0 - (z - 10.0) * 0.1


def flip_flop(sole: Rgb, strap: Rgb) -> Parts:
    """Return a sandal of a sole and two straps that meet between the toes."""
    outline: Sequence[tuple[float, float]] = (
        (-74, -14), (-64, -24), (-30, -25), (20, -31), (52, -29), (72, -16), (76, 2), (66, 22), (40, 30), (0, 27),
        (-40, 25), (-66, 23), (-74, 12),
    )  # fmt: skip
    straps: list[Primitive] = []
    for y in (-28, 27):
        straps += [Rod(strap, (38, 1, 12), (14, y * 0.55, 30), 6), Rod(strap, (14, y * 0.55, 30), (-8, y, 8), 6)]
    inner = Prism(strap, [(0.86 * x, 0.8 * y) for x, y in outline], 23, solid=False)
    return Prism(sole, outline, 22), inner, *straps, Ball(strap, (8, 8, 9), at=(38, 1, 12))


def hat(felt: Rgb, band: Rgb) -> Parts:
    """Return a hat with an oval brim, a dented crown and a ribbon."""
    crown = ((49, 0, band), (48, 15, felt), (45, 40, felt), (34, 48, felt))
    return (
        Turned(((66, -6, felt), (70, -3, felt), (70, 2, felt)), oval=0.56),
        Turned(crown, oval=0.56),
        Ball(tuple(round(0.8 * c) for c in felt), (30, 9, 4), at=(0, 0, 47), solid=False),  # type: ignore[arg-type]
        Ball(band, (6, 3, 11), at=(8, -27.5, 9), solid=False),
    )
