"""Bags of others: both storages, old and new metadata, whole and torn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import yaml
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from cliport_episodes import bags
from cliport_episodes.bags import decode, read_messages
from cliport_episodes.errors import BagError
from cliport_episodes.message_types import known_types
from cliport_episodes.raw import RawMessage

Scene = Callable[[int], list[RawMessage]]


def write_bag(
    path: Path,
    messages: list[RawMessage],
    storage: StoragePlugin,
    version: Literal[8, 9] = 9,
    compression: CompressionMode = CompressionMode.NONE,
) -> Path:
    writer = Writer(path, version=version, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        types = {message.topic: message.type for message in messages}
        connections = {t: writer.add_connection(t, name, typestore=known_types()) for t, name in types.items()}
        for message in messages:
            writer.write(connections[message.topic], message.stamp_ns, message.data)
    return path


@pytest.fixture
def sent(scene: Scene) -> list[RawMessage]:
    return sorted((message for moment in range(3) for message in scene(moment)), key=lambda m: m.stamp_ns)


@pytest.mark.parametrize("storage", StoragePlugin)
@pytest.mark.parametrize("version", [8, 9])
def test_any_bag_is_read(
    tmp_path: Path, sent: list[RawMessage], storage: StoragePlugin, version: Literal[8, 9]
) -> None:
    path = write_bag(tmp_path / "bag", sent, storage, version)
    complaints: list[str] = []
    assert list(read_messages(path, complain=complaints.append)) == sent and not complaints
    only = list(read_messages(path, {"/joint_states"}))
    assert [decode(message).position[0] for message in only] == pytest.approx([0.0, 0.1, 0.2])
    file = next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))
    assert list(read_messages(file)) == sent


@pytest.mark.parametrize("compression", [CompressionMode.FILE, CompressionMode.MESSAGE, CompressionMode.STORAGE])
def test_compressed_bags_are_read(tmp_path: Path, sent: list[RawMessage], compression: CompressionMode) -> None:
    assert list(read_messages(write_bag(tmp_path / "bag", sent, StoragePlugin.MCAP, 9, compression))) == sent


def test_the_metadata_of_humble_is_understood(tmp_path: Path, sent: list[RawMessage]) -> None:
    path = write_bag(tmp_path / "bag", sent, StoragePlugin.SQLITE3, 8)
    metadata = yaml.safe_load((path / "metadata.yaml").read_text())
    information = metadata["rosbag2_bagfile_information"]
    information["version"] = 5
    for later in ("custom_data", "ros_distro"):
        del information[later]
    for topic in information["topics_with_message_count"]:
        del topic["topic_metadata"]["type_description_hash"]
    (path / "metadata.yaml").write_text(yaml.safe_dump(metadata))
    assert list(read_messages(path)) == sent


@pytest.mark.parametrize(
    ("storage", "left"), [*((StoragePlugin.MCAP, x) for x in (0.3, 0.5, 0.95)), (StoragePlugin.SQLITE3, 0.8)]
)
def test_what_lies_before_a_tear_is_used_and_said(
    tmp_path: Path, sent: list[RawMessage], storage: StoragePlugin, left: float
) -> None:
    path = write_bag(tmp_path / "bag", sent, storage)
    file = next(file for file in path.iterdir() if file.suffix in (".mcap", ".db3"))
    whole = file.read_bytes()
    file.write_bytes(whole[: int(left * len(whole))])
    complaints: list[str] = []
    read = list(read_messages(path, complain=complaints.append))
    assert read == sent[: len(read)] and len(read) >= 1
    assert len(complaints) == 1 and f"{len(read)} whole messages" in complaints[0]


@pytest.mark.parametrize("error", [PermissionError("permission denied"), ImportError("No module named 'lz4'")])
def test_a_torn_file_that_cannot_be_opened_is_one_error(
    tmp_path: Path, sent: list[RawMessage], monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    def refuse(_: Path) -> None:
        raise error

    path = write_bag(tmp_path / "bag", sent, StoragePlugin.MCAP)
    file = path / "bag.mcap"
    file.write_bytes(file.read_bytes()[:-100])
    monkeypatch.setattr(bags, "whole_messages", refuse)
    with pytest.raises(BagError, match=rf"bag.mcap' cannot be read: {error}"):
        list(read_messages(path, complain=lambda _: None))


def test_a_tear_loses_only_what_is_behind_it(tmp_path: Path, sent: list[RawMessage]) -> None:
    path = write_bag(tmp_path / "bag", sent, StoragePlugin.MCAP)
    file = path / "bag.mcap"
    whole = file.read_bytes()
    file.write_bytes(whole[: whole.index(sent[7].data) + len(sent[7].data) // 2])
    assert list(read_messages(path, complain=lambda _: None)) == sent[:7]


def test_a_bag_without_metadata_is_read(tmp_path: Path, sent: list[RawMessage]) -> None:
    path = write_bag(tmp_path / "bag", sent, StoragePlugin.MCAP)
    (path / "metadata.yaml").unlink()
    complaints: list[str] = []
    assert list(read_messages(path, complain=complaints.append)) == sent and "metadata" in complaints[0]


@pytest.mark.parametrize("garbled", [False, True])
def test_of_a_compressed_bag_one_chunk_is_lost(tmp_path: Path, sent: list[RawMessage], garbled: bool) -> None:
    large = [replace(sent[-1], data=np.random.default_rng(n).bytes(1_200_000), stamp_ns=n) for n in range(3)]
    file = write_bag(tmp_path / "bag", large, StoragePlugin.MCAP, 9, CompressionMode.STORAGE) / "bag.mcap"
    whole = file.read_bytes()
    second = whole.index(b"\x28\xb5\x2f\xfd", whole.index(b"\x28\xb5\x2f\xfd") + 4)  # a frame of zstd
    file.write_bytes(whole[:second] + b"????" + whole[second + 4 :] if garbled else whole[: second + 500_000])
    complaints: list[str] = []
    assert list(read_messages(file.parent, complain=complaints.append)) == large[:1] and len(complaints) == 1


def test_metadata_of_another_bag_is_said(tmp_path: Path, sent: list[RawMessage]) -> None:
    path = write_bag(tmp_path / "bag", sent, StoragePlugin.MCAP)
    metadata = path / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("/joint_states", "/other_states"))
    complaints: list[str] = []
    assert len(list(read_messages(path, complain=complaints.append))) == 12
    assert complaints == ["'bag' announces 15 messages: the 12 that it holds are used"]


def test_what_is_no_bag_is_one_error(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "x.mcap").write_bytes(b"nonsense")
    (tmp_path / "x.txt").write_text("nonsense")
    for name, said in (("gone", "there is no bag"), ("empty", "no bag"), ("x.mcap", "no bag"), ("x.txt", "no bag")):
        with pytest.raises(BagError, match=said):
            list(read_messages(tmp_path / name))


def test_types_come_from_the_bag(tmp_path: Path) -> None:
    definition = "uint8 count\nstd_msgs/Header header\n" + "=" * 80 + "\nMSG: std_msgs/Header\nstring frame_id\n"
    writer = Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP)
    with writer:
        connection = writer.add_connection("/x", "their_msgs/msg/Thing", msgdef=definition, rihs01="RIHS01_0")
        writer.write(connection, 5, b"\0\1\0\0\x07\0\0\0\x02\0\0\0a\0")
    (message,) = read_messages(tmp_path / "bag")
    assert (decode(message).count, decode(message).header.frame_id) == (7, "a")
