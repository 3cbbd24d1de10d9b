"""Publishes the joints as the arm measured them, with the time at which it did."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue

import numpy as np
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState

from cliport_core import topics
from panda_driver.hand import Hand
from panda_driver.ports import ArmState
from panda_driver.state_clock import StateClock
from panda_model import ArmModel
from sim_bridge.conversions import joint_state_to_msg, time_to_msg

_OLD_S = 0.25  # above this age of the states somebody is told
_APART_S = 2e-4  # two clocks that were read within this were read at once
_MOST_READINGS = 10
_MOST_WAITING = 20  # states; further ones are left out while the publisher is held up


class StatePublisher:
    """Publishes joint states, at most at a rate [Hz], each measurement once, in a thread of its own.

    Middleware may hold a publisher up for half a second where a subscriber is slow; the arm's thread does not wait.

    Stamps are ROS time at the measurement, told by the arm's own clock (StateClock). With `own_time` they are that
    clock's time itself, which becomes the graph's (/clock). Fingers whose state is old are left out: whoever needs
    them sees that theirs age.
    """

    def __init__(self, node: Node, robot: ArmModel, hand: Hand | None, rate: float, own_time: bool) -> None:
        self._node, self._robot, self._hand, self._period = node, robot, hand, 1.0 / rate
        self._states = node.create_publisher(JointState, topics.JOINT_STATES, 10)
        self._clock = node.create_publisher(ClockMessage, topics.CLOCK, 10) if own_time else None
        self._state_clock = StateClock()
        self._due = 0.0
        self._last_fault, self._told_old = "", False
        self._taken: SimpleQueue[Callable[[], None] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, name="states", daemon=True)
        self._thread.start()

    def take(self, state: ArmState) -> None:
        """Have a state published that is new, and a fault logged that is."""
        if state.fault and state.fault != self._last_fault:
            fault = state.fault
            self._taken.put(lambda: self._tell(fault))
        self._last_fault = state.fault
        now = time.monotonic()
        age = self._state_clock.age(state.time, now)
        if age is None or now < self._due or self._taken.qsize() >= _MOST_WAITING:
            return
        self._due = max(self._due, now - self._period) + self._period  # a late turn does not make the next ones rarer
        self._taken.put(lambda: self._pass_on(state, age, now))

    def stop_thread(self) -> None:
        """Publish what was taken, and end the thread."""
        self._taken.put(None)
        self._thread.join(2.0)

    def _run(self) -> None:
        while (publish := self._taken.get()) is not None:
            with suppress(RuntimeError, InvalidHandle):  # the node ends
                publish()

    def _tell(self, fault: str) -> None:
        self._node.get_logger().error(fault)

    def _pass_on(self, state: ArmState, age: float, taken_at: float) -> None:
        if self._clock is not None:
            stamp = state.time
            self._clock.publish(ClockMessage(clock=time_to_msg(stamp)))
        else:
            stamp = self._ros_time_at(taken_at - age)
            self._warn_of(age)
        self._publish(state, stamp)

    def _ros_time_at(self, moment: float) -> float:
        """Return ROS time [s] at a moment [s, steady clock]. Both are read again where something ran in between."""
        readings: list[tuple[float, float]] = []
        for _ in range(_MOST_READINGS):
            before = time.monotonic()
            ros_time = self._node.get_clock().now().nanoseconds * 1e-9
            apart = time.monotonic() - before
            readings.append((apart, ros_time - before))
            if apart < _APART_S:
                break
        return moment + min(readings)[1]

    def _publish(self, state: ArmState, stamp: float) -> None:
        robot, names, rest = self._robot, self._robot.arm_joints, np.zeros(0)
        positions = state.positions
        if self._hand is not None and self._hand.is_fresh():
            names, rest = robot.joints, np.zeros(len(robot.finger_joints))
            positions = np.concatenate([positions, rest + self._hand.state.width / 2.0])
        velocities, efforts = np.concatenate([state.velocities, rest]), np.concatenate([state.efforts, rest])
        self._states.publish(joint_state_to_msg(names, positions, velocities, efforts, stamp))

    def _warn_of(self, age: float) -> None:
        """Say once that the states come late, and once more where they do so anew."""
        if age > _OLD_S and not self._told_old:
            self._node.get_logger().warning(
                f"the arm's states are {age:.2f} s old by its own clock: look at the network; a simulator that is "
                "slower than real time needs -p publish_clock:=true"
            )
        self._told_old = age > _OLD_S
