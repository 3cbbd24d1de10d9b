"""The --qos flags, and the profile that fits the publishers that are there."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.qos import QoSProfile

PROFILES = (
    "unknown", "default", "system_default", "sensor_data", "services_default", "parameters", "parameter_events",
    "action_status_default", "best_available",
)  # fmt: skip
HISTORIES = ("system_default", "keep_last", "keep_all", "unknown")
RELIABILITIES = ("system_default", "reliable", "best_effort", "unknown", "best_available")
DURABILITIES = ("system_default", "transient_local", "volatile", "unknown", "best_available")
LIVELINESSES = ("system_default", "automatic", "manual_by_topic", "unknown", "best_available")


def add_qos_arguments(parser: argparse.ArgumentParser, default: str) -> None:
    """Add the flags of a profile: a preset, `default` unless another is named, and what overrides parts of it."""
    parser.add_argument(
        "--qos-profile", choices=PROFILES, default=default, help=f"Quality of service preset (default: {default})"
    )
    parser.add_argument("--qos-depth", type=int, metavar="N", help="Queue size setting")
    parser.add_argument("--qos-history", choices=HISTORIES, help="History of samples setting")
    parser.add_argument("--qos-reliability", choices=RELIABILITIES, help="Reliability setting")
    parser.add_argument("--qos-durability", choices=DURABILITIES, help="Durability setting")
    parser.add_argument("--qos-liveliness", choices=LIVELINESSES, help="Liveliness setting")
    parser.add_argument(
        "--qos-liveliness-lease-duration-seconds", type=float, metavar="SECONDS", help="Liveliness lease duration"
    )


def profile_from_flags(args: argparse.Namespace) -> QoSProfile:
    """Return the preset with what the flags override."""
    from rclpy.duration import Duration
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, LivelinessPolicy, ReliabilityPolicy

    profile = _preset(args.qos_profile)
    if args.qos_history:
        profile.history = HistoryPolicy.get_from_short_key(args.qos_history)
    if args.qos_reliability:
        profile.reliability = ReliabilityPolicy.get_from_short_key(args.qos_reliability)
    if args.qos_durability:
        profile.durability = DurabilityPolicy.get_from_short_key(args.qos_durability)
    if args.qos_liveliness:
        profile.liveliness = LivelinessPolicy.get_from_short_key(args.qos_liveliness)
    if args.qos_liveliness_lease_duration_seconds:
        profile.liveliness_lease_duration = Duration(seconds=args.qos_liveliness_lease_duration_seconds)
    if args.qos_depth is not None and args.qos_depth >= 0:
        profile.depth = args.qos_depth
    return profile


def subscriber_profile(node: Node, topic: str, args: argparse.Namespace) -> QoSProfile:
    """Return the profile of the flags; without flags but --qos-profile, one that hears every publisher known now."""
    overrides = (
        args.qos_depth, args.qos_history, args.qos_reliability, args.qos_durability, args.qos_liveliness,
        args.qos_liveliness_lease_duration_seconds,
    )  # fmt: skip
    profile = profile_from_flags(args)
    return profile if any(value is not None for value in overrides) else fit_publishers(node, topic, profile)


def fit_publishers(node: Node, topic: str, profile: QoSProfile) -> QoSProfile:
    """Make a profile reliable if all publishers of the topic are, latched if all are; as it is where there are none."""
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

    offered = [info.qos_profile for info in node.get_publishers_info_by_topic(topic)]
    if not offered:
        return profile
    reliable = sum(qos.reliability == ReliabilityPolicy.RELIABLE for qos in offered)
    latched = sum(qos.durability == DurabilityPolicy.TRANSIENT_LOCAL for qos in offered)
    for count, name in ((reliable, "reliable"), (latched, "transient_local")):
        if 0 < count < len(offered):
            print(f"WARNING: {count} of {len(offered)} publishers are {name}; subscribing without", file=sys.stderr)
    profile.reliability = ReliabilityPolicy.RELIABLE if reliable == len(offered) else ReliabilityPolicy.BEST_EFFORT
    profile.durability = DurabilityPolicy.TRANSIENT_LOCAL if latched == len(offered) else DurabilityPolicy.VOLATILE
    return profile


def _preset(name: str) -> QoSProfile:
    from rclpy.qos import QoSPresetProfiles, QoSProfile

    preset = QoSPresetProfiles.get_from_short_key(name)
    return QoSProfile(**{slot.lstrip("_"): getattr(preset, slot) for slot in preset.__slots__})
