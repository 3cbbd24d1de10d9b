"""Colours of the everyday objects, 0..255 RGB: those of real things, not the benchmark's palette."""

from __future__ import annotations

BLACK = (38, 38, 42)
WHITE = (242, 242, 238)
GREY = (128, 130, 134)
SILVER = (192, 196, 202)
RED = (206, 44, 44)
ORANGE = (240, 126, 34)
YELLOW = (248, 206, 46)
GOLD = (222, 176, 70)
GREEN = (52, 142, 74)
LIME = (140, 190, 70)
BLUE = (44, 92, 190)
SKY = (120, 180, 226)
PURPLE = (134, 72, 168)
PINK = (244, 156, 180)
BROWN = (112, 70, 44)
CHOCOLATE = (78, 44, 28)
TAN = (206, 160, 104)
WOOD = (204, 158, 104)
CREAM = (240, 226, 196)
