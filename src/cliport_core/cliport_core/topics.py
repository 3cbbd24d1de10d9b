"""The name of every topic, service and action of the graph, stated once; launch files may remap them."""

from __future__ import annotations

KINDS = ("pick", "place")  # the two poses of an action: views of both are published under their names

# what the camera's driver publishes, here the simulator's
COLOR = "/camera/color/image_raw"
CAMERA_INFO = "/camera/color/camera_info"
DEPTH = "/camera/aligned_depth_to_color/image_raw"

# names that ROS itself gives
JOINT_STATES = "/joint_states"
TF = "/tf"
TF_STATIC = "/tf_static"
CLOCK = "/clock"
DIAGNOSTICS = "/diagnostics"

# perception
HEIGHTMAP = "/cliport/heightmap"
POINTS = "/cliport/points"

CAMERA_STATUS = "cliport_perception: camera"  # the name in diagnostics; of further cameras with their number behind it

# the policy server
INSTRUCTION = "/cliport/instruction"
STATUS = "/cliport/status"
PICK_POSE = "/cliport/pick_pose"
PLACE_POSE = "/cliport/place_pose"
POSES = {"pick": PICK_POSE, "place": PLACE_POSE}
AFFORDANCES = {kind: f"/cliport/affordance/{kind}" for kind in KINDS}
RAW_AFFORDANCES = {kind: f"{AFFORDANCES[kind]}/raw" for kind in KINDS}
APPROVE = "/cliport/approve"
LOAD_POLICY = "/cliport/load_policy"
STOP = "/cliport/stop"
RESUME = "/cliport/resume"
POLICY_NODE = "cliport_policy"
POLICY_PARAMETERS = f"/{POLICY_NODE}/get_parameters"

# demonstrations in bags
DEMONSTRATION = "/cliport/demonstration"

# the executor
PICK_PLACE = "/panda_executor/pick_place"
MOVE_HAND = "/panda_executor/move_hand"
HEARTBEAT = "/panda_executor/heartbeat"
OWNER_HEARTBEAT = "/cliport/owner_heartbeat"
EXECUTOR_APPROVE = "/panda_executor/approve"
PREVIEW_TRAJECTORY = "/panda_executor/preview/trajectory"
PREVIEW_MARKERS = "/panda_executor/preview/markers"
PREVIEW_PICTURE = "/panda_executor/preview/picture"
EXECUTOR_READY = "/panda_executor/ready"
EXECUTOR_OPEN = "/panda_executor/open"
EXECUTOR_RECOVER = "/panda_executor/recover"
EXECUTOR_STOP = "/panda_executor/stop"
EXECUTOR_RESUME = "/panda_executor/resume"

# the simulator's own
SIM_RESET = "/sim_bridge/reset"
SIM_SCORE = "/sim_bridge/score"
SIM_TRUE_JOINTS = "/sim_bridge/true_joint_states"


MOST_CAMERAS = 9  # that one graph joins


def of_camera(topic: str, number: int) -> str:
    """Return the name of a camera's topic for one of several cameras, from 1: /camera2/... for the second."""
    return topic if number == 1 else topic.replace("/camera/", f"/camera{number}/", 1)


def trajectory_action(controller: str) -> str:
    """Return the FollowJointTrajectory action's name of an arm controller, as ros2_control forms it."""
    return f"/{controller}/follow_joint_trajectory"


def gripper_action(gripper: str) -> str:
    """Return the GripperCommand action's name of a gripper's node, as franka_gripper forms it."""
    return f"/{gripper}/gripper_action"
