"""Toy animals and figures; lengths in millimetres (see primitives)."""

from __future__ import annotations

from sim_bridge.colors import Rgb
from sim_bridge.everyday.paints import BLACK, BLUE, CREAM, GOLD, GREY, ORANGE, PINK, PURPLE, RED, SILVER, WHITE, YELLOW
from sim_bridge.everyday.primitives import Ball, Parts, Point, Primitive, Prism, Rod, Turned, bent, block


def eyes(x: float, y: float, z: float, size: float = 4.0, color: Rgb = BLACK) -> Parts:
    """Return a pair of eyes on both sides of the xz plane."""
    return tuple(Ball(color, (size, size, size), at=(x, side * y, z), solid=False) for side in (-1, 1))


def four_legged(coat: Rgb, head: Rgb, snout: Rgb, feet: Rgb) -> Parts:
    """Return trunk, four legs, a head with a snout, and eyes; ears, tail and the rest are added by the caller."""
    legs: list[Primitive] = []
    for x, y in ((32, 16), (32, -16), (-34, 16), (-34, -16)):
        legs += [Rod(coat, (x, y, 2), (x, y, -34), 11), Rod(feet, (x, y, -33), (x, y, -44), 12)]
    return (
        Ball(coat, (56, 30, 28), at=(-2, 0, 6)),
        *legs,
        Ball(head, (24, 22, 23), at=(56, 0, 32)),
        Ball(snout, (14, 14, 11), at=(74, 0, 25)),
        *eyes(70, 12, 39),
    )


def ears(color: Rgb, size: Point, at: Point, lean: float) -> Parts:
    """Return a pair of flat ears, leaning outwards by `lean` degrees."""
    x, y, z = at
    return tuple(Ball(color, size, at=(x, s * y, z), turn=(-s * lean, 0, 0), solid=False) for s in (-1, 1))


def cow() -> Parts:
    """Return a white cow with black patches, a pink muzzle and horns."""
    patches = [
        Ball(BLACK, size, at=at, solid=False)
        for size, at in (
            ((20, 20, 16), (14, 12, 20)),
            ((22, 18, 18), (-28, -14, 18)),
            ((16, 14, 14), (-40, 16, 2)),
            ((16, 14, 14), (22, -19, 2)),
            ((12, 10, 12), (54, 15, 42)),
        )
    ]
    horns = [Rod(CREAM, (52, s * 12, 50), (54, s * 20, 66), 5, 2) for s in (-1, 1)]
    udder = Ball(PINK, (13, 13, 10), at=(-22, 0, -18))
    tail = bent(WHITE, ((-54, 0, 16), (-62, 0, 0), (-62, 0, -16)), 3.5)
    return (
        *four_legged(WHITE, WHITE, PINK, BLACK),
        *patches,
        *horns,
        udder,
        *tail,
        *ears(BLACK, (4, 11, 6), (50, 26, 42), -10),
    )


def pig() -> Parts:
    """Return a round pink pig with a flat snout."""
    nose = Rod((226, 120, 150), (76, 0, 24), (92, 0, 24), 12)
    holes = [Ball(BLACK, (2.5, 2.5, 3.5), at=(92, s * 5, 25), solid=False) for s in (-1, 1)]
    tail = bent((226, 120, 150), ((-54, 0, 16), (-64, 6, 22), (-68, -4, 28), (-62, -6, 32)), 3.5)
    return (
        Ball(PINK, (54, 34, 32), at=(-4, 0, 6)),
        *four_legged(PINK, PINK, PINK, (226, 120, 150)),
        nose,
        *holes,
        *tail,
        *ears((226, 120, 150), (5, 8, 12), (54, 15, 46), 20),
    )


def dog() -> Parts:
    """Return a brown dog with hanging dark ears, a black nose and a red collar."""
    coat, dark = (196, 138, 78), (96, 58, 34)
    collar = Turned(((21, -5, RED), (21, 5, RED)), at=(40, 0, 22), turn=(0, 55, 0), solid=False)
    tail = Rod(coat, (-52, 0, 16), (-74, 0, 44), 6, 4)
    nose = Ball(BLACK, (6, 6, 5), at=(87, 0, 29), solid=False)
    patch = Ball(dark, (24, 24, 16), at=(-20, 0, 22), solid=False)
    return *four_legged(coat, coat, CREAM, CREAM), *ears(dark, (9, 5, 20), (52, 23, 26), -12), collar, tail, nose, patch


