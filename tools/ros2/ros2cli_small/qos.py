"""The --qos flags, and the profile that fits the publishers that are there."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile

PROFILES = (
    "unknown", "system_default", "sensor_data", "services_default", "parameters", "parameter_events",
    "action_status_default",
)  # fmt: skip
HISTORIES = ("system_default", "keep_last", "keep_all", "unknown")
RELIABILITIES = ("system_default", "reliable", "best_effort", "unknown", "best_available")
DURABILITIES = ("system_default", "transient_local", "volatile", "unknown", "best_available")


def add_qos_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the flags that override parts of the profile."""
    parser.add_argument("--qos-profile", choices=PROFILES, help="Quality of service preset profile")
    parser.add_argument("--qos-depth", type=int, metavar="N", help="Queue size setting")
    parser.add_argument("--qos-history", choices=HISTORIES, help="History of samples setting")
    parser.add_argument("--qos-reliability", choices=RELIABILITIES, help="Reliability setting")
    parser.add_argument("--qos-durability", choices=DURABILITIES, help="Durability setting")


def publisher_profile(args: argparse.Namespace) -> QoSProfile:
    """Return the profile to publish with: keep-last 10, reliable, volatile, unless flags say otherwise."""
    return _with_flags(_preset(args.qos_profile), args)


def subscriber_profile(node: Node, topic: str, args: argparse.Namespace) -> QoSProfile:
    """Return a profile that receives from every publisher that is known now, unless flags say otherwise."""
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

    profile = _preset(args.qos_profile)
    given = (args.qos_profile, args.qos_reliability, args.qos_durability)
    publishers = node.get_publishers_info_by_topic(topic)
    if not any(given) and publishers:
        offered = [info.qos_profile for info in publishers]
        reliable = all(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
        latched = all(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
        profile.reliability = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
    return _with_flags(profile, args)


def _preset(name: str | None) -> QoSProfile:
    from rclpy.qos import QoSPresetProfiles, QoSProfile

    if name is None:
        return QoSProfile(depth=10)
    preset = QoSPresetProfiles.get_from_short_key(name)
    return QoSProfile(
        depth=preset.depth,
        history=preset.history,
        reliability=preset.reliability,
        durability=preset.durability,
    )


def _with_flags(profile: QoSProfile, args: argparse.Namespace) -> QoSProfile:
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy

    if args.qos_depth is not None:
        profile.depth = args.qos_depth
    if args.qos_history:
        profile.history = HistoryPolicy.get_from_short_key(args.qos_history)
    if args.qos_reliability:
        profile.reliability = ReliabilityPolicy.get_from_short_key(args.qos_reliability)
    if args.qos_durability:
        profile.durability = DurabilityPolicy.get_from_short_key(args.qos_durability)
    return profile
