"""The points of a cloud that matter: over the workspace and around it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cliport_core.workspace import WorkspaceSpec


def points_over(cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec) -> npt.NDArray[np.float32]:
    """Return the points (N, 3) over and around the workspace, whatever their height; NaN are dropped."""
    border = 0.12
    near = (cloud[:, 0] > workspace.x_min - border) & (cloud[:, 0] < workspace.x_max + border)
    near &= (cloud[:, 1] > workspace.y_min - border) & (cloud[:, 1] < workspace.y_max + border)
    near &= cloud[:, 2] > workspace.z_min - 0.02
    return cloud.take(np.flatnonzero(near), axis=0)


def relevant_points(cloud: npt.NDArray[np.float32], workspace: WorkspaceSpec) -> npt.NDArray[np.float32]:
    """Return the points (N, 3) of what may be grasped: over and around the workspace, up to its z_max."""
    near = points_over(cloud, workspace)
    return near[near[:, 2] <= workspace.z_max]
