"""Clouds as a tilted camera would see them: only the faces that look at it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

CAMERA = np.array([0.92, 0.0, 0.87])


@dataclass(frozen=True)
class Cube:
    """Standing on z at (x, y), turned by yaw; edges [m]."""

    x: float
    y: float
    yaw: float = 0.0
    size: tuple[float, float, float] = (0.04, 0.04, 0.04)
    z: float = 0.0


@dataclass(frozen=True)
class Bowl:
    """A round bowl; sizes of the benchmark's [m]."""

    x: float
    y: float
    outer: float = 0.057
    inner_rim: float = 0.052
    inner_floor: float = 0.045
    floor: float = 0.008
    height: float = 0.035


def cube_points(cube: Cube, spacing: float = 0.0015) -> npt.NDArray[np.float64]:
    """Points on the faces that are turned to the camera."""
    sx, sy, sz = cube.size
    axes = [np.arange(-s / 2, s / 2 + 1e-9, spacing) for s in (sx, sy, sz)]
    faces = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = [a for i, a in enumerate(axes) if i != axis]
            grid = np.stack(np.meshgrid(u, v, indexing="ij"), -1).reshape(-1, 2)
            points = np.insert(grid, axis, sign * cube.size[axis] / 2, axis=1)
            normal = np.zeros(3)
            normal[axis] = sign
            faces.append((points, normal))
    c, s = np.cos(cube.yaw), np.sin(cube.yaw)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    centre = np.array([cube.x, cube.y, cube.z + sz / 2])
    seen = [
        points @ rotation.T + centre
        for points, normal in faces
        if (rotation @ normal) @ (CAMERA - centre) > 0.02 * np.linalg.norm(CAMERA - centre)
    ]
    return np.concatenate(seen)


def bowl_points(bowl: Bowl, spacing: float = 0.0015) -> npt.NDArray[np.float64]:
    """Floor, inner wall, rim and outer wall, all of them."""
    r = np.arange(0.0, bowl.outer + 1e-9, spacing)
    points = []
    for radius in r:
        if radius <= bowl.inner_floor:
            z = bowl.floor
        elif radius <= bowl.inner_rim:
            share = (radius - bowl.inner_floor) / (bowl.inner_rim - bowl.inner_floor)
            z = bowl.floor + share * (bowl.height - bowl.floor)
        else:
            z = bowl.height
        angle = np.arange(0.0, 2 * np.pi, spacing / max(radius, spacing))
        points.append(np.stack([bowl.x + radius * np.cos(angle), bowl.y + radius * np.sin(angle), 0 * angle + z], -1))
    return np.concatenate(points)


def table_points(spacing: float = 0.004) -> npt.NDArray[np.float64]:
    """The whole table, also under things."""
    x, y = np.meshgrid(np.arange(0.2, 0.7, spacing), np.arange(-0.45, 0.45, spacing), indexing="ij")
    return np.stack([x, y, 0 * x], -1).reshape(-1, 3)


def cloud_of(
    cubes: Sequence[Cube],
    bowls: Sequence[Bowl] = (),
    noise: float = 0.0,
    seed: int = 0,
) -> npt.NDArray[np.float32]:
    """Everything on a table, with depth noise [m] along the camera's rays and some NaN."""
    table = table_points()
    for cube in cubes:
        near = np.hypot(table[:, 0] - cube.x, table[:, 1] - cube.y) < max(cube.size[:2]) * 0.72
        table = table[~near]
    for bowl in bowls:
        table = table[np.hypot(table[:, 0] - bowl.x, table[:, 1] - bowl.y) > bowl.outer]
    cloud = np.concatenate([table, *(cube_points(c) for c in cubes), *(bowl_points(b) for b in bowls)])
    random = np.random.default_rng(seed)
    if noise:
        rays = cloud - CAMERA
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        cloud = cloud + rays * random.normal(0.0, noise, (len(cloud), 1))
    holes = np.full((len(cloud) // 20, 3), np.nan)
    return np.concatenate([cloud, holes]).astype(np.float32)


def figure_points(x: float, y: float, spacing: float = 0.0015) -> npt.NDArray[np.float64]:
    """A figure 7 by 3.6 cm: a back of 4 cm, and a head of 6 cm that rises from it without a step."""
    along, across = np.meshgrid(np.arange(-0.035, 0.035, spacing), np.arange(-0.018, 0.018, spacing), indexing="ij")
    height = 0.04 + 0.02 * np.clip((along - 0.005) / 0.02, 0.0, 1.0)
    return np.stack([x + along, y + across, height], axis=-1).reshape(-1, 3)


def ring_points(
    x: float, y: float, z: float, outer: float, hole: float = 0.015, height: float = 0.02, spacing: float = 0.0015
) -> npt.NDArray[np.float64]:
    """A ring of radii `outer` and `hole` [m] standing on z: its top and both walls. A hole of 0 makes a peg."""
    points = []
    for radius in np.arange(hole, outer + 1e-9, spacing):
        angle = np.arange(0.0, 2 * np.pi, spacing / max(radius, spacing))
        circle = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], -1)
        walls = [0.0] if spacing / 2 < radius - hole and radius < outer - spacing else np.arange(0.0, height, spacing)
        points += [np.column_stack([circle, np.full(len(circle), z + height - depth)]) for depth in walls]
    return np.concatenate(points)


def ball_points(x: float, y: float, z: float, radius: float = 0.0075) -> npt.NDArray[np.float64]:
    """A ball about (x, y, z)."""
    steps = np.arange(400) + 0.5
    height, turn = 1.0 - steps / 200.0, np.pi * (1.0 + np.sqrt(5.0)) * steps
    flat = np.sqrt(1.0 - height**2)
    return np.array([x, y, z]) + radius * np.stack([flat * np.cos(turn), flat * np.sin(turn), height], -1)


def container_points(x: float, y: float, width: float, depth: float, yaw: float = 0.0) -> npt.NDArray[np.float64]:
    """An open box of outer size width x depth [m], 50 mm tall, of 2 mm sheets."""
    c, s = np.cos(yaw), np.sin(yaw)
    sheets = [
        (0.0, 0.0, width, depth, 0.002),
        (-width / 2, 0.0, 0.002, depth, 0.05),
        (width / 2, 0.0, 0.002, depth, 0.05),
        (0.0, -depth / 2, width, 0.002, 0.05),
        (0.0, depth / 2, width, 0.002, 0.05),
    ]
    cubes = [Cube(x + c * dx - s * dy, y + s * dx + c * dy, yaw, (w, d, h)) for dx, dy, w, d, h in sheets]
    return np.concatenate([cube_points(cube) for cube in cubes])


def seen_cloud(*things: npt.NDArray[np.float64], noise: float = 0.001, seed: int = 0) -> npt.NDArray[np.float32]:
    """Things (N, 3) on a table without what is hidden from the camera, with depth noise [m] and some NaN."""
    cloud = np.concatenate([table_points(0.002), *things])
    rays = cloud - CAMERA
    distance = np.linalg.norm(rays, axis=1)
    rays /= distance[:, None]
    # one of these pixels is wider than the points are apart
    pixel = np.floor(np.stack([rays[:, 0] / -rays[:, 2], rays[:, 1] / -rays[:, 2]], -1) / 0.003).astype(np.int64)
    row, column = (pixel - pixel.min(axis=0)).T
    index = row * (column.max() + 1) + column
    nearest = np.full(index.max() + 1, np.inf)
    np.minimum.at(nearest, index, distance)
    visible = distance < nearest[index] + 0.004
    random = np.random.default_rng(seed)
    cloud = (cloud + rays * random.normal(0.0, noise, (len(cloud), 1)))[visible]
    holes = np.full((len(cloud) // 20, 3), np.nan)
    return np.concatenate([cloud, holes]).astype(np.float32)
