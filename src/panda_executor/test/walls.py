"""A wall on the table, and configurations beside it."""

from __future__ import annotations

import numpy as np

from cliport_core.workspace import WorkspaceSpec
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.scene import Scene
from panda_executor.transfer import TransferPlanner
from panda_model import FloatArray, load_preset


def above(planner: TransferPlanner, x: float, y: float, z: float) -> FloatArray:
    return planner.ik.solve_all(hand_down_pose(x, y, z, 0.0), load_preset().ready)[0].positions


def scene_with_wall(planner: TransferPlanner, x_min: float, x_max: float, height: float) -> Scene:
    x, z = np.meshgrid(np.arange(x_min, x_max, 0.002), np.arange(0.0, height, 0.01))
    wall = [np.stack([x, 0 * x + y, z], axis=-1).reshape(-1, 3) for y in np.arange(-0.006, 0.007, 0.003)]
    cloud = np.concatenate(wall).astype(np.float32)
    return planner.scene(ObstacleGrid.from_cloud(cloud, WorkspaceSpec(), 0.012), HandShape(load_preset().hand))
