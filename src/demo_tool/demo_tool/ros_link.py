"""Node `demo_tool`, which connects the station to the graph."""

from __future__ import annotations

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter

from cliport_core import topics
from cliport_core.ros_spin_queue import SpinQueue
from cliport_core.workspace import WorkspaceSpec
from cliport_perception.calibration.correction_watch import CorrectionWatch
from demo_tool.ros_arm import RosArm
from demo_tool.ros_camera import PictureSettings, RosCamera
from demo_tool.ros_policy import RosPolicy
from demo_tool.ros_scenes import RosScenes
from demo_tool.station import Station
from demo_tool.station_config import BoxConfig, StationConfig, ready_pose
from panda_model.ros_parameters import declare_base_frame, declare_robot

_TICK = 0.05  # [s]
_LOOK_EVERY = 4  # ticks between two looks for the executor and the joints
_ADAPT_EVERY = 20  # ticks between two looks for the camera's publishers


class RosLink(Node):
    """Node with the ports of one station: make that with `config`, `arm`, `policy` and `scenes`, then `attach` it.

    It is spun by a single-threaded executor: no callback takes long. pictures: how the camera's come.

    Raises:
        CoreError: when the file of workspace or calibration, or the preset of the robot, is unusable.
    """

    def __init__(self, parameter_overrides: list[Parameter] | None = None) -> None:
        super().__init__("demo_tool", parameter_overrides=parameter_overrides)
        self.pictures = PictureSettings(
            bool(self.declare_parameter("rectified", False).value),
            bool(self.declare_parameter("compressed", False).value),
            CorrectionWatch(str(self.declare_parameter("calibration", "").value)),
        )
        path = str(self.declare_parameter("workspace", "").value)
        arm = declare_robot(self)
        self.robot = arm.name
        base_frame = declare_base_frame(self, arm)
        workspace = WorkspaceSpec.load(path) if path else WorkspaceSpec()
        box = BoxConfig(table_z=self.pictures.correction.table_z or 0.0, hand=arm.hand)
        self.config = StationConfig(workspace, base_frame, box, home=ready_pose(arm))
        self._queue = SpinQueue(self)
        self.arm = RosArm(self, base_frame, self._queue.post)
        self.policy = RosPolicy(self, base_frame, self._queue.post)
        self.scenes = RosScenes(self, self._queue.post)
        self._station: Station | None = None
        self._camera: RosCamera | None = None
        self._ticks = 0

    def attach(self, station: Station) -> None:
        """Connect the station to the graph; to be called before the node is spun."""
        self._station = station
        self._camera = RosCamera(self, self.config.base_frame, station, self._now_ns, self.pictures)
        self.policy.attach(station)
        # wall time: what waits must end when simulated time stands still
        self.create_timer(_TICK, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def close(self) -> None:
        """Cancel the station's motion and let its step be written; to be called while the node is spun."""
        if self._station is not None:
            self._station.close()
        self.arm.close()

    def destroy_node(self) -> None:
        """End the signs of life, then the node."""
        self.arm.close()
        super().destroy_node()

    def _now_ns(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _tick(self) -> None:
        self._queue.run()
        if self._ticks % _LOOK_EVERY == 0:
            self.arm.look()
            if self._station is not None and self._camera is not None:
                self._station.on_joints(self._camera.joint_positions())
        if self._ticks % _ADAPT_EVERY == 0:
            self._adopt_sim_time()
            if self._camera is not None:
                self._camera.adapt()
            self.policy.look()
            self.scenes.look()
        self._ticks += 1
        if self._station is not None:
            self._station.tick(self._now_ns())

    def _adopt_sim_time(self) -> None:
        """Use simulated time where a clock is published, so that it need not be set when the page is started."""
        if not self.get_parameter("use_sim_time").value and self.count_publishers(topics.CLOCK):
            self.set_parameters([Parameter("use_sim_time", value=True)])
