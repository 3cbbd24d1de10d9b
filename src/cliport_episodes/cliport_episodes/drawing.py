"""Text in pictures, in any script, and the colours that pictures share."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from cliport_core.image_files import encode_png
from cliport_episodes.disk import disk_errors

Color: TypeAlias = tuple[int, int, int]  # RGB
Picture: TypeAlias = npt.NDArray[np.uint8]  # (H, W, 3) RGB

INK: Color = (30, 30, 30)
FAINT: Color = (150, 150, 150)
PICK_COLOR: Color = (225, 50, 50)
PLACE_COLOR: Color = (20, 150, 70)
_MARGIN = 8  # pixels to the right of a text that is cut off


def write_text(picture: Picture, text: str, row: int, col: int, size: int = 16, color: Color = INK) -> None:
    """Write one line whose baseline begins at (row, col), cut off at the picture's edge; size in pixels."""
    available = picture.shape[1] - col - _MARGIN
    while text and _text_width(text, size) > available:
        text = text[:-2].rstrip() + "…" if len(text) > 2 else ""
    cv2.putText(picture, text, (col, row), color, _font(), size)


def save_png(picture: Picture, path: Path) -> None:
    """Write (H, W, 3) RGB as a PNG file. Raises DiskError."""
    file = encode_png(picture)
    with disk_errors(path):
        path.write_bytes(file)


def _text_width(text: str, size: int) -> int:
    (_, _, width, _) = cv2.getTextSize((0, 0), text, (0, 0), _font(), size)
    return int(width)


@lru_cache(maxsize=1)
def _font() -> Any:
    return cv2.FontFace("sans")
