"""Printed boards: one ArUco marker, a ChArUco board or a grid of AprilTags."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import Enum
from functools import cached_property
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from cliport_perception.errors import CalibrationError


class BoardKind(Enum):
    """Kinds of boards that are found in pictures."""

    ARUCO = "aruco"
    CHARUCO = "charuco"
    APRILGRID = "aprilgrid"


def dictionary_names() -> list[str]:
    """Return the names of the marker dictionaries that OpenCV knows, without their common prefix, sorted."""
    names = {name.upper().removeprefix("DICT_") for name in dir(cv2.aruco) if name.startswith("DICT_")}
    return sorted(names)


def dictionary(name: str) -> cv2.aruco.Dictionary:
    """Return a marker dictionary, such as that of `4X4_50`.

    Raises:
        CalibrationError: when there is none of that name.
    """
    if name.upper() not in dictionary_names():
        raise CalibrationError(f"unknown marker dictionary '{name}'; known are {', '.join(dictionary_names())}")
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, f"DICT_{name.upper()}"))


@dataclass(frozen=True)
class Board:
    """A flat board; its frame lies in the printed plane: origin at the top left corner, x right, y down, z into it.

    columns, rows: squares of a ChArUco board, tags of a grid; 1 and 1 for a single marker. pitch: side of a square, or
    the distance from one tag to the next [m]. marker: side of a marker with its black border [m]. dictionary: as in
    `dictionary_names`.

    Raises:
        CalibrationError: when the numbers make no board.
    """

    kind: BoardKind = BoardKind.CHARUCO
    columns: int = 5
    rows: int = 4
    pitch: float = 0.040
    marker: float = 0.030
    dictionary: str = "4X4_50"

    def __post_init__(self) -> None:
        sizes = (self.pitch, self.marker)
        if not all(np.isfinite(size) and 0.0 < size < 2.0 for size in sizes) or self.marker > self.pitch:
            raise CalibrationError(
                f"a board's marker ({self.marker} m) must be positive and no larger than its pitch ({self.pitch} m)"
            )
        if self.kind is BoardKind.ARUCO and (self.columns, self.rows, self.pitch) != (1, 1, self.marker):
            raise CalibrationError(f"an aruco board is one marker, got {self.columns}x{self.rows}")
        if self.kind is BoardKind.CHARUCO and (min(self.columns, self.rows) < 3 or self.marker >= self.pitch):
            raise CalibrationError(
                f"a charuco board has 3x3 squares at least, larger than their markers; got {self.columns}x{self.rows} "
                f"of {1e3 * self.pitch:g} mm with markers of {1e3 * self.marker:g} mm"
            )
        if self.kind is BoardKind.APRILGRID and (self.columns * self.rows < 2 or self.marker >= self.pitch):
            raise CalibrationError(f"an aprilgrid has two tags at least, with gaps; got {self.columns}x{self.rows}")
        object.__setattr__(self, "dictionary", self.dictionary.upper())
        available, cells = len(dictionary(self.dictionary).bytesList), self.columns * self.rows
        needed = cells // 2 if self.kind is BoardKind.CHARUCO else cells
        if needed > available:
            raise CalibrationError(f"the board needs {needed} markers, and {self.dictionary} has {available}")

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the printed pattern [m]."""
        gap = self.pitch - self.marker if self.kind is BoardKind.APRILGRID else 0.0
        return self.columns * self.pitch - gap, self.rows * self.pitch - gap

    @property
    def center(self) -> npt.NDArray[np.float64]:
        """The middle (3,) of the pattern in the board's frame [m]."""
        return np.array([self.size[0] / 2.0, self.size[1] / 2.0, 0.0])

    @property
    def corner_count(self) -> int:
        """The number of corners that are measured when all of the board is seen."""
        if self.kind is BoardKind.CHARUCO:
            return (self.columns - 1) * (self.rows - 1)
        return 4 * self.columns * self.rows

    @property
    def outline(self) -> npt.NDArray[np.float64]:
        """Corners (4, 3) of the pattern in the board's frame [m]: top left, top right, bottom right, bottom left."""
        width, height = self.size
        return np.array([[0.0, 0.0, 0.0], [width, 0.0, 0.0], [width, height, 0.0], [0.0, height, 0.0]])

    @cached_property
    def cv_board(self) -> Any:
        """OpenCV's board, whose frame is this one's."""
        markers = dictionary(self.dictionary)
        if self.kind is BoardKind.CHARUCO:
            return cv2.aruco.CharucoBoard((self.columns, self.rows), self.pitch, self.marker, markers)
        gap = self.pitch - self.marker or self.marker  # a single marker has none, and OpenCV wants one
        return cv2.aruco.GridBoard((self.columns, self.rows), self.marker, gap, markers)

    def picture(self, pixels_per_m: float) -> npt.NDArray[np.uint8]:
        """Return the pattern (H, W), 0 and 255, without a margin, each pixel `1 / pixels_per_m` wide."""
        width, height = (round(side * pixels_per_m) for side in self.size)
        image: npt.NDArray[np.uint8] = self.cv_board.generateImage((width, height), None, 0, 1)
        return image

    def describe(self) -> str:
        """Return the board in the form that `parse_board` reads."""
        return (
            f"{self.kind.value}:{self.columns}x{self.rows}:{1e3 * self.pitch:g}:{1e3 * self.marker:g}:{self.dictionary}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for YAML."""
        return asdict(self) | {"kind": self.kind.value}


def parse_board(text: str) -> Board:
    """Return the board of `KIND[:COLUMNSxROWS:PITCH_MM:MARKER_MM[:DICTIONARY]]`, or of `aruco:SIDE_MM[:DICTIONARY]`.

    Raises:
        CalibrationError: when the text describes no board.
    """
    form = (
        "charuco:5x4:40:30:4X4_50 (columns x rows, mm of a square, mm of a marker, dictionary), "
        "aprilgrid:4x3:50:40:APRILTAG_36H11 or aruco:150:4X4_50"
    )
    name, *parts = text.split(":")
    try:
        kind = BoardKind(name.lower())
        if kind is BoardKind.ARUCO:
            side = float(parts[0]) / 1e3 if parts else 0.15
            return Board(kind, 1, 1, side, side, parts[1] if len(parts) > 1 else "4X4_50")
        if not parts:
            return Board() if kind is BoardKind.CHARUCO else Board(kind, 4, 3, 0.05, 0.04, "APRILTAG_36H11")
        columns, rows = (int(number) for number in parts[0].lower().split("x"))
        pitch, marker = float(parts[1]) / 1e3, float(parts[2]) / 1e3
        default = "4X4_50" if kind is BoardKind.CHARUCO else "APRILTAG_36H11"
        return Board(kind, columns, rows, pitch, marker, parts[3] if len(parts) > 3 else default)
    except (ValueError, IndexError):
        raise CalibrationError(f"'{text}' describes no board; give one like {form}") from None


def board_from_dict(values: Any) -> Board:
    """Invert `Board.to_dict`.

    Raises:
        CalibrationError: when the values describe no board.
    """
    try:
        return Board(
            BoardKind(values["kind"]),
            int(values["columns"]),
            int(values["rows"]),
            float(values["pitch"]),
            float(values["marker"]),
            str(values["dictionary"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise CalibrationError(f"a board needs kind, columns, rows, pitch, marker and dictionary: {error!r}") from None
