"""What the arm can do with two poses."""

from __future__ import annotations

from enum import IntEnum


class Primitive(IntEnum):
    """Values as in the PickPlace action."""

    PICK_PLACE = 0
    SWEEP = 1
    FOLD = 2