def lion() -> Parts:
    """Return a sandy lion with a big brown mane and a tufted tail."""
    sand, mane = (226, 172, 84), (142, 76, 28)
    ring = Turned(((26, -11, mane), (37, -3, mane), (37, 5, mane), (26, 12, mane)), at=(50, 0, 31), turn=(0, 80, 0))
    tail = (Rod(sand, (-54, 0, 12), (-76, 0, 34), 4), Ball(mane, (9, 8, 9), at=(-78, 0, 38)))
    nose = Ball(BLACK, (5, 7, 4), at=(86, 0, 30), solid=False)
    return (
        *four_legged(sand, sand, CREAM, sand)[:-2],
        *eyes(76, 11, 41),
        ring,
        *tail,
        nose,
        Ball(sand, (20, 20, 21), at=(62, 0, 32)),
        *ears(sand, (5, 8, 8), (56, 24, 58), 30),
    )


def unicorn() -> Parts:
    """Return a white unicorn with a golden horn and a purple mane and tail."""
    neck = Rod(WHITE, (36, 0, 10), (56, 0, 40), 17, 14)
    horn = Rod(GOLD, (64, 0, 50), (78, 0, 84), 7, 1)
    mane = [Ball(PURPLE, (12, 8, 13), at=at) for at in ((48, 0, 56), (38, 0, 46), (30, 0, 34))]
    tail = bent(PURPLE, ((-52, 0, 16), (-70, 0, 10), (-76, 0, -20)), 9)
    return *four_legged(WHITE, WHITE, WHITE, PINK), neck, horn, *mane, *tail, *ears(WHITE, (4, 5, 10), (52, 12, 56), 15)


def dinosaur() -> Parts:
    """Return a green dinosaur with a long neck and tail and orange plates along its back."""
    green, belly = (84, 160, 72), (176, 206, 120)
    plates = [
        Prism(ORANGE, ((-h * 0.6, 0), (h * 0.6, 0), (0, h)), 7, at=(x, 0, z), turn=(90, 0, 0))
        for x, z, h in ((34, 26, 18), (14, 30, 24), (-10, 30, 26), (-34, 24, 22), (-54, 14, 16))
    ]
    legs = [Rod(green, (x, y, 0), (x, y, -36), 11, 13) for x in (24, -26) for y in (-17, 17)]
    return (
        Ball(green, (48, 29, 28), at=(0, 0, 4)),
        Ball(belly, (40, 22, 20), at=(0, 0, -10), solid=False),
        Rod(green, (34, 0, 10), (60, 0, 36), 17, 12),
        Ball(green, (22, 15, 14), at=(68, 0, 40)),
        Rod(green, (-34, 0, 4), (-66, 0, -10), 19, 11),
        Rod(green, (-65, 0, -10), (-96, 0, -22), 11, 3),
        *legs,
        *plates,
        *eyes(76, 12, 46, 4),
    )


def whale() -> Parts:
    """Return a blue whale with a white belly and a tail fin."""
    blue = (66, 122, 190)
    fluke = ((-6, -4), (14, -34), (-12, -30), (-24, -6), (-24, 6), (-12, 30), (14, 34), (-6, 4))
    fins = [Ball(blue, (16, 12, 4), at=(10, s * 34, -10), turn=(s * 25, 0, s * -35)) for s in (-1, 1)]
    return (
        Ball(blue, (58, 34, 33), at=(12, 0, 0)),
        Ball(WHITE, (54, 30, 26), at=(16, 0, -9), solid=False),
        Rod(blue, (-24, 0, 2), (-64, 0, 18), 24, 9),
        Prism(
            blue,
            [(-x, y) for x, y in fluke],
            9,
            at=(-70, 0, 20),
            turn=(0, 180, 0),
            pieces=((0, 1, 2, 3, 4), (3, 4, 5, 6, 7)),
        ),
        *fins,
        *eyes(56, 24, 6, 4.5, WHITE),
        *eyes(58, 26, 6, 3),
        Rod(SILVER, (8, 0, 31), (8, 0, 36), 6, solid=False),
    )


