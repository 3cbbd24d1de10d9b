"""Pictures with a title above and a sentence below, side by side on one sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

Picture = npt.NDArray[np.uint8]

_PAPER, _INK, _FAINT = (250, 250, 248), (24, 24, 28), (110, 110, 118)
_MARGIN = 10  # pixels around a captioned picture
_TITLE, _SENTENCE = 22, 21  # sizes of type, pixels
_LINE = 1.25  # height of a line, in sizes of type


@dataclass(frozen=True, eq=False)
class Captioned:
    """Picture (H, W, 3) RGB with its texts."""

    title: str
    picture: Picture
    sentence: str


def contact_sheet(pictures: Sequence[Captioned], columns: int) -> Picture:
    """Join pictures of one size in rows of that many, (H, W, 3) RGB."""
    lines = max(len(wrapped(p.sentence, p.picture.shape[1])) for p in pictures)
    cells = [captioned(picture, lines) for picture in pictures]
    height, width, _ = cells[0].shape
    n_rows = -(-len(cells) // columns)
    sheet = np.full((n_rows * height, min(columns, len(cells)) * width, 3), _PAPER, dtype=np.uint8)
    for i, cell in enumerate(cells):
        row, column = divmod(i, columns)
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = cell
    return sheet


def captioned(what: Captioned, lines: int) -> Picture:
    """Return one picture with its title, and its sentence on so many lines."""
    height, width, _ = what.picture.shape
    above, below = round(_LINE * _TITLE), round(_LINE * _SENTENCE * lines) + _MARGIN
    cell = Image.new("RGB", (width + 2 * _MARGIN, height + above + below + 2 * _MARGIN), _PAPER)
    draw = ImageDraw.Draw(cell)
    draw.text((_MARGIN, _MARGIN // 2), what.title, _FAINT, ImageFont.load_default(_TITLE))
    cell.paste(Image.fromarray(what.picture), (_MARGIN, _MARGIN + above))
    for i, line in enumerate(wrapped(what.sentence, width)[:lines]):
        top = _MARGIN + above + height + _MARGIN // 2 + round(i * _LINE * _SENTENCE)
        draw.text((_MARGIN, top), line, _INK, ImageFont.load_default(_SENTENCE))
    return np.asarray(cell, dtype=np.uint8)


def wrapped(sentence: str, width: int) -> list[str]:
    """Split the sentence into lines that are at most that many pixels wide, broken between words."""
    font, lines = ImageFont.load_default(_SENTENCE), [""]
    for word in sentence.split():
        longer = f"{lines[-1]} {word}".strip()
        if lines[-1] and font.getlength(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines
