"""Heightmaps of a perfect camera beside the scene's true surface, found by rays from straight above."""

from __future__ import annotations

import numpy as np
import pybullet
import pytest
from scipy import ndimage

from cliport_benchmark.observer import Observer
from cliport_core import Heightmap
from sim_bridge.rendering.sensor_noise import SensorKind
from sim_bridge.scene import reset_scene
from sim_bridge.world import SimWorld

TASKS = ("put-blocks-in-bowls-seen-colors", "packing-box-pairs-seen-colors", "towers-of-hanoi-seq-seen-colors")
TOP = 0.5  # from which rays fall [m]
FLAT = 0.002  # a surface whose neighbouring cells differ by less has no edge there [m]


def struck(world: SimWorld, starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Where rays (N, 3) to (N, 3) first meet anything (N, 3) [m]; their end where they do not."""
    found = []
    most = pybullet.MAX_RAY_INTERSECTION_BATCH_SIZE - 1
    for i in range(0, len(starts), most):
        hits = pybullet.rayTestBatch(
            starts[i : i + most].tolist(), ends[i : i + most].tolist(), physicsClientId=world.client
        )
        found += [hit[3] if hit[0] >= 0 else end for hit, end in zip(hits, ends[i : i + most].tolist())]
    return np.array(found)


def truth(world: SimWorld, heightmap: Heightmap, camera: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights (rows, cols) [m] of the surface in each cell's middle, and which of these the camera sees."""
    spec = heightmap.workspace
    rows, cols = np.mgrid[0 : spec.rows, 0 : spec.cols]
    x = spec.x_min + (cols + 0.5) * spec.pixel_size
    y = spec.y_min + (rows + 0.5) * spec.pixel_size
    above = np.stack([x, y, np.full(spec.shape, TOP)], axis=-1).reshape(-1, 3)
    surface = struck(world, above, above * [1, 1, 0] - [0, 0, 0.05])
    surface[:, 2] = np.maximum(surface[:, 2], 0.0)
    lines = struck(world, np.broadcast_to(camera, surface.shape), surface)
    seen = np.linalg.norm(lines - surface, axis=1) < 0.003
    return surface[:, 2].reshape(spec.shape), seen.reshape(spec.shape)


@pytest.mark.parametrize("task", TASKS)
def test_seen_tops_and_table_are_as_high_as_they_are_and_what_is_hidden_is_a_hole(task: str) -> None:
    world = SimWorld()
    reset_scene(world, task, "val", 2)
    observer = Observer(world.config, n_threads=1, camera_kind=SensorKind.PERFECT)
    heightmap = observer.observe(world)
    height, seen = truth(world, heightmap, observer.camera.camera_in_base.translation)
    world.close()
    edges = ndimage.maximum_filter(height, 5) - ndimage.minimum_filter(height, 5) > FLAT
    table, tops = (height <= 0.001) & seen & ~edges, (height > 0.001) & seen & ~edges
    assert table.sum() > 20_000 and tops.sum() > 300
    for cells in (table, tops):
        assert heightmap.valid[cells].mean() > 0.99
        off = np.abs(heightmap.height - height)[cells & heightmap.valid]
        assert off.mean() < 0.0005 and np.percentile(off, 99.0) < 0.001
    # Well within a shadow; at its rim a cell is half seen.
    hidden = ndimage.binary_erosion(~seen & ~edges, iterations=2)
    assert hidden.sum() > 50
    assert heightmap.valid[hidden].mean() < 0.05
