"""Demonstrations in other arrangements: each thing on the table is cut out, turned and put down somewhere else.

So a few demonstrations do not teach that things lie where they lay in them. It is for sentences that say which thing,
not where; only the author of a task can say that its things may lie anywhere.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from cliport_core.heightmap import Heightmap
from cliport_policy.data.augmentation import PlanarTransform, identity_transform, names_direction
from cliport_policy.data.demonstrations import Demonstration
from cliport_policy.data.things import Thing, find_things, raised

_FREE_RADIUS = 10  # pixels around a place on the table that stay free
_TRIES = 60  # random places tried for one thing


class Cutout(NamedTuple):
    """Thing, turned and moved by the transform.

    rows, cols: the slices of the picture that it is put on. mask, color, height, valid: its pixels there.
    """

    transform: PlanarTransform
    rows: slice
    cols: slice
    mask: NDArray[np.bool_]
    color: NDArray[np.uint8]
    height: NDArray[np.float32]
    valid: NDArray[np.bool_]


def rearranged(scene: Heightmap, demo: Demonstration, rng: np.random.Generator) -> tuple[Heightmap, Demonstration]:
    """Return scene and demonstration with each thing elsewhere.

    Things that leave the picture stay; things that touch stay together. Both are returned unchanged if the sentence
    names a direction, no thing is seen at the pick, the things find no free place, or no table is seen between them.
    """
    if names_direction(demo.instruction):
        return scene, demo
    things = find_things(scene)
    pick = _thing_at(things, demo.pick_pixel) if demo.acts else None
    place = _thing_at(things, demo.place_pixel) if demo.acts else None
    bare = scene.valid & ~raised(scene) & ~np.any([thing.mask for thing in things], axis=0)
    if (pick is None and demo.acts) or not bare.any():
        return scene, demo
    taken = np.zeros(scene.valid.shape, np.uint8)
    if place is None and demo.acts:
        cv2.circle(taken, (demo.place_pixel[1], demo.place_pixel[0]), _FREE_RADIUS, 1, -1)
    cutouts = _place_things(scene, things, taken.astype(bool), rng)
    if cutouts is None:
        return scene, demo
    moved = _compose(scene, things, cutouts, np.flatnonzero(bare), rng)
    return moved, _move_poses(demo, cutouts, pick, place) if demo.acts else demo


def _thing_at(things: Sequence[Thing], pixel: tuple[int, int]) -> int | None:
    return next((i for i, thing in enumerate(things) if thing.mask[pixel]), None)


def _place_things(
    scene: Heightmap, things: Sequence[Thing], taken: NDArray[np.bool_], rng: np.random.Generator
) -> list[Cutout | None] | None:
    """Put each thing on a free place; None for a thing that stays, None instead of a list if one finds no place.

    taken: (H, W), True at pixels that are not free; the things' new pixels are added to it.
    """
    for thing in things:
        if not thing.movable:
            taken |= thing.mask
    cutouts: list[Cutout | None] = []
    for thing in things:
        if not thing.movable:
            cutouts.append(None)
            continue
        cutout = _find_free_place(_cut_out_turned(scene, thing, rng), taken, rng)
        if cutout is None:
            return None
        taken[cutout.rows, cutout.cols] |= cutout.mask
        cutouts.append(cutout)
    return cutouts


def _cut_out_turned(scene: Heightmap, thing: Thing, rng: np.random.Generator) -> Cutout:
    """Return a thing turned by a random angle, in the picture's corner."""
    top, left, bottom, right = _bounds(thing.mask)
    angle = rng.uniform(-math.pi, math.pi)
    cos, sin = math.cos(angle), math.sin(angle)
    turn = np.array([[cos, -sin], [sin, cos]])
    side = math.ceil(math.hypot(bottom - top, right - left)) + 1
    middle = np.array([(right - left - 1) / 2, (bottom - top - 1) / 2])
    matrix = np.column_stack((turn, (side - 1) / 2 - turn @ middle))
    crop = (slice(top, bottom), slice(left, right))

    def warp(image: NDArray[np.generic]) -> cv2.typing.MatLike:
        return cv2.warpAffine(image[crop], matrix, (side, side), flags=cv2.INTER_NEAREST)  # type: ignore[arg-type]

    mask = warp(thing.mask.astype(np.uint8)).astype(bool)
    first_row, first_col, last_row, last_col = _bounds(mask)
    kept = (slice(first_row, last_row), slice(first_col, last_col))
    whole = np.column_stack((turn, matrix[:, 2] - turn @ (left, top) - (first_col, first_row)))
    return Cutout(
        PlanarTransform(angle, whole),
        slice(0, last_row - first_row),
        slice(0, last_col - first_col),
        mask[kept],
        warp(scene.color)[kept].astype(np.uint8),
        warp(scene.height)[kept].astype(np.float32),
        warp(scene.valid.astype(np.uint8))[kept].astype(bool),
    )


