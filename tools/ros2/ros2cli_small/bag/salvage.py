"""A storage file that lacks its end, read like a whole one as far as it goes."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path

from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat
from rosbags.rosbag2.metadata import parse_qos

from ros2cli_small.errors import CommandError

Message = tuple[Connection, int, bytes]

NO_DEFINITION = MessageDefinition(MessageDefinitionFormat.NONE, "")


class TornFile:
    """The messages before the tear, in the order in which they were written. Times are nanoseconds."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.start_time, self.end_time, self.message_count = 2**63 - 1, 0, 0
        found: dict[int, Connection] = {}
        for connection, time, _ in self._all():
            known = found.get(connection.id, connection)
            found[connection.id] = known._replace(msgcount=known.msgcount + 1)
            self.start_time, self.end_time = min(time, self.start_time), max(time + 1, self.end_time)
            self.message_count += 1
        self.connections = list(found.values())

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Iterator[Message]:
        """Yield the messages of some connections from `start` to before `stop`."""
        wanted = {connection.id for connection in connections}
        for connection, time, data in self._all():
            if connection.id in wanted and (start is None or time >= start) and (stop is None or time < stop):
                yield connection, time, data

    def close(self) -> None:
        """Do nothing: the file is open only while it is read."""

    def _all(self) -> Iterator[Message]:
        try:
            from cliport_core.torn_bag import TornTopic, whole_messages
        except ImportError:
            raise CommandError(
                f"'{self.path}' is torn, and what reads such files is not built yet: run tools/build and source env.sh"
            ) from None
        connections: dict[TornTopic, Connection] = {}
        try:
            for topic, time, data in whole_messages(self.path):
                if topic not in connections:
                    ext = ConnectionExtRosbag2(topic.encoding, parse_qos(topic.offered_qos))
                    connections[topic] = Connection(topic.key, topic.name, topic.type, NO_DEFINITION, "", 0, ext, None)
                yield connections[topic], time, data
        except (OSError, ImportError) as error:
            raise CommandError(f"'{self.path}' cannot be read: {' '.join(str(error).split())}") from None
