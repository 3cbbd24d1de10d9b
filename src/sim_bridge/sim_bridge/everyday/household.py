"""Kinds of things that stand in kitchens and on shelves; lengths in millimetres (see primitives)."""

from __future__ import annotations

from sim_bridge.colors import Rgb
from sim_bridge.everyday.paints import BLUE, GREY, SILVER, TAN, WHITE
from sim_bridge.everyday.primitives import Parts, Point, Primitive, Prism, Rod, Turned, arc, bent, block, round_outline


def mug(color: Rgb, stripe: Rgb) -> Parts:
    """Return a mug with level stripes and a handle."""
    colors = (color, stripe, color, stripe, color, stripe, color, color)
    rings = [(36.0, 12.0 * i - 42.0, c) for i, c in enumerate(colors)]
    handle = bent(color, arc((33.0, 0.0, 0.0), 26.0, -75.0, 75.0), 6.5)
    return Turned(rings, hollow=(31.0, 60.0), inside=WHITE), *handle


def cup(color: Rgb, band: Rgb) -> Parts:
    """Return a tapering cup without a handle."""
    rings = ((27, -48, color), (32, 4, band), (34, 24, color), (38, 48, color))
    return (Turned(rings, hollow=(33, 40), inside=WHITE),)


def bottle(glass: Rgb, label: Rgb, cap: Rgb) -> Parts:
    """Return a bottle with a label, a shoulder, a neck and a cap."""
    low = ((29, -76, glass), (31, -72, glass), (31, -52, label), (31, 0, glass), (31, 16, glass))
    high = ((13, 44, glass), (13, 58, cap), (15, 58.5, cap), (15, 76, cap))
    return (Turned((*low, *high), cuts=(16, 44)),)


def can(upper: Rgb, lower: Rgb, badge: Rgb) -> Parts:
    """Return a tin can with a two-coloured label and round badges."""
    rings = ((34, -54, SILVER), (36, -52, SILVER), (36, -45, lower), (36, 0, upper), (36, 45, SILVER), (34, 54, SILVER))
    badges = [Prism(badge, round_outline(17, 17), 73.5, turn=(90, 0, yaw), solid=False) for yaw in (0, 90)]
    return Turned(rings), *badges, Turned(((29, -54.8, GREY), (29, 54.8, GREY)), solid=False)


def milk_carton(color: Rgb, band: Rgb, cap: Rgb) -> Parts:
    """Return a carton with a gabled top, a cap on its slope and a round emblem on every side."""
    roof = Prism(color, ((-32, 0), (32, 0), (4, 34), (-4, 34)), 64, at=(0, 0, 24), turn=(90, 0, 0))
    emblems = [
        Prism(band, round_outline(20, 20), 65.2, at=(0, 0, 0), turn=(90, 0, yaw), solid=False) for yaw in (0, 90)
    ]
    return (
        block(color, (64, 64, 96), (0, 0, -24)),
        roof,
        block(color, (8, 64, 14), (0, 0, 63)),
        block(band, (65.2, 65.2, 34), (0, 0, -52), solid=False),
        block(band, (9, 65.2, 7), (0, 0, 67), solid=False),
        *emblems,
        Rod(cap, (16, 0, 38), (28, 0, 52), 11),
    )


def package(size: Point, color: Rgb, band: Rgb) -> Parts:
    """Return a cardboard box with a band around its upper end."""
    x, y, z = size
    return block(color, size), block(band, (x + 1.2, y + 1.2, z * 0.22), (0, 0, z * 0.3), solid=False)


def badge(color: Rgb, radius: float, thickness: float, at: Point = (0, 0, 0), tall: float = 1.0) -> Prism:
    """Return a round emblem seen on both y faces of something so thick."""
    return Prism(color, round_outline(radius, radius * tall), thickness, at=at, turn=(90, 0, 0), solid=False)


def towel(color: Rgb) -> Parts:
    """Return a folded towel with stripes: two layers."""
    parts: list[Primitive] = [block(WHITE, (144, 74, 20), (0, 0, -11), 9), block(WHITE, (136, 74, 20), (0, 0, 11), 9)]
    for i in range(-3, 4):
        parts += [block(color, (10.5, 75, 21), (19.5 * i, 0, z), solid=False) for z in (-11, 11)]
    return *parts, block(GREY, (132, 72, 4), solid=False)


