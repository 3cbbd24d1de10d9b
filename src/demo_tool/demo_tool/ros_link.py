"""The node `demo_tool`: the graph's end of the station."""

from __future__ import annotations

from collections.abc import Callable
from queue import SimpleQueue

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter

from cliport_perception.workspace import WorkspaceSpec
from demo_tool.ros_arm import RosArm
from demo_tool.ros_camera import RosCamera
from demo_tool.ros_policy import RosPolicy
from demo_tool.station import Station
from demo_tool.station_config import StationConfig

_TICK = 0.05  # [s]
_LOOK_EVERY = 4  # ticks between two looks for the executor
_ADAPT_EVERY = 20  # and for the camera's publishers


class RosLink(Node):
    """Holds the ports of one station. Make the station with `config`, `arm` and `policy`, then `attach` it.

    Spin it with a single-threaded executor: nothing in it takes long.

    Raises:
        PerceptionError: when the workspace's file is unusable.
    """

    def __init__(self) -> None:
        super().__init__("demo_tool")
        path = str(self.declare_parameter("workspace", "").value)
        base_frame = str(self.declare_parameter("base_frame", "panda_link0").value)
        self.config = StationConfig(WorkspaceSpec.load(path) if path else WorkspaceSpec(), base_frame)
        self._posted: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._wake = self.create_guard_condition(self._do_posted)
        self.arm = RosArm(self, base_frame, self._post)
        self.policy = RosPolicy(self, base_frame, self._post)
        self._station: Station | None = None
        self._camera: RosCamera | None = None
        self._ticks = 0

    def attach(self, station: Station) -> None:
        """Feed this station from now on; call it before the node is spun."""
        self._station = station
        self._camera = RosCamera(self, self.config.base_frame, station, self._now_ns)
        self.policy.attach(station)
        # wall time: what waits must end when simulated time stands still
        self.create_timer(_TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def close(self) -> None:
        """Cancel what the station has the arm do, and see it written; call it while the node is still spun."""
        if self._station is not None:
            self._station.close()

    def _now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _tick(self) -> None:
        if self._ticks % _LOOK_EVERY == 0:
            self.arm.look()
        if self._ticks % _ADAPT_EVERY == 0:
            self._follow_the_clock()
            if self._camera is not None:
                self._camera.adapt()
        self._ticks += 1
        if self._station is not None:
            self._station.tick(self._now_ns())

    def _follow_the_clock(self) -> None:
        """Use simulated time where there is some: who starts the page need not know what stands in for the arm."""
        if not self.get_parameter("use_sim_time").value and self.count_publishers("/clock"):
            self.set_parameters([Parameter("use_sim_time", value=True)])

    def _post(self, act: Callable[[], None]) -> None:
        """Have something done in the node's thread: rclpy's clients are not safe between threads."""
        self._posted.put(act)
        self._wake.trigger()

    def _do_posted(self) -> None:
        while not self._posted.empty():
            self._posted.get()()
