"""The second look at trajectories sees what it is to see."""

from __future__ import annotations

import numpy as np
import pytest
from recheck import recheck_clearance

from cliport_core import WorkspaceSpec
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose
from panda_executor.model import PandaModel
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.transfer import TransferPlanner


@pytest.mark.parametrize(("height", "clear"), [(0.35, False), (0.15, True)])
def test_what_stands_within_the_plans_margin_is_found(height: float, clear: bool) -> None:
    """A column 5 mm beside the way of a hand that is to keep a centimetre off, or ends below it."""
    planner = TransferPlanner(PandaModel())
    hand = HandShape(planner.config.hand, margin=planner.config.clearance)
    empty = planner.scene(ObstacleGrid.empty(WorkspaceSpec()), hand)
    ends = [planner.ik.solve_all(hand_down_pose(0.5, y, 0.2, 0.0), planner.ready)[0].positions for y in (-0.05, 0.05)]
    motion = planner.motions.travel(Phase.CARRY, *ends, empty)
    recheck_clearance(motion.trajectory, empty)
    reach = np.array([hand.points @ empty.model.tcp_arrays(q)[0].T + empty.model.tcp_arrays(q)[1] for q in ends])
    side = float(reach[..., 0].max()) - planner.config.clearance + 0.005
    column = np.repeat([[side + 0.005, 0.0, height]], 5, axis=0).astype(np.float32)
    among = empty.with_grid(ObstacleGrid.from_cloud(column, WorkspaceSpec(), 0.012))
    if clear:
        recheck_clearance(motion.trajectory, among)
    else:
        with pytest.raises(AssertionError, match="would touch what stands near"):
            recheck_clearance(motion.trajectory, among)
