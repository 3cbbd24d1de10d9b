"""Eyes of somebody at the page: things on the live picture, by colour alone. Points are (col, row) in its pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

COLORS = {"red": (0, 135), "green": (56, 100)}  # OpenCV's hue and least saturation of the tasks' colours
_WIDTH = 960  # of the picture that these lengths are for
_RUN_UP = 34.0  # behind the farthest small block, where the closed hand has room
_LEAST_RUN_UP = 18.0  # where there is no more room
_TURNS = 8  # numbers that are different sweeps
_LINE = 2.0  # about the green square, which still counts as in it
_HALF_HAND = 9.0  # to either side of a sweep's line, where the closed hand meets a block
_SHORT = 16.0  # of the square's middle a sweep ends: what is before the hand is in it then
_CANDIDATES = 60  # sweeps that are compared
_NEAR = 26.0  # part of a rope by which its direction is seen
_BOX = 9.0  # half a box around a point
_GOLDEN = math.pi * (3.0 - math.sqrt(5.0))  # multiples of this angle point everywhere soon


@dataclass(frozen=True)
class Blob:
    """Something of one colour. half: half its sides; angle: of a side, in the picture."""

    centre: tuple[float, float]
    half: tuple[float, float]
    angle: float = 0.0

    @classmethod
    def around(cls, point: NDArray[np.float64], half: float, angle: float = 0.0) -> Blob:
        """A square of 2 half about a point."""
        return cls((float(point[0]), float(point[1])), (half, half), angle)


def of_color(picture: NDArray[np.uint8], color: str) -> NDArray[np.uint8]:
    """(H, W) 1 where an RGB picture (H, W, 3) has a colour."""
    hsv = cv2.cvtColor(picture, cv2.COLOR_RGB2HSV).astype(int)
    hue, saturation = COLORS[color]
    away = np.abs((hsv[..., 0] - hue + 90) % 180 - 90)
    return ((away <= 6) & (hsv[..., 1] > saturation) & (hsv[..., 2] > 60)).astype(np.uint8)


def find(picture: NDArray[np.uint8], color: str, least: int = 150) -> list[Blob]:
    """Find the things of a colour in an RGB picture (H, W, 3), from left to right."""
    mask = cv2.morphologyEx(of_color(picture, color), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    blobs = []
    for contour in contours:
        if cv2.contourArea(contour) >= least:
            left, top, width, height = cv2.boundingRect(contour)
            angle = math.radians(cv2.minAreaRect(contour)[2])
            blobs.append(Blob((left + width / 2, top + height / 2), (width / 2, height / 2), angle))
    return sorted(blobs, key=lambda blob: blob.centre)


def inside(inner: Blob, outer: Blob) -> bool:
    """Return True if one lies within another."""
    return all(abs(a - b) < half for a, b, half in zip(inner.centre, outer.centre, outer.half, strict=True))


def sweep(picture: NDArray[np.uint8], turn: int = 0) -> tuple[Blob, Blob]:
    """Return a sweep that brings much of what is red into the green square, and ends short of its middle.

    turn: 0 for the sweep with the most before the hand; higher numbers for others, with less room behind them, as where
    the best one begins outside of the workspace.
    """
    scale = picture.shape[1] / _WIDTH
    outside = _points(picture, "red")[_outside(picture)]
    square = np.asarray(cv2.minAreaRect(_points(picture, "green").astype(np.float32))[0])
    found = []  # (caught, forth, how far behind the square the last of them is)
    for first in outside[:: max(1, len(outside) // _CANDIDATES)]:
        forth = (square - first) / np.linalg.norm(square - first)
        behind, beside = (square - outside) @ forth, (square - outside) @ np.array([-forth[1], forth[0]])
        met = (np.abs(beside) < scale * _HALF_HAND) & (behind > 0)
        found.append((int(met.sum()), forth, behind[met].max()))
    found.sort(key=lambda each: each[0], reverse=True)
    _, forth, farthest = found[turn * len(found) // _TURNS % len(found)]
    run_up = _RUN_UP if turn % 2 == 0 else _LEAST_RUN_UP
    start, end = square - (farthest + scale * run_up) * forth, square - scale * _SHORT * forth
    return Blob.around(start, scale * _BOX), Blob.around(end, scale * _BOX)


def fold(picture: NDArray[np.uint8], turn: int = 0) -> tuple[Blob, Blob]:
    """A part of the red rope that sticks out, its angle that of the jaws across it, and the middle of the green square.

    turn: 0 for what sticks out farthest, other numbers for what does in other directions.
    """
    red, square = _points(picture, "red"), _middle(picture, "green")
    scale = picture.shape[1] / _WIDTH
    off = red - red.mean(axis=0)
    out = off[np.argmax(np.linalg.norm(off, axis=1))]
    angle = math.atan2(out[1], out[0]) + turn * _GOLDEN
    end = red[np.argmax(off @ np.array([math.cos(angle), math.sin(angle)]))]
    near = red[np.linalg.norm(red - end, axis=1) < scale * _NEAR]
    along = np.linalg.svd(near - near.mean(axis=0), full_matrices=False)[2][0]
    across = math.atan2(along[1], along[0]) + math.pi / 2
    return Blob.around(near.mean(axis=0), scale * _BOX, across), Blob.around(square, scale * _BOX)


def share_outside(picture: NDArray[np.uint8]) -> float:
    """Return the share of all red that lies outside of the green square."""
    outside = _outside(picture)
    return float(outside.mean()) if len(outside) else 0.0


def distance(picture: NDArray[np.uint8], color: str, point: tuple[float, float]) -> float:
    """Return the distance to the nearest pixel of a colour."""
    return float(np.linalg.norm(_points(picture, color) - point, axis=1).min())


def _points(picture: NDArray[np.uint8], color: str) -> NDArray[np.float64]:
    """(N, 2) of all pixels of a colour, without specks."""
    mask = cv2.morphologyEx(of_color(picture, color), cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    return np.argwhere(mask)[:, ::-1].astype(np.float64)


def _outside(picture: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """(N,) which of the red pixels of `_points` lie outside of the rectangle around all green."""
    (col, row), (wide, high), angle = cv2.minAreaRect(_points(picture, "green").astype(np.float32))
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    local = np.abs((_points(picture, "red") - (col, row)) @ np.array([[c, -s], [s, c]]))
    return (local > np.array([wide, high]) / 2 + picture.shape[1] / _WIDTH * _LINE).any(axis=1)


def _middle(picture: NDArray[np.uint8], color: str) -> NDArray[np.float64]:
    """Of the rectangle around all that has a colour."""
    points = _points(picture, color)
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2)
