"""Discovery of the whole graph by a node that has just come: there is no daemon that would have known it all along.

Quiet alone does not tell: a participant of DDS may first answer with its next announcement, 3 s later. Those of this
machine can be counted without discovery, though: each has a UDP port whose number follows from the domain.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rclpy.node import Node

QUIET_TIME = 1.0  # s; a participant's topics come within 0.1 s of it, on a busy machine within 0.5 s
PATIENCE = 10.0  # s without news before one that does not answer is given up; it announces itself every 3 s
POLL_PERIOD = 0.1  # s
DISCOVERY_TOPIC = "ros_discovery_info"  # every participant of ROS publishes it
NAMELESS = "_NODE_NAME_UNKNOWN_"
PARTICIPANT_BYTES = 12  # of an endpoint's identifier
_FIRST_PORT, _PORTS_A_DOMAIN, _PARTICIPANTS = 7410, 250, 120  # of the DDSI-RTPS standard; two ports a participant
_PORT_TABLES = (Path("/proc/net/udp"), Path("/proc/net/udp6"))


@dataclass(frozen=True)
class GraphState:
    """The visible graph at one time. `nameless` counts endpoints whose node is not known yet."""

    participants: int
    nameless: int
    content: frozenset[tuple[object, ...]]


class Completion:
    """Tells when the graph is complete. Times are seconds, handed in."""

    def __init__(self, now: float) -> None:
        self._changed, self._last = now, GraphState(0, 0, frozenset())

    def reached(self, now: float, state: GraphState, expected: int) -> bool:
        """Return whether nothing more is to come, with `expected` participants on this machine."""
        if state != self._last:
            self._changed, self._last = now, state
        missing = state.participants < expected or state.nameless > 0
        return now - self._changed >= (PATIENCE if missing else QUIET_TIME)


def wait_for_graph(node: Node, spin_time: float | None = None) -> None:
    """Return when the graph is complete, or after `spin_time` seconds when they are given.

    Participants of this machine that do not answer are named in a warning; those of others cannot be missed.
    """
    if spin_time is not None:
        time.sleep(spin_time)
        return
    watch = GraphWatch(node)
    while not watch.complete():
        time.sleep(POLL_PERIOD)
    watch.warn_of_missing()


class GraphWatch:
    """Watches the graph for one that looks for something in it and may find it before the graph is complete."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._completion = Completion(time.monotonic())
        self._missing = 0

    def complete(self) -> bool:
        """Look now, and tell whether nothing more is to come."""
        state = graph_state(self._node)
        expected = count_participants(int(self._node.context.get_domain_id()))
        self._missing = max(0, expected - state.participants)
        return self._completion.reached(time.monotonic(), state, expected)

    def warn_of_missing(self) -> None:
        """Say in one line that some did not answer, if so."""
        if self._missing:
            print(
                f"WARNING: {self._missing} participant(s) of this domain on this machine did not answer within "
                f"{PATIENCE:g} s: what they offer is not shown",
                file=sys.stderr,
            )


def graph_state(node: Node) -> GraphState:
    """Return what the node sees now, itself included."""
    content: set[tuple[object, ...]] = {
        (name, *types) for name, types in node.get_topic_names_and_types(no_demangle=True)
    }
    content.update(node.get_node_names_and_namespaces())
    nameless = 0
    for topic, _ in node.get_topic_names_and_types():
        for info in (*node.get_publishers_info_by_topic(topic), *node.get_subscriptions_info_by_topic(topic)):
            content.add((topic, bytes(info.endpoint_gid)))
            nameless += info.node_name == NAMELESS
    announced = node.get_publishers_info_by_topic(DISCOVERY_TOPIC, no_mangle=True)
    participants = {bytes(info.endpoint_gid)[:PARTICIPANT_BYTES] for info in announced}
    return GraphState(len(participants), nameless, frozenset(content))


def count_participants(domain: int, tables: Iterable[Path] = _PORT_TABLES) -> int:
    """Return how many participants of a domain this machine has, by their ports; 0 where that cannot be known."""
    first = _FIRST_PORT + _PORTS_A_DOMAIN * domain
    ports = range(first, first + 2 * _PARTICIPANTS, 2)
    used: set[int] = set()
    for table in tables:
        try:
            lines = table.read_text().splitlines()[1:]
        except OSError:
            continue
        used.update(int(line.split()[1].rpartition(":")[2], 16) for line in lines)
    return len(used.intersection(ports))
