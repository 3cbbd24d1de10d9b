"""Message definitions, and messages between bytes and objects, where no ROS is installed."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from cliport_episodes.errors import BagError
from cliport_episodes.raw import RawMessage

DEMONSTRATION = "cliport_interfaces/msg/Demonstration"
# The same as in cliport_interfaces, which need not be installed where episodes are read.
DEMONSTRATION_DEFINITION = """\
uint8 SOURCE_CLICKED=0
uint8 SOURCE_CORRECTED=1
uint8 SOURCE_PROPOSED=2
uint8 SOURCE_EXPERT=3
std_msgs/Header header
uint32 step
string instruction
uint8 primitive
uint8 source
sensor_msgs/RegionOfInterest pick_box
sensor_msgs/RegionOfInterest place_box
uint32 pick_rotation
uint32 place_rotation
uint32 n_rotations
geometry_msgs/Pose pick
geometry_msgs/Pose place
bool executed
uint8 outcome
string message
geometry_msgs/Point grasp_centroid
float64 gripper_width
"""
_IDL_HEAD = "=" * 80 + "\nIDL: "
_NS = 1_000_000_000


@lru_cache(maxsize=1)
def known_types() -> Typestore:
    """Return the store of ROS 2 Jazzy's common interfaces and Demonstration."""
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(DEMONSTRATION_DEFINITION, DEMONSTRATION))
    return store


def types_of(name: str, definition: str) -> Typestore:
    """Return a store that knows type `name`: made from a definition's text where possible, else `known_types`.

    Raises:
        BagError: when the type is not known.
    """
    store = (_parsed(name, definition) if definition else None) or known_types()
    if name not in store.types:
        raise BagError(f"message type '{name}' is not known, and comes without a definition that can be read")
    return store


def definition_and_hash(raw: RawMessage) -> tuple[str, str]:
    """Return the definition and the hash that a bag stores for a message's type. Raises BagError for an unknown one."""
    store = types_of(raw.type, raw.definition)
    return raw.definition or store.generate_msgdef(raw.type, ros_version=2)[0], store.hash_rihs01(raw.type)


def decode(raw: RawMessage) -> Any:
    """Decode a message into an object of the `rosbags` library; array fields are NumPy arrays.

    Raises:
        BagError: when its type is not known, or the bytes are not such a message.
    """
    store = types_of(raw.type, raw.definition)
    try:
        return store.deserialize_cdr(raw.data, raw.type)
    except Exception as error:  # the library does not say what garbled bytes may raise
        raise BagError(f"a message on {raw.topic} is not a whole {raw.type}: {error}") from None


def make(name: str, /, **values: Any) -> Any:
    """Make a message object of a type of `known_types`."""
    return known_types().types[name](**values)


def make_header(stamp_ns: int, frame_id: str) -> Any:
    """Make a std_msgs/Header."""
    stamp = make("builtin_interfaces/msg/Time", sec=stamp_ns // _NS, nanosec=stamp_ns % _NS)
    return make("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)


def stamp_of(message: Any) -> int:
    """Return the header stamp of a message object [ns]."""
    return int(message.header.stamp.sec) * _NS + int(message.header.stamp.nanosec)


def encode(topic: str, message: Any, stamp_ns: int) -> RawMessage:
    """Serialize a message object of `known_types`, as received at `stamp_ns` [ns]."""
    name = message.__msgtype__
    return RawMessage(topic, name, bytes(known_types().serialize_cdr(message, name)), stamp_ns)


@lru_cache(maxsize=256)
def _parsed(name: str, definition: str) -> Typestore | None:
    store = Typestore()
    try:
        is_idl = definition.startswith(_IDL_HEAD)
        store.register(get_types_from_idl(definition) if is_idl else get_types_from_msg(definition, name))
    except Exception:  # as above
        return None
    return store if name in store.types else None
