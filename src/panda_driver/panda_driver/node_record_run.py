"""The executable `record_run`: a bag of what the graph says, and a JSON line of every motion, until Ctrl-C.

Somebody with an arm sends both when something went wrong. It listens only, and asks nothing of anybody.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from action_msgs.msg import GoalStatusArray
from control_msgs.action import FollowJointTrajectory, GripperCommand
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default, qos_profile_sensor_data
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import JointState

from cliport_core import topics
from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_core.ros_running import run_node
from panda_driver.errors import DriverError
from panda_driver.run_bag import RunBag
from panda_driver.run_log import RunLog
from panda_model import ArmModel, load_preset

RECORDED = (
    topics.JOINT_STATES,
    topics.TF,
    topics.TF_STATIC,
    topics.DIAGNOSTICS,
    topics.INSTRUCTION,
    topics.STATUS,
    topics.HEARTBEAT,
    topics.OWNER_HEARTBEAT,
    topics.PREVIEW_TRAJECTORY,
    topics.PICK_POSE,
    topics.PLACE_POSE,
    "/rosout",
)


class RunRecorder(Node):
    """Node that hears the actions of one arm and writes their motions to a log.

    Raises:
        DriverError: when the log cannot be begun.
    """

    def __init__(self, robot: ArmModel, path: Path, fail: Callable[[BaseException], None]) -> None:
        super().__init__("record_run")
        self._robot, self._fail = robot, fail
        head = {"arm": robot.name, "joints": list(robot.arm_joints), "began": self._now()}
        self._log = RunLog(path, head, self.get_logger().info)
        quality = qos_profile_action_status_default
        actions = (("arm", robot.arm_action, FollowJointTrajectory), ("hand", robot.gripper_action, GripperCommand))
        for part, name, kind in actions:
            hear_status, hear_feedback = partial(self._on_status, part), partial(self._on_feedback, part)
            self.create_subscription(GoalStatusArray, f"{name}/_action/status", hear_status, quality)
            self.create_subscription(kind.Impl.FeedbackMessage, f"{name}/_action/feedback", hear_feedback, 100)
        for name in robot.motion_actions[2:]:  # of franka_msgs: they have no feedback
            hear_status = partial(self._on_status, name.rpartition("/")[2])
            self.create_subscription(GoalStatusArray, f"{name}/_action/status", hear_status, quality)
        self.create_subscription(JointState, topics.JOINT_STATES, self._on_joints, qos_profile_sensor_data)

    def close(self) -> None:
        """Write what is still running."""
        self._guarded(partial(self._log.close, self._now()))

    def _now(self) -> float:
        return float(self.get_clock().now().nanoseconds * 1e-9)

    def _on_joints(self, message: JointState) -> None:
        efforts = dict(zip(message.name, message.effort, strict=False))
        if all(name in efforts for name in self._robot.arm_joints):
            self._log.on_efforts([float(efforts[name]) for name in self._robot.arm_joints])
        places = dict(zip(message.name, message.position, strict=False))
        if all(name in places for name in self._robot.finger_joints):
            self._log.on_width(self._now(), sum(float(places[name]) for name in self._robot.finger_joints))

    def _on_status(self, part: str, message: GoalStatusArray) -> None:
        for status in message.status_list:
            goal = bytes(status.goal_info.goal_id.uuid).hex()
            self._guarded(partial(self._log.on_status, goal, part, self._now(), int(status.status)))

    def _on_feedback(self, part: str, message: Any) -> None:
        goal, feedback = bytes(message.goal_id.uuid).hex(), message.feedback
        values: tuple[list[float], list[float], list[float]]
        if part == "arm":
            values = (list(feedback.desired.positions), list(feedback.actual.positions), [])
        else:
            values = ([], [float(feedback.position)], [float(feedback.effort)])
        self._guarded(partial(self._log.on_feedback, goal, part, self._now(), *values))

    def _guarded(self, act: Callable[[], None]) -> None:
        try:
            act()
        except DriverError as error:
            self._fail(error)


def main(args: list[str] | None = None) -> int:
    """Record until it is interrupted; return 0, or 1 when nothing could be recorded."""
    given = sys.argv if args is None else ["record_run", *args]
    options = _parser().parse_args(remove_ros_args(given)[1:])
    folder = options.out or Path("runs") / f"arm-{datetime.now():%Y%m%d-%H%M%S}"
    try:
        robot = load_preset(options.arm)
        folder = _new_folder(folder)
    except (CoreError, DriverError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    bag = None if options.no_bag else RunBag(folder / "bag", RECORDED)
    try:
        return run_node(
            lambda fail: RunRecorder(robot, folder / "motions.jsonl", fail),
            (DriverError, CoreError),
            given,
            RunRecorder.close,
        )
    finally:
        print(f"{folder}: motions.jsonl" + ("" if bag is None else f" and {bag.end()}"))


def _parser() -> CommandParser:
    parser = CommandParser(
        prog="record_run", description="Records a run of an arm, to be sent to whoever is to look at it."
    )
    parser.add_argument("--arm", default="fr3", help="preset's name or file (default %(default)s)")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="a new folder; runs/arm-<time>")
    parser.add_argument("--no-bag", action="store_true", help="only the motions, no bag beside them")
    return parser


def _new_folder(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True)
    except FileExistsError:
        raise DriverError(f"{folder} exists: choose another --out") from None
    except OSError as error:
        raise DriverError(f"cannot make {folder} ({error.strerror}): choose another --out") from None
    return folder


if __name__ == "__main__":
    sys.exit(main())
