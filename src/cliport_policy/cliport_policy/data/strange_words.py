"""Names that no demonstration holds: of shapes, so that a network learns to go by how a hole looks, and of objects.

Heard in training, a name that means nothing says neither which hole is meant nor that the piece is not there.
"""

from __future__ import annotations

import re
from collections.abc import Collection

import numpy as np

from cliport_policy.data.demonstrations import Demonstration
from cliport_policy.data.named_things import named_things

# None is a name, or a part of one, of the benchmark's shapes, seen or unseen.
STRANGE_NAMES = (
    *(f"letter {letter} shape" for letter in "BCDFHIJKNOPQSUWXYZ"),
    *(f"number {number} shape" for number in ("two", "three", "four", "five", "seven")),
    "crescent", "trapezoid", "oval", "rhombus", "octagon", "arrow", "cloud", "teardrop", "leaf", "shield", "gear",
    "key", "spade", "anchor", "fish", "butterfly", "zigzag", "spiral", "wedge", "hook", "kite", "bolt", "half moon",
    "cross", "puzzle piece", "parallelogram", "pebble", "comma", "horseshoe", "clover",
)  # fmt: skip

STRANGE_OBJECTS = (
    "stapler", "water bottle", "sponge", "pair of glasses", "notebook", "tennis ball", "wine glass", "candle",
    "umbrella", "wallet", "baseball cap", "banana", "toy car", "plush rabbit", "lemon", "hair brush", "comb", "tea pot",
    "ladle", "whisk", "sock", "glove", "scarf", "shoe box", "perfume bottle", "shampoo bottle", "jar of honey",
    "bag of chips", "cookie tin", "battery", "light bulb", "remote control", "phone", "keyboard", "pair of headphones",
    "speaker", "watch", "coin purse", "doll", "toy horse", "toy truck", "toy boat", "giraffe statue", "elephant statue",
    "drill", "pair of pliers", "wrench", "saw", "paint brush", "marker", "pencil case", "ruler", "stamp", "envelope",
    "calendar", "vase", "plant pot", "saucer", "egg carton", "loaf of bread", "piece of cheese", "apple", "pear",
    "carrot", "pepper mill", "salt shaker", "oil can", "cork", "pillow", "blanket", "backpack", "lunch tin", "thermos",
    "flask", "helmet", "pair of goggles", "whistle", "drum", "guitar", "flute", "bell", "picture frame", "mirror",
    "tray", "basket", "bucket", "straw", "ice tray", "glue stick", "tape measure", "hand towel", "checkered napkin",
)  # fmt: skip


def strange_words(
    phrase: str, demo: Demonstration, things: Collection[tuple[str, str]], rng: np.random.Generator
) -> str:
    """Return a wording of a demonstration's sentence with another name for its shape, piece and hole alike.

    things: (colour, name) of what lies on the table. The wording itself is returned where it does not name a shape that
    has a hole, or where the piece is absent though something of its colour is there: only its name would tell.
    """
    named = named_things(demo.instruction)
    if named is None or not named.places[0][1].endswith(" hole"):
        return phrase
    color, shape = named.picks[0]
    if demo.absent and any(shown == color for shown, _ in things):
        return phrase
    strange = STRANGE_NAMES[int(rng.integers(len(STRANGE_NAMES)))]
    return re.sub(rf"\b{re.escape(shape)}\b", strange, phrase)
