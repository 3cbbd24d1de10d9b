"""Tools with handles; lengths in millimetres (see primitives)."""

from __future__ import annotations

from sim_bridge.colors import Rgb
from sim_bridge.everyday.paints import BLACK, GREY, SILVER, SKY, WHITE, WOOD, YELLOW
from sim_bridge.everyday.primitives import Ball, Parts, Prism, Rod, Turned, arc, bent, block, round_outline, rounded


def flashlight(body: Rgb, rim: Rgb) -> Parts:
    """Return a torch: a bar with a switch, a wider head and a bright lens."""
    bar = ((19, -74, BLACK), (20, -62, body), (20, 22, body), (33, 46, rim), (34, 62, rim))
    lens = Turned(((28, 60, (255, 244, 170)), (26, 64, (255, 244, 170))), solid=False, turn=(0, 90, 0))
    rings = [Turned(((20.8, z, BLACK), (20.8, z + 5, BLACK)), solid=False, turn=(0, 90, 0)) for z in (-50, -38, 8)]
    switches = [
        block(YELLOW, (20, 10, 43), (-12, 0, 0), 3, solid=False),
        block(YELLOW, (20, 43, 10), (-12, 0, 0), 3, solid=False),
    ]
    return Turned(bar, cuts=(22,), turn=(0, 90, 0)), lens, *rings, *switches


def scissors(grips: Rgb) -> Parts:
    """Return two ring grips and two crossed blades."""
    rings = [bent(grips, arc((-46, s * 20, 0), 16, 0, 360, "xy", 12), 7.5) for s in (-1, 1)]
    blades = [
        Prism(SILVER, ((-34, -7), (0, -9), (84, -1), (84, 2), (-34, 7)), 12, at=(2, 0, s * 1.5), turn=(0, 0, s * 9))
        for s in (-1, 1)
    ]
    return *(rod for ring in rings for rod in ring), *blades, Rod(GREY, (2, 0, -9), (2, 0, 9), 6, solid=False)


def magnifying_glass(rim: Rgb, grip: Rgb) -> Parts:
    """Return a lens in a rim, with a handle."""
    lens = Prism(SKY, round_outline(28, 28), 8)
    glint = Prism(WHITE, ((-14, 4), (2, 16), (6, 12), (-10, 0)), 8.8, solid=False)
    shaft = (Rod(SILVER, (-30, 0, 0), (-46, 0, 0), 7), Rod(grip, (-44, 0, 0), (-108, 0, 0), 12, 13))
    return lens, glint, *bent(rim, arc((0, 0, 0), 30, 0, 360, "xy", 14), 9), *shaft


def hammer(grip: Rgb) -> Parts:
    """Return a wooden handle with a grip, and a steel head with a face and a claw."""
    claw = Prism(SILVER, ((-13, 12), (13, 12), (9, 46), (3, 46)), 24, at=(58, 0, 0))
    return (
        Rod(WOOD, (-40, 0, 0), (50, 0, 0), 11),
        Rod(grip, (-92, 0, 0), (-36, 0, 0), 14, 13),
        block(GREY, (28, 34, 30), (58, 0, 0), 3),
        Rod(SILVER, (58, -14, 0), (58, -34, 0), 16, 18),
        claw,
    )


def screwdriver(grip: Rgb, end: Rgb) -> Parts:
    """Return a ridged grip and a steel blade."""
    rings = (
        (12, -76, end),
        (17, -70, end),
        (18, -52, grip),
        (15, -44, grip),
        (18, -38, grip),
        (18, -8, grip),
        (11, 0, grip),
    )
    ridges = [
        Prism(end, ((-44, -2), (-10, -2), (-10, 2), (-44, 2)), 37.5, turn=(a, 0, 0), solid=False) for a in (0, 60, 120)
    ]
    return (
        Turned(rings, turn=(0, 90, 0)),
        *ridges,
        Rod(SILVER, (-1, 0, 0), (66, 0, 0), 6.5),
        Prism(SILVER, ((64, -6), (84, -10), (84, 10), (64, 6)), 8),
    )


def spatula(head: Rgb, grip: Rgb) -> Parts:
    """Return a turner: a slotted head on a long handle."""
    slots = [block((52, 30, 66), (36, 6, 15), (52, y, -2), 2, solid=False) for y in (-15, 0, 15)]
    return (
        Prism(head, ((24, -22), (80, -29), (84, -26), (84, 26), (80, 29), (24, 22)), 14, at=(0, 0, -2)),
        *slots,
        Rod(SILVER, (28, 0, 0), (-6, 0, 8), 7),
        Rod(grip, (-4, 0, 8), (-84, 0, 10), 11, 12),
        Ball(SILVER, (5, 5, 12.5), at=(-74, 0, 10), solid=False),
    )


def toothbrush(body: Rgb, bristles: Rgb, middle: Rgb) -> Parts:
    """Return a thick handle, a thin neck and bristles in three tufts."""
    tufts = [block(paint, (12, 17, 20), (x, 0, 12), 2) for paint, x in ((bristles, 50), (middle, 63), (bristles, 76))]
    return (
        Rod(body, (-84, 0, 0), (10, 0, 0), 13, 11),
        Ball(body, (13, 13, 13), at=(-84, 0, 0)),
        Rod(body, (9, 0, 0), (44, 0, 0), 10, 8),
        Prism(body, rounded(24, 11, 9), 12, at=(62, 0, -3)),
        *tufts,
        block(WHITE, (50, 9, 26), (-40, 0, 0), 3, solid=False),
    )


def honey_dipper() -> Parts:
    """Return a wooden stick with a ridged end."""
    rings = [
        (r, 34.0 + 8 * i, WOOD if i % 2 else (150, 106, 60)) for i, r in enumerate((20, 25, 17, 27, 17, 27, 17, 24, 16))
    ]
    return (
        Turned([(z_r, z, c) for z_r, z, c in rings], turn=(0, 90, 0), cuts=(66,)),
        Rod(WOOD, (-66, 0, 0), (36, 0, 0), 9),
        Ball(WOOD, (13, 13, 13), at=(-68, 0, 0)),
    )
