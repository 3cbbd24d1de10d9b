"""Quality of service on its way into a bag, out of it, and from a file of overrides."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    InvalidQoSProfileException,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

from ros2cli_small.bag.reader import warn
from ros2cli_small.errors import CommandError

DEPTH = 10  # messages kept for a publisher whose depth the bag does not know
NANOSECONDS = 1_000_000_000

_POLICIES = {
    "history": HistoryPolicy,
    "reliability": ReliabilityPolicy,
    "durability": DurabilityPolicy,
    "liveliness": LivelinessPolicy,
}
_DURATIONS = ("deadline", "lifespan", "liveliness_lease_duration")
_DECISIVE = ("reliability", "durability", "deadline", "liveliness", "liveliness_lease_duration")
_PLAIN = {"depth": int, "avoid_ros_namespace_conventions": bool}


def offer_from_profile(profile: QoSProfile) -> Qos:
    """Return what a publisher offers as the bag keeps it; both number the policies alike."""
    return Qos(
        QosHistory(int(profile.history)),
        profile.depth,
        QosReliability(int(profile.reliability)),
        QosDurability(int(profile.durability)),
        _time(profile.deadline),
        _time(profile.lifespan),
        QosLiveliness(int(profile.liveliness)),
        _time(profile.liveliness_lease_duration),
        profile.avoid_ros_namespace_conventions,
    )


def profile_from_offers(topic: str, offers: Sequence[Qos]) -> QoSProfile:
    """Return the profile that all recorded publishers had, or the default one with a warning where they differ.

    Without recorded offers it is the default one too: reliable and volatile. Histories and lifespans may differ.
    """
    profile = QoSProfile(depth=max(DEPTH, len(offers)))  # as many latched messages as there were publishers
    if not offers:
        return profile
    first = offers[0]
    if any(getattr(offer, name) != getattr(first, name) for offer in offers for name in _DECISIVE):
        warn(
            f"The recorded publishers of '{topic}' had different QoS: it is played reliable and volatile; "
            "--qos-profile-overrides-path chooses otherwise"
        )
        return profile
    if first.reliability == QosReliability.BEST_EFFORT:
        profile.reliability = ReliabilityPolicy.BEST_EFFORT
    if first.durability == QosDurability.TRANSIENT_LOCAL:
        profile.durability = DurabilityPolicy.TRANSIENT_LOCAL
    for name in _DURATIONS:
        limit = getattr(first, name)
        setattr(profile, name, Duration(nanoseconds=limit.sec * NANOSECONDS + limit.nsec))
    return profile


def read_overrides(path: str | None) -> dict[str, QoSProfile]:
    """Read `topic: {reliability: best_effort, depth: 5, …}`; durations are `{sec: 1, nsec: 0}`."""
    if path is None:
        return {}
    try:
        document = yaml.safe_load(Path(path).read_text())
        return {str(topic): _profile(values) for topic, values in dict(document or {}).items()}
    except OSError as error:
        raise CommandError(f"Cannot read QoS overrides: {error}") from None
    except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError, InvalidQoSProfileException) as error:
        reason = " ".join(str(error).split())
        raise CommandError(f"QoS overrides '{path}' are not 'topic: {{policy: value}}': {reason}") from None


def _profile(values: dict[str, Any]) -> QoSProfile:
    arguments: dict[str, Any] = {"depth": DEPTH}
    for name, value in values.items():
        if name in _POLICIES:
            arguments[name] = _POLICIES[name].get_from_short_key(value)
        elif name in _DURATIONS:
            arguments[name] = Duration(seconds=value.get("sec", 0), nanoseconds=value.get("nsec", 0))
        else:
            arguments[name] = _PLAIN[name](value)
    return QoSProfile(**arguments)


def _time(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds, NANOSECONDS))
