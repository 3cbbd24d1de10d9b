"""One model, one planner and the usual table, shared by the tests."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
import numpy.typing as npt
import pytest
from planned_once import PlannedOnce
from synthetic_clouds import CAMERA
from walls import scene_with_wall

from cliport_core.workspace import WorkspaceSpec
from panda_executor.config import AfterFailure, ExecutorConfig, SearchConfig
from panda_executor.hand_geometry import HandShape
from panda_executor.model import PandaModel
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.scene import Scene
from panda_executor.transfer import TransferPlanner

# the logic is tested without any build; these need the built messages
collect_ignore = (
    []
    if find_spec("cliport_interfaces")
    else [
        "test_action_arm.py",
        "test_action_call.py",
        "test_action_gripper.py",
        "test_conversions.py",
        "test_goal_session.py",
        "test_guard_node.py",
        "test_node.py",
        "test_person_services.py",
    ]
)


def make_planner(kind: Callable[[PandaModel, ExecutorConfig], TransferPlanner]) -> TransferPlanner:
    """A planner whose searches end by their number of checks, not by the clock: the same on a busy machine."""
    config = ExecutorConfig(search=SearchConfig(time_limit=60.0), planning_time=60.0, after_failure=AfterFailure.STAY)
    planner = kind(PandaModel(), config)
    planner.place_cameras(CAMERA)
    return planner


@pytest.fixture(scope="session")
def planner() -> TransferPlanner:
    """One that plans whatever it is asked for."""
    return make_planner(TransferPlanner)


@pytest.fixture(scope="session")
def planned_once() -> TransferPlanner:
    """One that remembers its plans, for what is not about planning."""
    return make_planner(PlannedOnce)


@pytest.fixture(scope="session")
def model(planner: TransferPlanner) -> PandaModel:
    """The planner's model, with table, camera and post around it."""
    return planner.model


@pytest.fixture(scope="session")
def workspace() -> WorkspaceSpec:
    return WorkspaceSpec()


@pytest.fixture(scope="session")
def free_scene(planner: TransferPlanner, workspace: WorkspaceSpec) -> Scene:
    """The open hand over an empty table."""
    return planner.scene(ObstacleGrid.empty(workspace), HandShape(planner.config.hand))


@pytest.fixture(scope="session")
def table_cloud() -> npt.NDArray[np.float32]:
    """A cube at (0.45, 0.1) turned by 0.3 rad, a bowl at (0.5, -0.2)."""
    from synthetic_clouds import Bowl, Cube, cloud_of

    return cloud_of([Cube(0.45, 0.1, 0.3)], [Bowl(0.5, -0.2)])


@pytest.fixture
def walled(planner: TransferPlanner) -> Scene:
    """A wall along x across the workspace, 15 cm high."""
    return scene_with_wall(planner, 0.3, 0.75, 0.15)