def penguin() -> Parts:
    """Return an upright black penguin with a white belly, an orange beak and feet."""
    wings = [Ball(BLACK, (12, 6, 32), at=(0, s * 35, 0), turn=(s * 14, 0, 0)) for s in (-1, 1)]
    feet = [Ball(ORANGE, (18, 12, 6), at=(12, s * 15, -60)) for s in (-1, 1)]
    return (
        Ball(BLACK, (32, 34, 50), at=(0, 0, -12)),
        Ball(WHITE, (26, 26, 43), at=(10, 0, -14), solid=False),
        Ball(BLACK, (25, 26, 25), at=(2, 0, 44)),
        Ball(WHITE, (14, 19, 16), at=(14, 0, 41), solid=False),
        Rod(ORANGE, (24, 0, 40), (42, 0, 37), 8, 2),
        *eyes(26, 9, 48),
        *wings,
        *feet,
    )


def duck() -> Parts:
    """Return a yellow rubber duck with an orange beak."""
    wings = [Ball((232, 178, 20), (22, 8, 15), at=(-10, s * 32, -12), solid=False) for s in (-1, 1)]
    return (
        Ball(YELLOW, (48, 36, 30), at=(-6, 0, -18)),
        Ball(YELLOW, (28, 26, 27), at=(24, 0, 26)),
        Rod(YELLOW, (-36, 0, -10), (-66, 0, 12), 18, 4),
        Ball(ORANGE, (16, 14, 6), at=(52, 0, 20)),
        *eyes(44, 15, 34, 5),
        *wings,
    )


def teddy() -> Parts:
    """Return a sitting teddy bear with a red bow."""
    fur, light = (164, 106, 60), (222, 180, 128)
    limbs = [Ball(fur, (13, 12, 26), at=(10, s * 33, -4), turn=(s * -28, 20, 0)) for s in (-1, 1)]
    legs = [
        part
        for s in (-1, 1)
        for part in (
            Ball(fur, (30, 15, 15), at=(26, s * 21, -42)),
            Ball(light, (6, 11, 11), at=(52, s * 21, -40), solid=False),
        )
    ]
    return (
        Ball(fur, (30, 33, 38), at=(0, 0, -20)),
        Ball(light, (22, 24, 28), at=(12, 0, -20), solid=False),
        Ball(fur, (29, 32, 29), at=(4, 0, 38)),
        Ball(light, (14, 15, 12), at=(27, 0, 31), solid=False),
        Ball(BLACK, (5, 6, 4), at=(40, 0, 34), solid=False),
        *(Ball(fur, (8, 13, 13), at=(0, s * 27, 62)) for s in (-1, 1)),
        *limbs,
        *legs,
        *eyes(29, 12, 46),
        *(Ball(RED, (6, 13, 8), at=(28, s * 13, 10), solid=False) for s in (-1, 1)),
    )


def robot() -> Parts:
    """Return a toy robot of boxes."""
    arms = [
        part
        for s in (-1, 1)
        for part in (
            Rod(GREY, (0, s * 30, 18), (0, s * 34, -16), 8),
            block(RED, (14, 12, 14), (0, s * 34, -22)),
        )
    ]
    legs = [
        part
        for s in (-1, 1)
        for part in (
            Rod(GREY, (0, s * 13, -32), (0, s * 13, -56), 9),
            block(BLUE, (38, 22, 14), (5, s * 13, -62)),
        )
    ]
    return (
        block(SILVER, (40, 52, 54), (0, 0, -6)),
        block(SILVER, (38, 40, 34), (0, 0, 42)),
        block(BLUE, (41, 34, 22), (0, 0, 2), solid=False),
        *(Ball(YELLOW, (20.5, 4, 4), at=(0, y, 3), solid=False) for y in (-10, 0, 10)),
        *(Ball(RED, (21, 6, 6), at=(0, y, 46), solid=False) for y in (-10, 10)),
        block(BLACK, (39, 24, 5), (0, 0, 32), solid=False),
        Rod(RED, (0, 0, 58), (0, 0, 74), 3),
        Ball(RED, (6, 6, 6), at=(0, 0, 76)),
        *arms,
        *legs,
    )
