"""A board as a PDF at true scale, with a ruler that tells whether the printer kept it."""

from __future__ import annotations

from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from cliport_core.whole_file import whole_file
from cliport_perception.calibration.board import Board
from cliport_perception.errors import CalibrationError

PAPERS = {"A4": (297.0, 210.0), "A3": (420.0, 297.0), "letter": (279.4, 215.9)}  # lying [mm]
_INCH = 25.4
_PICTURE = 20.0  # pixels of the board's picture for each mm
_FOOT = 26.0  # below the board: ruler and words [mm]
_EDGE = 6.0  # which printers leave white [mm]


def board_figure(board: Board, paper: str = "A4") -> Figure:
    """Return a sheet of paper with a board on it, in matplotlib's units of 1 mm.

    Raises:
        CalibrationError: when the paper is unknown, or the board does not fit.
    """
    if paper not in PAPERS:
        raise CalibrationError(f"unknown paper '{paper}'; known are {', '.join(PAPERS)}")
    width, height = PAPERS[paper]
    board_width, board_height = (1e3 * side for side in board.size)
    if board_width > width - 2 * _EDGE or board_height > height - _FOOT - 2 * _EDGE:
        raise CalibrationError(
            f"a board of {board_width:.0f} x {board_height:.0f} mm does not fit {paper} with its ruler "
            f"({width - 2 * _EDGE:.0f} x {height - _FOOT - 2 * _EDGE:.0f} mm): take larger paper or a smaller board"
        )
    figure = Figure(figsize=(width / _INCH, height / _INCH))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set_xlim(0.0, width)
    axes.set_ylim(0.0, height)
    left = (width - board_width) / 2.0
    bottom = _FOOT + (height - _FOOT - board_height) / 2.0
    extent = (left, left + board_width, bottom, bottom + board_height)
    axes.imshow(board.picture(1e3 * _PICTURE), cmap="gray", vmin=0, vmax=255, extent=extent, interpolation="none")
    axes.set_xlim(0.0, width)
    axes.set_ylim(0.0, height)
    _ruler(axes, (width - 150.0) / 2.0)
    words = f"{board.describe()}   print at 100 %, not fitted to the page; the ruler must measure 150 mm; glue it flat"
    axes.text(width / 2.0, 6.5, words, ha="center", va="center", fontsize=7)
    return figure


def print_board(board: Board, path: Path, paper: str = "A4") -> None:
    """Write a board's PDF at true scale.

    Raises:
        CalibrationError: when the board does not fit the paper, or the place cannot be written.
    """
    figure = board_figure(board, paper)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as temporary:
            figure.savefig(temporary, format="pdf")
    except OSError as error:
        raise CalibrationError(f"cannot write {path}: {error.strerror or error}") from None


def _ruler(axes: object, left: float) -> None:
    """Draw 150 mm with a mark for each, from `left` [mm] on."""
    for mark in range(151):
        length = 5.0 if mark % 10 == 0 else 3.5 if mark % 5 == 0 else 2.0
        axes.plot((left + mark, left + mark), (14.0, 14.0 + length), color="black", linewidth=0.4)  # type: ignore[attr-defined]
        if mark % 10 == 0:
            axes.text(left + mark, 12.6, f"{mark}", ha="center", va="top", fontsize=6)  # type: ignore[attr-defined]
    axes.plot((left, left + 150.0), (14.0, 14.0), color="black", linewidth=0.4)  # type: ignore[attr-defined]
