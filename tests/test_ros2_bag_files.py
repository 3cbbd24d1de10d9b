"""`ros2 bag` and its files: bags of other makers, torn ones, and what is said when there is nothing to read."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import pytest
from ros2_bags import storage_file, write_bag
from std_msgs.msg import Header, String, UInt8MultiArray

from cliport_interfaces.msg import WorkspaceSpec

ROWS = [
    *(("/words", 0.1 * k, String(data=f"word {k:02d}")) for k in range(20)),
    ("/spec", 2.0, WorkspaceSpec()),
]


@pytest.mark.parametrize(("storage", "version"), [("mcap", 9), ("sqlite3", 9), ("mcap", 5), ("sqlite3", 5)])
def test_info_of_jazzys_and_humbles_bags(ros2_here, tmp_path, storage, version):
    write_bag(tmp_path / "theirs", ROWS, storage, version)
    info = ros2_here("bag", "info", tmp_path / "theirs")
    assert (info.returncode, info.stderr) == (0, "")
    lines = info.stdout.splitlines()
    assert lines[1] == f"Files:             {storage_file(tmp_path / 'theirs').name}"
    assert re.fullmatch(r"Bag size:          \d+\.\d KiB", lines[2])
    assert lines[3:6] == [
        f"Storage id:        {storage}",
        f"ROS Distro:        {'rosbags' if version == 9 else 'unknown'}",
        "Duration:          2.000000000s",
    ]
    assert re.fullmatch(r"Start:             Nov 1\d 2023 \d\d:\d\d:20\.000000000 \(1700000000\.000000000\)", lines[6])
    assert re.fullmatch(r"End:               Nov 1\d 2023 \d\d:\d\d:22\.000000000 \(1700000002\.000000000\)", lines[7])
    assert lines[8:] == [
        "Messages:          21",
        "Topic information: Topic: /spec | Type: cliport_interfaces/msg/WorkspaceSpec | Count: 1 "
        "| Serialization Format: cdr",
        "                   Topic: /words | Type: std_msgs/msg/String | Count: 20 | Serialization Format: cdr",
        "Service:           0",
        "Service information: ",
    ]


def test_info_sorts_topics_and_tells_services_apart(ros2_here, tmp_path):
    rows = [("/add/_service_event", 0.1 * k, Header()) for k in range(3)] + ROWS
    write_bag(tmp_path / "bag", rows, types={"/add/_service_event": "add_msgs/srv/Add_Event"})
    info = ros2_here("bag", "info", tmp_path / "bag", "--sort", "count").stdout
    assert [line.split()[-11] for line in info.splitlines() if "Topic: " in line] == ["/spec", "/words"]
    assert info.endswith(
        "Service:           1\n"
        "Service information: Service: /add | Type: add_msgs/srv/Add | Event Count: 3 | Serialization Format: cdr\n"
    )
    assert ros2_here("bag", "info", tmp_path / "bag", "-t").stdout == "/spec\n/words\n"


def test_one_storage_file_is_a_bag(ros2_here, tmp_path):
    write_bag(tmp_path / "whole", ROWS)
    info = ros2_here("bag", "info", storage_file(tmp_path / "whole"))
    assert info.returncode == 0
    assert "Messages:          21\n" in info.stdout


def counted(ros2_here: Any, path: Path) -> tuple[int, str]:
    """Return the counts of `info` for a torn bag, and the one line it says about it."""
    info = ros2_here("bag", "info", path)
    assert info.returncode == 0, info.stderr
    assert len(info.stderr.splitlines()) == 1
    match = re.search(r"^Messages: +(\d+)$", info.stdout, re.MULTILINE)
    assert match
    return int(match[1]), info.stderr


@pytest.mark.parametrize("metadata", [True, False])
def test_mcap_cut_in_a_message_keeps_all_before_it(ros2_here, tmp_path, metadata):
    write_bag(tmp_path / "torn", ROWS)
    file = storage_file(tmp_path / "torn")
    content = file.read_bytes()
    file.write_bytes(content[: content.index(b"word 13") + 4])
    if not metadata:
        (tmp_path / "torn/metadata.yaml").unlink()
    count, line = counted(ros2_here, tmp_path / "torn")
    assert count == 13
    assert "is not complete" in line
    assert "13 messages" in line


def test_cut_compressed_and_sqlite3_bags_keep_their_beginning(ros2_here, tmp_path):
    noise = random.Random(1)
    rows = [("/noise", 0.01 * k, UInt8MultiArray(data=noise.randbytes(5000))) for k in range(100)]
    for name, options in {"zstd": {"compressed": True}, "sqlite3": {"storage": "sqlite3"}}.items():
        write_bag(tmp_path / name, rows, **options)
        file = storage_file(tmp_path / name)
        content = file.read_bytes()
        file.write_bytes(content[: len(content) * 7 // 10])
        count, _ = counted(ros2_here, tmp_path / name)
        assert 40 <= count < 75, name


def test_info_of_what_is_no_bag(ros2_here, tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.mcap").write_text("no bag at all")
    write_bag(tmp_path / "odd", ROWS)
    metadata = tmp_path / "odd/metadata.yaml"
    metadata.write_text(metadata.read_text().replace("storage_identifier: mcap", "storage_identifier: papyrus"))
    storage_file(tmp_path / "odd").unlink()
    absent = ros2_here("bag", "info", tmp_path / "absent")
    assert absent.returncode == 2
    assert absent.stderr.endswith(f"error: argument bag_path: Bag path '{tmp_path / 'absent'}' does not exist!\n")
    for path, reason in [
        (tmp_path / "empty", "metadata"),
        (tmp_path / "text.mcap", "magic is invalid"),
        (tmp_path / "odd", "missing"),
    ]:
        info = ros2_here("bag", "info", path)
        assert info.returncode == 1
        assert len(info.stderr.splitlines()) == 1
        assert str(path) in info.stderr and reason in info.stderr


def test_refusals_come_in_one_line(ros2_here, tmp_path):
    write_bag(tmp_path / "bag", ROWS)
    write_bag(tmp_path / "strange", [("/strange", 0.0, Header())], types={"/strange": "nowhere_msgs/msg/Thing"})
    (tmp_path / "qos.yaml").write_text("/words: {reliability: sometimes}")
    play = ["play", tmp_path / "bag"]
    record = ["record", "-o", tmp_path / "new"]
    for arguments, message in [
        ([*play, "-s", "sqlite3"], "is stored as mcap, not as sqlite3"),
        ([*play, "--start-offset", "99"], "--start-offset 99 is past the end: the bag lasts 2.000 s"),
        ([*play, "--topics", "/nothing"], "has /spec, /words"),
        ([*play, "--remap", "/words"], "Remapping '/words' is not 'old:=new'"),
        ([*play, "--qos-profile-overrides-path", tmp_path / "qos.yaml"], "qos.yaml"),
        (["play", tmp_path / "strange"], "install the packages of nowhere_msgs/msg/Thing"),
        (record, "Must specify --topics"),
        ([*record, "-e", "["], "no regular expression"),
        ([*record, "-a", "--custom-data", "operator"], "Custom data 'operator' is not KEY=VALUE"),
        (["record", "-a", "-o", tmp_path / "bag"], f"Output folder '{tmp_path / 'bag'}' already exists."),
        (["record", "-a", "-o", tmp_path / "qos.yaml/bag"], "Cannot write to bag"),
    ]:
        refused = ros2_here("bag", *arguments)
        assert refused.returncode == 1, arguments
        assert message in refused.stderr, arguments
        assert len(refused.stderr.splitlines()) == 1, refused.stderr
    for arguments, message in [
        ([*play, "--rate", "0"], "is not greater than zero"),
        (["play", tmp_path / "absent"], "does not exist!"),
        ([*record, "-a", "-s", "papyrus"], "invalid choice: 'papyrus'"),
        ([*record, "/a", "--topics", "/b"], "not allowed with argument"),
    ]:
        refused = ros2_here("bag", *arguments)
        assert refused.returncode == 2, arguments
        assert message in refused.stderr.splitlines()[-1], refused.stderr
    assert not (tmp_path / "new").exists()
