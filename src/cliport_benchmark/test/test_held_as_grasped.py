"""Where the policy expects jaws to hold a piece the executor grasps it; neither package may import the other."""

import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cliport_core.heightmap import Heightmap
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.observation import observation_tensor
from cliport_policy.shapes.prints import outline_at
from panda_executor.grasp import plan_grasps

SPEC = WorkspaceSpec()
PICK = (160, 80)  # (row, col)
TALL = 0.02  # of pieces [m]
LETTER_L = np.array([(-12, -9), (12, -9), (12, -2), (-4, -2), (-4, 9), (-12, 9)])  # (row, col) from the pick
TRIANGLE = np.array([(-12, -9), (12, -2), (-4, 9)])
BAR = np.array([(-12, -4), (-12, 4), (12, 4), (12, -4)])


@pytest.mark.parametrize("shape", [LETTER_L, TRIANGLE, BAR], ids=["letter L", "triangle", "bar"])
@pytest.mark.parametrize("turn", [0.0, 0.3, 1.0, 2.2])
@pytest.mark.parametrize("off", [-0.1, 0.0, 0.1])
def test_a_piece_is_expected_to_be_held_where_it_is_grasped(shape: NDArray[np.int64], turn: float, off: float) -> None:
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    corners = np.rint(shape @ rotation.T + PICK).astype(np.int32)
    height = np.zeros(SPEC.shape, np.float32)
    cv2.fillPoly(height, [np.ascontiguousarray(corners[:, ::-1])], TALL)
    color = np.full((*SPEC.shape, 3), 120, np.uint8)
    image = observation_tensor(Heightmap(color, height, np.ones(SPEC.shape, np.bool_), SPEC))
    outline = outline_at(image, PICK, turn + off, SPEC.pixel_size)
    assert outline is not None

    xy = [SPEC.pixel_to_xy(row, col) for row in range(SPEC.rows) for col in range(SPEC.cols)]
    cloud = np.column_stack([np.array(xy), height.ravel()]).astype(np.float32)
    pick = PlanarPose(*SPEC.pixel_to_xy(*PICK), outline.yaw)
    planned = next(grasp for grasp in plan_grasps(cloud, pick, SPEC) if math.isclose(grasp.yaw, outline.yaw))
    expected = SPEC.pixel_to_xy(*(outline.held + PICK))
    assert math.dist(expected, planned.centroid[:2]) < 1.5 * SPEC.pixel_size
