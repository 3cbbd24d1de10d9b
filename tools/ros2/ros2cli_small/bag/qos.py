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


def profile_from_offers(offers: Sequence[Qos]) -> QoSProfile:
    """Return a profile that serves whoever the recorded publishers served: the strongest of what they offered.

    Without recorded offers it is reliable and volatile. Time limits hold only where all publishers had the same.
    """
    latched = is_latched(offers)
    best_effort = bool(offers) and all(offer.reliability == QosReliability.BEST_EFFORT for offer in offers)
    profile = QoSProfile(
        depth=max(DEPTH, len(offers)),  # as many latched messages as there were publishers
        reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )
    for name in _DURATIONS:
        limits = {getattr(offer, name) for offer in offers}
        if len(limits) == 1:
            limit = limits.pop()
            setattr(profile, name, Duration(nanoseconds=limit.sec * NANOSECONDS + limit.nsec))
    return profile


def is_latched(offers: Sequence[Qos]) -> bool:
    """Whether a publisher kept its messages for those who subscribe later."""
    return any(offer.durability == QosDurability.TRANSIENT_LOCAL for offer in offers)


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
