"""Picture of a data set's statistics: positions of picks and places, instructions and biases."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from cliport_episodes.drawing import FAINT, INK, PICK_COLOR, PLACE_COLOR, Color, Picture, save_png, write_text
from cliport_episodes.statistics import SQUARE, Statistics

_WIDTH = 1000  # of the picture [pixels]
_MAP_TOP = 84  # row of a map's upper edge
_MAP_WIDTH = 440  # width of a map of the table [pixels]
_ROW = 26  # height of a row of a list [pixels]
_MAX_ROWS = 10  # rows of a list


def draw_statistics(statistics: Statistics, path: Path) -> None:
    """Write the picture as PNG. The table is seen from behind the robot: +x up, +y to the left. Raises DiskError."""
    s, biases = statistics, statistics.biases()
    below_maps = _MAP_TOP + _map_height(s)
    n_bars = min(_MAX_ROWS, max(len(s.instructions), len(s.color_words)))
    below_bars = below_maps + 60 + _ROW * (n_bars + 1)
    picture: Picture = np.full((below_bars + _ROW * len(biases), _WIDTH, 3), 255, dtype=np.uint8)
    marks = ", ".join(f"{count} {mark}" for mark, count in s.success.items()) or "none"
    write_text(picture, f"{s.n_steps} steps in {s.n_episodes} episodes ({marks})", 34, 30, 22)
    for name, counts, color, col in (("picks", s.picks, PICK_COLOR, 30), ("places", s.places, PLACE_COLOR, 530)):
        squares, side = s.squares(counts), round(100 * SQUARE)
        write_text(
            picture, f"{name} in {np.count_nonzero(squares)} of {squares.size} squares of {side} cm", 72, col, 16
        )
        _draw_map(picture, s, counts, color, col)
    _draw_bars(picture, "instructions", s.instructions, below_maps + 40, 30)
    _draw_bars(picture, "colour words", s.color_words, below_maps + 40, 530)
    for number, line in enumerate(biases):
        write_text(picture, f"! {line}", below_bars + _ROW * number, 30, 16, PICK_COLOR)
    save_png(picture, path)


def _map_height(statistics: Statistics) -> int:
    rows, cols = statistics.workspace.shape
    return round(cols * _MAP_WIDTH / rows)


def _draw_map(picture: Picture, statistics: Statistics, counts: npt.NDArray[np.int32], color: Color, col: int) -> None:
    """Draw the table, a dot for each position over squares shaded by their counts."""
    scale = _MAP_WIDTH / counts.shape[0]
    top, height = _MAP_TOP, _map_height(statistics)
    squares = statistics.squares(counts)
    side = SQUARE / statistics.workspace.pixel_size * scale
    for (row, column), count in np.ndenumerate(squares):
        share = count / max(1, squares.max())
        shade = tuple(round(255 - 0.75 * share * (255 - c)) for c in color)
        right, bottom = col + _MAP_WIDTH - round(row * side), top + height - round(column * side)
        left, upper = max(col, round(right - side)), max(top, round(bottom - side))
        cv2.rectangle(picture, (left, upper), (right, bottom), shade, -1)
        cv2.rectangle(picture, (left, upper), (right, bottom), FAINT, 1)
        if count:
            write_text(picture, str(count), upper + 18, left + 5, 14)
    for row, column in np.argwhere(counts):
        at = (round(col + _MAP_WIDTH - (row + 0.5) * scale), round(top + height - (column + 0.5) * scale))
        cv2.circle(picture, at, 2, INK, -1, cv2.LINE_AA)


def _draw_bars(picture: Picture, title: str, counts: dict[str, int], row: int, col: int) -> None:
    write_text(picture, f"{title} ({len(counts)})", row, col, 16)
    most = max(counts.values(), default=1)
    for number, (name, count) in enumerate(list(counts.items())[:_MAX_ROWS]):
        bottom = row + _ROW * (number + 1)
        length = round((_MAP_WIDTH - 60) * count / most)
        cv2.rectangle(picture, (col + 50, bottom - 16), (col + 50 + length, bottom + 4), (215, 225, 240), -1)
        write_text(picture, str(count), bottom, col, 15)
        area = picture[:, : col + _MAP_WIDTH]
        write_text(area, name, bottom, col + 55, 15)
