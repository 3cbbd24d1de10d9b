"""Vehicles, things with buttons, balls and crayons; lengths in millimetres (see primitives)."""

from __future__ import annotations

import math

from sim_bridge.colors import Rgb
from sim_bridge.everyday.paints import BLACK, BLUE, GOLD, GREEN, GREY, RED, SILVER, SKY, WHITE, YELLOW
from sim_bridge.everyday.primitives import (
    Ball,
    Parts,
    Prism,
    Rod,
    Turned,
    arc,
    bent,
    block,
    round_outline,
)


def alarm_clock(case: Rgb, bells: Rgb) -> Parts:
    """Return a round clock with two bells; its face is seen from both sides."""
    upright = (90, 0, 0)
    hands = (
        Rod(BLACK, (0, -24.3, 0), (0, -24.3, 24), 2.6, solid=False),
        Rod(BLACK, (0, -24.3, 0), (15, -24.3, -6), 2.6, solid=False),
        Rod(BLACK, (0, 24.3, 0), (0, 24.3, 24), 2.6, solid=False),
        Rod(BLACK, (0, 24.3, 0), (-15, 24.3, -6), 2.6, solid=False),
    )
    marks = [
        Ball(BLACK, (2.5, 24.6, 2.5), at=(27 * math.cos(a), 0, 27 * math.sin(a)), solid=False)
        for a in (math.pi / 6 * i for i in range(12))
    ]
    tops = [
        part
        for s in (-1, 1)
        for part in (
            Rod(GREY, (s * 18, 0, 30), (s * 25, 0, 46), 4),
            Turned(((17, -4, bells), (13, 8, bells), (5, 13, bells)), at=(s * 25, 0, 45), turn=(0, s * 30, 0)),
            Rod(case, (s * 22, 0, -30), (s * 30, 0, -50), 6),
        )
    ]
    return (
        Prism(case, round_outline(40, 40), 44, turn=upright),
        Prism(WHITE, round_outline(33, 33), 46.5, turn=upright, solid=False),
        *hands,
        *marks,
        *tops,
    )


def computer_mouse(shell: Rgb, trim: Rgb, wheel: Rgb) -> Parts:
    """Return a rounded shell with two buttons and a wheel."""
    rings = ((58, -18, trim), (62, -13, shell), (62, -6, shell), (55, 8, shell), (42, 17, shell), (22, 22, shell))
    seam = Ball(trim, (30, 1.6, 20), at=(26, 0, 4), solid=False)
    across = Ball(trim, (1.6, 30, 21.5), at=(2, 0, 3), solid=False)
    return Turned(rings, oval=0.58), seam, across, Rod(wheel, (30, -5, 17), (30, 5, 17), 9)


def camera() -> Parts:
    """Return a black camera with a silver top, a big lens, a flash and a red button."""
    lens = ((27, 0, BLACK), (27, 8, SILVER), (27, 12, BLACK), (25, 34, BLACK))
    glass = Turned(((19, 0, SKY), (12, 36, (30, 50, 110)), (5, 37, SKY)), at=(6, -22, -4), turn=(90, 0, 0), solid=False)
    return (
        block(BLACK, (116, 44, 68), (0, 0, 0), 6),
        block(SILVER, (117, 45, 16), (0, 0, 25), 6, solid=False),
        block(SILVER, (44, 38, 14), (6, 0, 40), 4),
        block(WHITE, (26, 2, 10), (6, -19.5, 41), solid=False),
        Turned(lens, at=(6, -20, -4), turn=(90, 0, 0)),
        glass,
        Rod(RED, (-42, 0, 34), (-42, 0, 42), 8),
        block(SKY, (56, 2, 36), (-8, 22, -6), solid=False),
    )


def game_controller(color: Rgb) -> Parts:
    """Return two grips, a cross, four buttons and two sticks."""
    both = [(-44, -1), (44, 1)]
    grips = [Rod(color, (x * 0.95, 8, 0), (x * 1.35, -32, -2), 19, 14) for x, _ in both]
    ends = [Ball(color, (14, 14, 14), at=(x * 1.36, -33, -2)) for x, _ in both]
    buttons = [
        Ball(paint, (5.5, 5.5, 5), at=(46 + dx, 14 + dy, 18), solid=False)
        for paint, dx, dy in ((RED, 10, 0), (GREEN, 0, -10), (BLUE, -10, 0), (YELLOW, 0, 10))
    ]
    sticks = [Turned(((6, 14, GREY), (10, 24, GREY)), at=(x, -10, 0)) for x in (-19, 19)]
    cross = (
        block(WHITE, (26, 8, 4), (-46, 14, 18.5), solid=False),
        block(WHITE, (8, 26, 4), (-46, 14, 18.5), solid=False),
    )
    return (
        block(color, (118, 46, 32), (0, 10, 0), 18),
        *grips,
        *ends,
        *buttons,
        *sticks,
        *cross,
        block(GREY, (120, 8, 10), (0, 32, 6), 3, solid=False),
        block(GREY, (60, 30, 33), (0, 10, -1.5), 6, solid=False),
    )


def cassette() -> Parts:
    """Return a cassette tape with a label and two reels, the same on both sides."""
    reels = [
        part
        for x in (-24, 24)
        for part in (
            Prism(WHITE, round_outline(11, 11), 29, at=(x, 2, 0), solid=False),
            Prism(BLACK, round_outline(5, 5), 30, at=(x, 2, 0), solid=False),
        )
    ]
    return (
        block((62, 64, 72), (118, 76, 25), (0, 0, 0), 4),
        block(WHITE, (102, 46, 26.4), (0, 9, 0), 4, solid=False),
        block(RED, (102, 8, 27), (0, 27, 0), solid=False),
        block(YELLOW, (102, 6, 27), (0, 20, 0), solid=False),
        block((62, 64, 72), (74, 24, 28), (0, 2, 0), 11, solid=False),
        Prism((92, 94, 100), ((-40, -37), (40, -37), (34, -22), (-34, -22)), 30),
        *reels,
    )


