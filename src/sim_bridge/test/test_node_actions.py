"""An action server's goals when the simulation ends under them."""

import logging

import pytest
from played_faults import played_faults

pytest.importorskip("rclpy", exc_type=ImportError)
pytest.importorskip("control_msgs", exc_type=ImportError)

from sim_bridge.control.joint_trajectory_controller import TrajectoryExecution
from sim_bridge.control.trajectory_goal import TrajectoryGoal
from sim_bridge.errors import SimulationError
from sim_bridge.node_controllers import ArmAction


class EndedLoop:
    """A loop that has stopped by the time its feedback is wanted."""

    def __init__(self, execution):
        self.execution, self.calls = execution, 0

    def call(self, function):
        self.calls += 1
        if self.calls > 1:
            raise SimulationError("the simulation has stopped")
        return self.execution

    def wait(self, execution, timeout):
        return False


class Handle:
    is_cancel_requested = False
    request = object()

    def __init__(self, node_is_gone):
        self.aborted, self._gone = False, node_is_gone
        self.goal_id = type("Id", (), {"uuid": [0] * 16})()

    def abort(self):
        self.aborted = True
        if self._gone:
            raise RuntimeError("the server is gone")


@pytest.mark.parametrize("node_is_gone", [False, True])
def test_a_simulation_that_ends_in_mid_motion_aborts_the_goal(node_is_gone, monkeypatch):
    execution = TrajectoryExecution(TrajectoryGoal((), ()))
    action = ArmAction.__new__(ArmAction)
    action._loop, action._name, action._logger = EndedLoop(execution), "arm", logging.getLogger("test")
    action._executions, action._decoded = {}, {}
    action._faults = played_faults()
    monkeypatch.setattr(action, "_decode", lambda request: execution.goal)
    handle = Handle(node_is_gone)
    action._execute(handle)  # used to raise out of the goal's thread
    assert handle.aborted and not action._executions
