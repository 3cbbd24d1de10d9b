"""Names of the benchmark's Google Scanned Objects, and a colour for each where a folder has meshes without any.

See docs/benchmark.md, "Everyday objects".
"""

from __future__ import annotations

from sim_bridge.colors import Rgb

_BLACK, _WHITE, _CREAM = (44, 44, 48), (238, 238, 234), (236, 228, 210)
_WOOD, _STEEL, _RED, _YELLOW = (196, 148, 96), (176, 180, 186), (204, 44, 44), (244, 200, 48)

SEEN: dict[str, Rgb] = {
    "alarm clock": (190, 190, 196),
    "android toy": (140, 190, 60),
    "black boot with leopard print": (84, 66, 44),
    "black fedora": _BLACK,
    "black razer mouse": (34, 54, 38),
    "black sandal": (58, 54, 54),
    "black shoe with orange stripes": (92, 56, 36),
    "bull figure": (96, 60, 40),
    "butterfinger chocolate": (246, 190, 30),
    "c clamp": (60, 80, 110),
    "can opener": (214, 60, 60),
    "crayon box": (248, 176, 40),
    "dog statue": (214, 190, 150),
    "frypan": (70, 72, 80),
    "green and white striped towel": (150, 200, 150),
    "grey soccer shoe with cleats": (140, 146, 150),
    "hard drive": (64, 66, 74),
    "honey dipper": _WOOD,
    "magnifying glass": (110, 130, 150),
    "mario figure": (214, 60, 50),
    "nintendo 3ds": (90, 170, 210),
    "nintendo cartridge": (128, 130, 136),
    "office depot box": (226, 214, 190),
    "orca plush toy": (50, 56, 70),
    "pepsi gold caffeine free box": (206, 166, 70),
    "pepsi wild cherry box": (160, 30, 60),
    "porcelain cup": _WHITE,
    "purple tape": (140, 80, 170),
    "red and white flashlight": (220, 70, 66),
    "rhino figure": (130, 126, 122),
    "rocket racoon figure": (150, 104, 70),
    "scissors": (230, 110, 40),
    "silver tape": _STEEL,
    "spatula with purple head": (150, 84, 176),
    "spiderman figure": (196, 36, 52),
    "tablet": (52, 56, 64),
    "toy school bus": _YELLOW,
}
UNSEEN: dict[str, Rgb] = {
    "ball puzzle": (90, 190, 200),
    "black and blue sneakers": (44, 58, 104),
    "black shoe with green stripes": (44, 84, 52),
    "brown fedora": (128, 88, 54),
    "dinosaur figure": (104, 146, 74),
    "hammer": (160, 110, 60),
    "light brown boot with golden laces": (192, 148, 96),
    "lion figure": (214, 164, 84),
    "pepsi max box": (36, 40, 54),
    "pepsi next box": (70, 130, 200),
    "porcelain salad plate": (246, 246, 242),
    "porcelain spoon": _CREAM,
    "red and white striped towel": (226, 140, 136),
    "red cup": _RED,
    "screwdriver": (232, 150, 30),
    "toy train": (50, 110, 190),
    "unicorn toy": (240, 190, 216),
    "white razer mouse": (226, 230, 228),
    "yoshi figure": (96, 184, 70),
}