def school_bus() -> Parts:
    """Return a yellow bus with a bonnet, dark windows, black lines and four wheels."""
    glass = (46, 62, 84)
    windows = [block(glass, (17, 59.4, 17), (x, 0, 16), 0, solid=False) for x in (-54, -33, -12, 9)]
    wheels = [
        part
        for x in (-40, 42)
        for part in (
            Prism(BLACK, round_outline(15, 15, 16), 66, at=(x, 0, -28), turn=(90, 0, 0)),
            Prism(SILVER, round_outline(7, 7), 67, at=(x, 0, -28), turn=(90, 0, 0), solid=False),
        )
    ]
    return (
        block((246, 190, 20), (106, 58, 62), (-18, 0, 4)),
        block((246, 190, 20), (42, 54, 34), (55, 0, -10), 4),
        block(WHITE, (96, 48, 4), (-18, 0, 36), 6, solid=False),
        *windows,
        block(glass, (3, 46, 18), (35, 0, 18), solid=False),
        block(glass, (3, 42, 18), (-71, 0, 16), solid=False),
        block(BLACK, (107, 59, 3), (-18, 0, 2), solid=False),
        block(BLACK, (107, 59, 3), (-18, 0, -8), solid=False),
        block(GREY, (3, 40, 16), (76, 0, -12), solid=False),
        *(Ball(WHITE, (3, 6, 6), at=(76, y, -6), solid=False) for y in (-21, 21)),
        *wheels,
    )


def train() -> Parts:
    """Return a steam engine: green boiler, red cab and frame, chimney and wheels."""
    wheels = [
        part
        for x, r in ((-48, 19), (-4, 15), (36, 15))
        for part in (
            Prism(BLACK, round_outline(r, r, 16), 60, at=(x, 0, r - 46), turn=(90, 0, 0)),
            Prism(GOLD, round_outline(r * 0.5, r * 0.5), 61.5, at=(x, 0, r - 46), turn=(90, 0, 0), solid=False),
        )
    ]
    return (
        block(RED, (136, 50, 12), (0, 0, -20)),
        Rod(GREEN, (-30, 0, 6), (62, 0, 6), 24),
        Rod(BLACK, (61, 0, 6), (66, 0, 6), 18, 16),
        Turned(((24.8, -3, GOLD), (24.8, 3, GOLD)), at=(40, 0, 6), turn=(0, 90, 0), solid=False),
        Turned(((24.8, -3, GOLD), (24.8, 3, GOLD)), at=(0, 0, 6), turn=(0, 90, 0), solid=False),
        Turned(((9, 0, BLACK), (9, 18, BLACK), (15, 30, RED), (15, 36, RED)), at=(44, 0, 24)),
        Ball(GOLD, (11, 11, 13), at=(8, 0, 30)),
        block(RED, (46, 54, 60), (-46, 0, 14)),
        block(SKY, (28, 55.4, 22), (-46, 0, 22), solid=False),
        block(BLACK, (56, 60, 8), (-46, 0, 47), 4),
        Prism(SILVER, ((62, -25), (84, -4), (84, 4), (62, 25)), 14, at=(0, 0, -30)),
        *wheels,
    )


def basketball() -> Parts:
    """Return an orange ball with black seams."""
    orange, r = (226, 112, 40), 39.0
    seams = [bent(BLACK, arc((0, 0, 0), r, 0, 360, plane, 28), 1.6, solid=False) for plane in ("xy", "xz")]
    sides = [bent(BLACK, _curve(r, s), 1.6, solid=False) for s in (-1.0, 1.0)]
    return Ball(orange, (r, r, r)), *(rod for seam in (*seams, *sides) for rod in seam)


def _curve(radius: float, side: float) -> tuple[tuple[float, float, float], ...]:
    """Return points of a closed seam that bends over one half of a ball."""
    points = []
    for i in range(25):
        a = math.tau * i / 24
        x, z, y = 0.72 * math.cos(a), 0.72 * math.sin(a), side * (0.62 + 0.22 * math.cos(2 * a))
        length = math.sqrt(x * x + y * y + z * z)
        points.append((radius * x / length, radius * y / length, radius * z / length))
    return tuple(points)


def crayon_box(color: Rgb, band: Rgb) -> Parts:
    """Return an open box with coloured crayon tips looking out."""
    paints = (RED, (240, 126, 34), GREEN, BLUE, (134, 72, 168), (244, 156, 180))
    tips = [
        part
        for i, paint in enumerate(paints)
        for part in (
            Rod(paint, (-32.5 + 13 * i, 0, 30), (-32.5 + 13 * i, 0, 56), 6.4),
            Rod(paint, (-32.5 + 13 * i, 0, 56), (-32.5 + 13 * i, 0, 70), 6.2, 1.5),
        )
    ]
    waves = [block(band, (83.2, 41.2, 7), (0, 0, z), solid=False) for z in (-48, -34, 26)]
    return (
        block(color, (82, 40, 96), (0, 0, -12)),
        *waves,
        Prism(RED, round_outline(26, 15), 41.6, at=(0, 0, -4), turn=(90, 0, 0), solid=False),
        *tips,
    )
