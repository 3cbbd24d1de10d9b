"""Reading storage files that lack their end. Whole bags of every kind are cut in the tests of cliport_episodes."""

import ast
import sqlite3
import sys
from contextlib import closing
from pathlib import Path
from types import ModuleType

import pytest
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from cliport_core import bag_limits, errors, torn_bag
from cliport_core.torn_bag import whole_messages

COUNT = 20


@pytest.fixture(params=[StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A whole storage file with COUNT messages on /said."""
    with Writer(tmp_path / "bag", version=9, storage_plugin=request.param) as writer:
        store = get_typestore(Stores.ROS2_JAZZY)
        connection = writer.add_connection("/said", "std_msgs/msg/String", typestore=store)
        for number in range(COUNT):
            writer.write(connection, number, b"\x00\x01\x00\x00" + bytes([number]) * 4000)
    return next(path for path in (tmp_path / "bag").iterdir() if path.suffix in (".mcap", ".db3"))


def test_topic_time_and_bytes_of_a_whole_file(file: Path) -> None:
    messages = list(whole_messages(file))
    assert [message.stamp_ns for message in messages] == list(range(COUNT))
    assert all(message.data[4:] == bytes([message.stamp_ns]) * 4000 for message in messages)
    topic = messages[0].topic
    assert (topic.name, topic.type, topic.encoding) == ("/said", "std_msgs/msg/String", "cdr")
    assert {message.topic for message in messages} == {topic}


@pytest.mark.parametrize("left", [0.0, 0.01, 0.3, 0.6, 0.9])
def test_what_lies_before_the_tear_is_read(file: Path, left: float) -> None:
    whole = file.read_bytes()
    file.write_bytes(whole[: int(left * len(whole))])
    messages = list(whole_messages(file))
    assert [message.stamp_ns for message in messages] == list(range(len(messages)))
    assert len(messages) <= left * COUNT + 1
    if file.suffix == ".mcap" and left >= 0.3:
        assert len(messages) >= left * COUNT - 3


def test_offers_of_publishers_are_read(tmp_path: Path) -> None:
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        qos = [
            Qos(
                QosHistory.KEEP_LAST,
                5,
                QosReliability.RELIABLE,
                QosDurability.TRANSIENT_LOCAL,
                QosTime(0, 0),
                QosTime(0, 0),
                QosLiveliness.AUTOMATIC,
                QosTime(0, 0),
                False,
            )
        ]
        connection = writer.add_connection(
            "/said", "std_msgs/msg/String", typestore=get_typestore(Stores.ROS2_JAZZY), offered_qos_profiles=qos
        )
        writer.write(connection, 1, b"\x00\x01\x00\x00")
    (message,) = whole_messages(tmp_path / "bag" / "bag.mcap")
    assert "depth: 5" in message.topic.offered_qos
    assert "string data" in message.topic.definition


def test_a_database_without_its_last_pages_still_gives_its_first_messages(tmp_path: Path) -> None:
    """SQLite refuses a file that is shorter than its header says, unless it is told to make do with it."""
    path = tmp_path / "torn.db3"
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)")
        database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        database.execute("INSERT INTO topics VALUES (1, '/said', 'std_msgs/msg/String', 'cdr')")
        for number in range(100):
            database.execute("INSERT INTO messages VALUES (?, 1, ?, ?)", (number, number, bytes(1000)))
        database.commit()
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    stamps = [message.stamp_ns for message in whole_messages(path)]
    assert 10 < len(stamps) < 90
    assert stamps == list(range(len(stamps)))


@pytest.mark.parametrize("name", ["x.mcap", "x.db3"])
def test_garbage_holds_nothing(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"nonsense" * 1000)
    assert list(whole_messages(tmp_path / name)) == []


@pytest.mark.parametrize("name", ["x.mcap", "x.db3"])
def test_a_file_that_cannot_be_opened_says_so(tmp_path: Path, name: str) -> None:
    """It is not torn: its messages may be whole."""
    with pytest.raises(FileNotFoundError):
        list(whole_messages(tmp_path / name))


def test_a_package_that_is_missing_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def decompress(chunk: bytes) -> bytes:
        raise ImportError("No module named 'backports'")

    path = tmp_path / "compressed.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + bytes([0x06]) + (4).to_bytes(8, "little") + bytes(4))
    monkeypatch.setattr(torn_bag, "_chunk_records", decompress)
    with pytest.raises(ImportError, match="backports"):
        list(whole_messages(path))


def test_tables_of_old_recorders_without_offers_are_read(tmp_path: Path) -> None:
    path = tmp_path / "old.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name, type, serialization_format)")
        database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp, data)")
        database.execute("INSERT INTO topics VALUES (1, '/said', 'std_msgs/msg/String', 'cdr')")
        database.execute("INSERT INTO messages VALUES (1, 1, 7, x'00010000')")
    database.close()
    (message,) = whole_messages(path)
    assert (message.topic.name, message.topic.offered_qos, message.stamp_ns) == ("/said", "", 7)


@pytest.mark.parametrize("module", [torn_bag, bag_limits, errors])
def test_it_imports_the_standard_library_at_most(module: ModuleType) -> None:
    """What decompresses is imported when a chunk is compressed."""
    tree = ast.parse(Path(str(module.__file__)).read_text())
    names = {node.module for node in tree.body if isinstance(node, ast.ImportFrom)}
    names |= {alias.name for node in tree.body if isinstance(node, ast.Import) for alias in node.names}
    others = {str(name) for name in names if str(name).split(".")[0] not in sys.stdlib_module_names}
    assert others <= {"cliport_core.bag_limits", "cliport_core.errors"}
