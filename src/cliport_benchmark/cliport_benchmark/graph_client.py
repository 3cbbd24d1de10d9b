"""A user of the running graph: resets the scene, says what to do, watches what happens, reads the score."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import rclpy
from numpy.typing import NDArray
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

from cliport_benchmark.errors import BenchmarkError, SceneError
from cliport_benchmark.graph_episode import ENDED, Progress, check_not_stopped
from cliport_core import topics
from cliport_core.ros_running import SpinThread
from cliport_interfaces.msg import PolicyStatus
from cliport_interfaces.srv import GetScore, ResetTask
from sim_bridge.world import SimConfig

LATCHED = QoSProfile(depth=20, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
OVERLAYS = tuple(topics.AFFORDANCES.values())
MOTION_THRESHOLD = 0.01  # rad/s
_RESET_TIMEOUT = 40.0  # [s]; longer than the simulator's own, whose answer says more
_JUDGED_TIMEOUT = 120.0  # [s]; a simulator on a slow machine is slower than real time
_CLOCK_POLL = 0.02  # [s]
JUDGED_AFTER = SimConfig().max_settle_s + 0.5  # the simulator has judged an action by then [s of simulated time]


class Ended(NamedTuple):
    """End of an instruction: the last status, and seconds of wall time from publishing it."""

    succeeded: bool
    message: str
    steps: int
    wall_s: float
    first_motion_s: float | None


class GraphClient:
    """Talks to the graph through its public topics and services only. Use as a context manager."""

    def __init__(self, name: str = "graph_client", domain_id: int | None = None) -> None:
        self._context = rclpy.Context()
        self._context.init(domain_id=domain_id)
        self._node = rclpy.create_node(name, context=self._context)
        self._condition = threading.Condition()
        self._statuses: list[PolicyStatus] = []
        self._latest: dict[str, Image] = {}
        self._overlays: dict[str, list[Image]] = {topic: [] for topic in OVERLAYS}  # since the last reset
        self._first_motion: float | None = None
        self._last_motion = time.monotonic()
        self._watch_motion = False
        self._simulated_s: float | None = None
        self.max_steps = 0  # actions that the task of the last reset allows
        self.redraws = 0  # scenes that were drawn in vain before that one
        self.on_status: Callable[[PolicyStatus], None] = lambda _status: None
        self.on_frame: Callable[[NDArray[np.uint8]], None] = lambda _frame: None
        self._instruction = self._node.create_publisher(String, topics.INSTRUCTION, 5)
        self._reset = self._node.create_client(ResetTask, topics.SIM_RESET)
        self._score = self._node.create_client(GetScore, topics.SIM_SCORE)
        self._node.create_subscription(PolicyStatus, topics.STATUS, self._take_status, LATCHED)
        self._node.create_subscription(JointState, topics.JOINT_STATES, self._take_joints, qos_profile_sensor_data)
        self._node.create_subscription(Clock, topics.CLOCK, self._take_clock, qos_profile_sensor_data)
        for topic in (topics.COLOR, *OVERLAYS):
            take = partial(self._take_image, topic)
            self._node.create_subscription(Image, topic, take, 2)
        self._spinner = SpinThread(self._node, lambda _: None, self._context)

    def __enter__(self) -> GraphClient:
        return self

    def __exit__(self, *_: object) -> None:
        self._spinner.stop()
        self._node.destroy_node()
        self._context.try_shutdown()

    def wait_ready(self, timeout: float, alive: Callable[[], bool] = lambda: True) -> None:
        """Wait until the simulator's services, the policy's status and a camera image are there.

        Raises BenchmarkError, naming what is missing, after timeout seconds or when alive() turns false.
        """
        deadline = time.monotonic() + timeout
        while missing := self._missing():
            if not alive():
                raise BenchmarkError("the graph ended before it was ready")
            if time.monotonic() > deadline:
                raise BenchmarkError(f"the graph was not ready after {timeout:.0f} s: no {', no '.join(missing)}")
            time.sleep(0.1)

    def reset(self, task: str, split: str, seed: int, instruction: str = "", timeout: float = _RESET_TIMEOUT) -> str:
        """Make a scene and return the task's sentence for it. Raises SceneError with the simulator's own words."""
        request = ResetTask.Request(task=task, split=split, seed=seed, instruction=instruction)
        response = self._call(self._reset, request, timeout)
        if not response.success:
            raise SceneError(response.message)
        self.max_steps, self.redraws = int(response.max_steps), int(response.redraws)
        for images in self._overlays.values():
            images.clear()
        return str(response.instruction)

    def score(self, timeout: float = 10.0) -> float:
        """Return the simulator's own metric of the last action, 0 to 1; see `judged`."""
        return self.judged(timeout=timeout).score

    def judged(self, timeout: float = 10.0) -> Progress:
        """Wait as long as the simulator lets things come to rest, then return what the last action left.

        Raises BenchmarkError when the simulator's clock stands, or gives no answer within timeout seconds.
        """
        judged_at, deadline = self.simulated_time() + JUDGED_AFTER, time.monotonic() + _JUDGED_TIMEOUT
        while self.simulated_time() < judged_at:
            if time.monotonic() > deadline:
                raise BenchmarkError(f"the simulator's clock has not gone on by {JUDGED_AFTER:g} s")
            time.sleep(_CLOCK_POLL)
        return self.progress(timeout)

    def simulated_time(self) -> float:
        """Return the graph's time [s]: wall time where nobody publishes a clock, as beside a driven arm."""
        return time.monotonic() if self._simulated_s is None else self._simulated_s

    def progress(self, timeout: float = 10.0) -> Progress:
        """Return what the simulator has judged up to now."""
        response = self._call(self._score, GetScore.Request(), timeout)
        if not response.success:
            raise BenchmarkError(response.message)
        return Progress(float(response.score), bool(response.done), str(response.instruction), bool(response.broken))

    def newest_status(self) -> PolicyStatus | None:
        """Return the last status since the last instruction; None before there is one."""
        with self._condition:
            return self._statuses[-1] if self._statuses else None

    def instruct(self, text: str) -> None:
        """Publish an instruction; statuses seen before are forgotten."""
        with self._condition:
            self._statuses.clear()
            self._first_motion = None
            self._watch_motion = True
        self._instruction.publish(String(data=text))

    def instruct_and_wait(self, text: str, timeout: float, alive: Callable[[], bool] = lambda: True) -> Ended:
        """Send an instruction, wait until the policy says done or failed, and return that.

        Raises BenchmarkError after timeout seconds, or when somebody stopped the policy.
        """
        start = time.monotonic()
        self.instruct(text)
        stopped = PolicyStatus.STATE_IDLE
        status = self.wait_status(
            lambda s: s.state in ENDED or (s.state == stopped and s.instruction == text), timeout, alive
        )
        check_not_stopped(status)
        wall = time.monotonic() - start
        motion = None if self._first_motion is None else self._first_motion - start
        return Ended(status.state == PolicyStatus.STATE_DONE, status.message, status.step, wall, motion)

    def seconds_to_motion(self, text: str, timeout: float) -> float:
        """Send an instruction and return the seconds of wall time until a joint of the arm moves."""
        start = time.monotonic()
        self.instruct(text)
        while self._first_motion is None:
            if time.monotonic() - start > timeout:
                raise BenchmarkError(f"the arm did not move within {timeout:.0f} s: {self._last_message()}")
            time.sleep(0.002)
        return self._first_motion - start

    def wait_at_rest(self, timeout: float) -> None:
        """Wait until no joint has moved for half a second."""
        deadline = time.monotonic() + timeout
        while time.monotonic() - self._last_motion < 0.5:
            if time.monotonic() > deadline:
                raise BenchmarkError(f"the arm still moves after {timeout:.0f} s")
            time.sleep(0.05)

    def wait_status(
        self, wanted: Callable[[PolicyStatus], bool], timeout: float, alive: Callable[[], bool] = lambda: True
    ) -> PolicyStatus:
        """Wait for a status that is wanted and return the first since the last
        instruction. Raises BenchmarkError after timeout."""
        deadline = time.monotonic() + timeout
        with self._condition:
            while True:
                for status in self._statuses:
                    if wanted(status):
                        return status
                left = deadline - time.monotonic()
                if left <= 0 or not alive():
                    reason = f"no such status within {timeout:.0f} s" if left <= 0 else "the graph ended"
                    raise BenchmarkError(f"{reason}; the last status was: {self._last_message()}")
                self._condition.wait(min(left, 0.5))

    def camera_image(self) -> NDArray[np.uint8]:
        """Return the newest colour image, (rows, cols, 3) RGB; there is one once wait_ready has returned."""
        return _to_array(self._latest[topics.COLOR])

    def overlays(self, topic: str) -> list[NDArray[np.uint8]]:
        """Return the affordance pictures of one of OVERLAYS since the last reset, (rows, cols, 3) RGB each."""
        return [_to_array(message) for message in self._overlays[topic]]

    def _last_message(self) -> str:
        return self._statuses[-1].message if self._statuses else "none"

    def _missing(self) -> list[str]:
        missing = [client.srv_name for client in (self._reset, self._score) if not client.service_is_ready()]
        if not self._statuses:
            missing.append(topics.STATUS)
        if topics.COLOR not in self._latest:
            missing.append(topics.COLOR)
        if self._simulated_s is None and self._node.count_publishers(topics.CLOCK):
            missing.append(topics.CLOCK)
        if self._instruction.get_subscription_count() == 0:
            missing.append(f"subscriber of {topics.INSTRUCTION}")
        return missing

    def _call(self, client: Any, request: Any, timeout: float) -> Any:
        future = client.call_async(request)
        deadline = time.monotonic() + timeout
        while not future.done():
            if time.monotonic() > deadline:
                raise BenchmarkError(f"{client.srv_name} did not answer within {timeout:.0f} s")
            time.sleep(0.01)
        return future.result()

    def _take_clock(self, message: Clock) -> None:
        self._simulated_s = message.clock.sec + 1e-9 * message.clock.nanosec

    def _take_status(self, message: PolicyStatus) -> None:
        with self._condition:
            self._statuses.append(message)
            self._condition.notify_all()
        self.on_status(message)

    def _take_joints(self, message: JointState) -> None:
        pairs = zip(message.name, message.velocity, strict=False)
        if max((abs(speed) for name, speed in pairs if "finger" not in name), default=0.0) < MOTION_THRESHOLD:
            return
        self._last_motion = time.monotonic()
        if self._watch_motion:
            self._first_motion = self._last_motion
            self._watch_motion = False

    def _take_image(self, topic: str, message: Image) -> None:
        self._latest[topic] = message
        if topic in self._overlays:
            self._overlays[topic].append(message)
        else:
            self.on_frame(_to_array(message))


def _to_array(message: Image) -> NDArray[np.uint8]:
    return np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