def tape(color: Rgb) -> Parts:
    """Return a roll of adhesive tape on a cardboard core, its end a little loose; the hole is only seen."""
    return (
        Prism(color, round_outline(38, 38), 44, (round_outline(23, 23),)),
        Prism(TAN, round_outline(24.5, 24.5), 45.5, (round_outline(20, 20),), solid=False),
        block(color, (34, 2.5, 44), (16, -38.5, 0)),
    )


def teapot(color: Rgb, trim: Rgb) -> Parts:
    """Return a round pot with a spout, a handle, a lid and a painted band."""
    rings = (
        (22, -38, color),
        (34, -24, color),
        (38, -6, trim),
        (38, 6, color),
        (32, 24, color),
        (20, 34, trim),
        (17, 39, color),
        (6, 41, color),
    )
    spout = (Rod(color, (30, 0, -12), (56, 0, 6), 10, 8), Rod(color, (55, 0, 5), (68, 0, 30), 8, 6))
    handle = bent(color, arc((-34, 0, 0), 25, 105, 255), 6)
    return Turned(rings), *spout, *handle, Rod(trim, (0, 0, 40), (0, 0, 51), 8)


def toy_brick(color: Rgb, dark: Rgb) -> Parts:
    """Return a building brick with eight studs, hollow underneath."""
    spots = [(x, y) for x in (-39, -13, 13, 39) for y in (-15.5, 15.5)]
    studs = [Rod(color, (x, y, 20), (x, y, 31), 9.5) for x, y in spots]
    tubes = [Rod(color, (x, 0, -21.6), (x, 0, -10), 9, solid=False) for x in (-26, 0, 26)]
    return block(color, (108, 62, 42)), *studs, block(dark, (98, 52, 1.6), (0, 0, -20.6), solid=False), *tubes


def pan(color: Rgb, grip: Rgb) -> Parts:
    """Return a small deep frying pan."""
    rings = ((33, -15, color), (40, 15, color))
    bar = Rod(GREY, (34, 0, 8), (62, 0, 14), 7)
    hanger = Rod(SILVER, (108, 0, 19), (118, 0, 20), 9)
    return Turned(rings, hollow=(37, 24), inside=(78, 78, 84)), bar, Rod(grip, (56, 0, 13), (112, 0, 19), 9.5), hanger


def spoon(color: Rgb, shade: Rgb) -> Parts:
    """Return a cooking spoon with a hollow bowl."""
    bowl = Turned(((20, -12, color), (31, 6, color)), hollow=(27, 12), inside=shade, oval=0.74, at=(56, 0, 0))
    return bowl, Rod(color, (34, 0, 2), (-84, 0, 6), 9, 7)


def present(color: Rgb, ribbon: Rgb) -> Parts:
    """Return a wrapped box with a crossed ribbon and a bow."""
    bands = (block(ribbon, (16, 75.2, 71.2), solid=False), block(ribbon, (101.2, 16, 71.2), solid=False))
    loops = [
        Turned(((10, -4, ribbon), (15, 10, ribbon)), at=(0, 0, 41), turn=(s * 70, 0, 40), hollow=(9, 8), inside=ribbon)
        for s in (-1, 1)
    ]
    return block(color, (100, 74, 70)), *bands, *loops, block(ribbon, (13, 13, 12), (0, 0, 40), 4)


def chocolate_bar(chocolate: Rgb, dark: Rgb, wrapper: Rgb, foil: Rgb) -> Parts:
    """Return a bar of chocolate half out of its wrapper, its squares seen from both sides."""
    squares = [
        block(chocolate, (15.5, 15, 26), (x, y, 0), 2) for x in (13, 31, 49, 67) for y in (-25.5, -8.5, 8.5, 25.5)
    ]
    return (
        block(dark, (74, 69, 19), (39, 0, 0)),
        *squares,
        block(wrapper, (78, 74, 30), (-38, 0, 0)),
        block(foil, (14, 73, 29), (5, 0, 0)),
        block(foil, (80, 18, 31), (-38, 0, 0), solid=False),
        block(BLUE, (81, 6, 31.6), (-38, 0, 0), solid=False),
    )