def _bounds(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Return the first row and column in which a mask is True, and the first ones after its last."""
    rows, cols = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return int(rows[0]), int(cols[0]), int(rows[-1]) + 1, int(cols[-1]) + 1


def _find_free_place(cutout: Cutout, taken: NDArray[np.bool_], rng: np.random.Generator) -> Cutout | None:
    height, width = cutout.mask.shape
    last = (taken.shape[0] - height, taken.shape[1] - width)  # last row and column to begin at
    if min(last) < 0:
        return None
    for row, col in rng.integers(0, np.array(last) + 1, (_TRIES, 2)).tolist():
        rows, cols = slice(row, row + height), slice(col, col + width)
        if not (taken[rows, cols] & cutout.mask).any():
            matrix = cutout.transform.matrix + np.array([[0, 0, col], [0, 0, row]])
            return cutout._replace(transform=PlanarTransform(cutout.transform.angle, matrix), rows=rows, cols=cols)
    return None


def _compose(
    scene: Heightmap,
    things: Sequence[Thing],
    cutouts: Sequence[Cutout | None],
    bare: NDArray[np.intp],
    rng: np.random.Generator,
) -> Heightmap:
    """Return the scene with its things moved.

    bare: flat indices of pixels of the bare table, which fill the places that the things have left.
    """
    color, height, valid = scene.color.copy(), scene.height.copy(), scene.valid.copy()
    left = np.zeros_like(valid)
    for thing, cutout in zip(things, cutouts, strict=True):
        left |= thing.mask & (cutout is not None)
    table = rng.choice(bare, int(left.sum()))
    color[left], height[left], valid[left] = scene.color.reshape(-1, 3)[table], scene.height.ravel()[table], True
    for cutout in cutouts:
        if cutout is not None:
            for whole, part in ((color, cutout.color), (height, cutout.height), (valid, cutout.valid)):
                whole[cutout.rows, cutout.cols][cutout.mask] = part[cutout.mask]
    return dataclasses.replace(scene, color=color, height=height, valid=valid)


def _move_poses(
    demo: Demonstration, cutouts: Sequence[Cutout | None], pick: int | None, place: int | None
) -> Demonstration:
    """Move the poses with the things that they are on.

    pick, place: the things' numbers; None for a pose on the table, which stays.
    """
    pick_transform, place_transform = _transform_of(cutouts, pick), _transform_of(cutouts, place)
    return dataclasses.replace(
        demo,
        pick_pixel=_round(pick_transform.pixel(demo.pick_pixel)),
        pick_yaw=demo.pick_yaw + pick_transform.angle,
        place_pixel=_round(place_transform.pixel(demo.place_pixel)),
        place_yaw=demo.place_yaw + place_transform.angle,
    )


def _transform_of(cutouts: Sequence[Cutout | None], number: int | None) -> PlanarTransform:
    cutout = None if number is None else cutouts[number]
    return identity_transform() if cutout is None else cutout.transform


def _round(pixel: tuple[float, float]) -> tuple[int, int]:
    return round(pixel[0]), round(pixel[1])
