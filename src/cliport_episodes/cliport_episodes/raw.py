"""Serialized message with its topic, type and time."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class RawMessage:
    """A serialized message as it was received.

    type: as in "sensor_msgs/msg/Image"; data: CDR with its four bytes of head; stamp_ns: when it was received [ns].
    definition: the text of its type and all types in it, where the bag had one; types of ROS 2 Jazzy's common
    interfaces and this project's Demonstration need none.
    """

    topic: str
    type: str
    data: bytes = field(repr=False)
    stamp_ns: int
    definition: str = field(default="", compare=False, repr=False)
