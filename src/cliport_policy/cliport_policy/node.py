"""The node `server`: an instruction in, pick and place goals for the executor out, step by step."""

from __future__ import annotations

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from functools import partial

import rclpy
from cliport_interfaces.msg import Heightmap as HeightmapMsg
from cliport_interfaces.msg import PolicyStatus
from cliport_perception.conversions import heightmap_from_msg, image_to_msg, stamp_from_msg, stamp_to_msg
from cliport_perception.errors import PerceptionError
from geometry_msgs.msg import PoseStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.utilities import try_shutdown
from sensor_msgs.msg import Image
from std_msgs.msg import String
from std_srvs.srv import Trigger

from cliport_policy import conversions
from cliport_policy.errors import PolicyError
from cliport_policy.executor_link import ExecutorLink
from cliport_policy.overlays import render_overlay
from cliport_policy.policy import Policy, load_policy
from cliport_policy.server_logic import PolicyServer
from cliport_policy.server_types import Answer, Moment, Proposal, ServerConfig, ServerState, ServerStatus

TICK_S = 0.05
POSES = ("/cliport/pick_pose", "/cliport/place_pose")
MAPS = ("pick", "place")
