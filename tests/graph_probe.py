"""A probe for the graph tests, beyond a user's client: direct goals, fault injection, and motion over time."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, Pose, Quaternion
from numpy.typing import NDArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from cliport_benchmark.graph_client import GraphClient
from cliport_core import topics
from cliport_core.heartbeat import Heartbeat
from cliport_interfaces.action import MoveHand, PickPlace

STILL = 0.005  # rad/s: below this the arm counts as standing still
_OWNER = "graph_probe"
_KEPT = 5000  # joint states that are remembered, 100 s of the simulator's


class GraphProbe(GraphClient):
    """A graph client that can also do what only tests do."""

    def __init__(self, domain_id: int) -> None:
        super().__init__("graph_probe", domain_id)
        self._history: deque[tuple[float, float]] = deque(maxlen=_KEPT)  # (wall time, fastest joint in rad/s)
        self._positions: dict[str, float] = {}
        self._hears_truth = False  # joint states are spoiled by a fault, and the simulator tells the true ones
        self._node.create_subscription(JointState, topics.JOINT_STATES, self._on_states, qos_profile_sensor_data)
        self._node.create_subscription(JointState, topics.SIM_TRUE_JOINTS, self._on_truth, qos_profile_sensor_data)
        self._phases: list[tuple[float, str]] = []  # (wall time, name) of each that the executor entered
        self._node.create_subscription(
            PickPlace.Impl.FeedbackMessage, "/panda_executor/pick_place/_action/feedback", self._note_phase, 10
        )
        beats = self._node.create_publisher(String, topics.OWNER_HEARTBEAT, 10)
        self._heart = Heartbeat(lambda: beats.publish(String(data=_OWNER)))
        self._pick_place = ActionClient(self._node, PickPlace, "/panda_executor/pick_place")
        self._move_hand = ActionClient(self._node, MoveHand, "/panda_executor/move_hand")
        self._parameters = self._node.create_client(SetParameters, "/sim_bridge/set_parameters")
        self._triggers = {
            name: self._node.create_client(Trigger, name)
            for name in (
                *("/cliport/stop", "/cliport/resume", "/panda_executor/stop", "/panda_executor/resume"),
                "/panda_executor/ready",
            )
        }

    def __exit__(self, *error: object) -> None:
        self._heart.stop()
        super().__exit__(*error)

    def trigger(self, name: str) -> str:
        """Call one of the Trigger services; its message."""
        return str(self._call(self._triggers[name], Trigger.Request(), 5.0).message)

    def set_sim_parameter(self, name: str, value: bool | Sequence[float]) -> None:
        """Switch one of the simulator's faults on or off, or give it its numbers."""
        if isinstance(value, bool):
            given = ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
        else:
            given = ParameterValue(type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=list(value))
        parameter = Parameter(name=name, value=given)
        response = self._call(self._parameters, SetParameters.Request(parameters=[parameter]), 5.0)
        assert response.results[0].successful, response.results[0].reason

    def send_pick_place(self, pick: tuple[float, float], place: tuple[float, float]) -> Any:
        """Send a goal at table height; the goal handle."""
        return self._send(PickPlace.Goal(instruction="test", pick=_pose(pick), place=_pose(place), owner=_OWNER))

    def send_plan(self, pick: Sequence[Sequence[float]], place: Sequence[Sequence[float]]) -> Any:
        """Ask for a plan alone between two poses, each a position (3,) and a quaternion (4,); the goal handle."""
        return self._send(PickPlace.Goal(instruction="test", plan_only=True, pick=_pose(*pick), place=_pose(*place)))

    def send_hand(self, x: float, y: float, z: float, plan_only: bool = False) -> Any:
        """Send the hand, pointing down, to a place over the table; the goal handle."""
        target = _pose((x, y, z), (1.0, 0.0, 0.0, 0.0))
        return self._send(MoveHand.Goal(target=target, plan_only=plan_only, owner=_OWNER), self._move_hand)

    def _send(self, goal: Any, action: ActionClient | None = None) -> Any:
        action = action or self._pick_place
        assert action.wait_for_server(5.0)
        goal.header.frame_id = "panda_link0"
        return self._answer_of(lambda: action.send_goal_async(goal), 5.0)

    def result_of(self, handle: Any, timeout: float = 60.0) -> Any:
        """The result message of an accepted goal."""
        assert handle.accepted
        return self._answer_of(handle.get_result_async, timeout).result

    def cancel(self, handle: Any) -> None:
        self._wait(handle.cancel_goal_async(), 5.0)

    def wait_moving(self, timeout: float = 15.0) -> float:
        """Wall time at which the arm was seen to move, after now."""
        return self._wait_speed(lambda speed: speed > 10 * STILL, time.monotonic(), timeout)

    def wait_phase(self, name: str, timeout: float) -> float:
        """Wall time at which the executor said that it is in a phase, after now."""
        since, deadline = time.monotonic(), time.monotonic() + timeout
        while time.monotonic() < deadline:
            for stamp, phase in list(self._phases):
                if stamp >= since and phase == name:
                    return stamp
            time.sleep(0.005)
        raise AssertionError(f"no {name} within {timeout} s; there were {[phase for _, phase in self._phases][-9:]}")

    def wait_still(self, since: float, timeout: float = 30.0, span: float = 0.3) -> float:
        """Wall time from which on the arm stood still for `span` seconds, after since."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            start = self._wait_speed(lambda speed: speed < STILL, since, timeout)
            time.sleep(span + 0.05)
            heard = [speed for stamp, speed in list(self._history) if start <= stamp <= start + span]
            if heard and max(heard) < STILL:  # silence is no standstill
                return start
            since = start + 0.02
        raise AssertionError(f"the arm still moves after {timeout} s")

    def fastest(self, since: float, patience: float = 10.0) -> float:
        """The fastest joint speed since a wall time, rad/s; fails where not all of that time was listened to.

        patience: how long to wait for the first joint state since then [s].
        """
        deadline = time.monotonic() + patience
        while not (heard := self._speeds(since)) and time.monotonic() < deadline:
            time.sleep(0.01)
        history = list(self._history)
        assert heard, "no joint state was heard since then"
        assert len(history) < _KEPT or history[0][0] < since, "what was heard first since then is forgotten"
        return max(heard)

    def _speeds(self, since: float) -> list[float]:
        return [speed for stamp, speed in list(self._history) if stamp >= since]

    def positions(self, names: list[str]) -> NDArray[np.float64]:
        """Return the joints' positions as they were last heard [rad]."""
        return np.array([self._positions[name] for name in names])

    def _wait_speed(self, wanted: Any, since: float, timeout: float) -> float:
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            for stamp, speed in list(self._history):
                if stamp >= since and wanted(speed):
                    return stamp
            time.sleep(0.01)
        raise AssertionError(f"the arm's speed did not become as expected within {timeout} s")

    def _answer_of(self, ask: Callable[[], Any], timeout: float) -> Any:
        """Ask in the thread that spins: from another one, rclpy may meet the answer before it knows of the question."""
        return self._wait(self._wait(self._node.executor.create_task(ask), 5.0), timeout)

    def _wait(self, future: Any, timeout: float) -> Any:
        deadline = time.monotonic() + timeout
        while not future.done():
            assert time.monotonic() < deadline, f"no answer within {timeout} s"
            time.sleep(0.01)
        return future.result()

    def _note_phase(self, message: Any) -> None:
        name = str(message.feedback.phase_name)
        if not self._phases or self._phases[-1][1] != name:
            self._phases.append((time.monotonic(), name))

    def _on_states(self, message: JointState) -> None:
        if not self._hears_truth:
            self._note_speed(message)

    def _on_truth(self, message: JointState) -> None:
        self._hears_truth = True
        self._note_speed(message)

    def _note_speed(self, message: JointState) -> None:
        arm = [v for name, v in zip(message.name, message.velocity, strict=False) if "finger" not in name]
        self._positions.update(zip(message.name, message.position, strict=False))
        self._history.append((time.monotonic(), float(np.abs(arm).max()) if arm else 0.0))


def _pose(at: Sequence[float], turn: Sequence[float] = (0.0, 0.0, 0.0, 1.0)) -> Pose:
    """A pose at x, y, and z where it is given [m]; turn: quaternion (x, y, z, w), of any length."""
    x, y, z = (*at, 0.0)[:3]
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(**dict(zip("xyzw", turn, strict=True))))
