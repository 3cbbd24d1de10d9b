"""`ros2 bag info` and `play` on bags that are made to exhaust memory: one clear line, and little memory."""

from __future__ import annotations

import struct
import subprocess
import sys
from pathlib import Path

import lz4.frame
import pytest
from hostile_bags import HUGE, MAGIC, MEBIBYTE, bomb, chunk, record, sized_frame, text, write_mcap, zeros
from ros2_bags import ROS2, TIMEOUT, storage_file, write_bag
from std_msgs.msg import String

PEAK = f"""
import os, resource, sys
_, status = os.waitpid(os.posix_spawn({ROS2!r}, [{ROS2!r}, "bag", *sys.argv[1:]], os.environ), 0)
print("peak", resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, file=sys.stderr)
sys.exit(os.waitstatus_to_exitcode(status))
"""
# A read of a good bag stays below 60 MiB.
MOST = 150 * 1024  # KiB


def inspect(*arguments: str | Path) -> tuple[int, str]:
    """Run `ros2 bag` and return its exit status and what it said, after a check of the memory that it took."""
    done = subprocess.run(
        [sys.executable, "-S", "-c", PEAK, *map(str, arguments)],  # -S: it needs no site's packages
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        stdin=subprocess.DEVNULL,
    )
    *said, peak = done.stderr.splitlines()
    assert int(peak.split()[1]) < MOST, (peak, said)
    return done.returncode, "\n".join(said)


@pytest.mark.parametrize("footer", [True, False])
@pytest.mark.parametrize(
    ("content", "declared", "message"),
    [
        (zeros(HUGE), HUGE, "declares 1800 MiB, more than 256 MiB"),
        (zeros(HUGE), 1000, "declares 1000 bytes and holds more"),
        (sized_frame(HUGE), 1000, "declares 1000 bytes and holds more"),
    ],
)
def test_chunks_are_refused_before_they_are_decompressed(tmp_path, content, declared, message, footer):
    path = write_mcap(tmp_path / "bomb.mcap", chunk(b"zstd", content, declared), footer=footer)
    assert path.stat().st_size < 200_000
    for verb in ("info", "play"):
        status, said = inspect(verb, path)
        assert status == 1
        assert said == f"Cannot read bag '{path}': the chunk at byte 33 {message}"


def test_chunks_of_lz4_are_counted(tmp_path):
    content = lz4.frame.compress(bytes(600 * MEBIBYTE), store_size=False)
    status, said = inspect("info", write_mcap(tmp_path / "bomb.mcap", chunk(b"lz4", content, 1000), footer=False))
    assert (status, said.count("\n")) == (1, 0)
    assert "declares 1000 bytes and holds more" in said


def test_chunks_that_would_be_held_together_are_refused(tmp_path):
    size = 200 * MEBIBYTE
    one = chunk(b"zstd", zeros(size), size)
    offsets = [33 + len(one) * number for number in range(6)]
    index = [
        record(0x08, struct.pack("<QQQQ", 0, 10, offset, len(one)) + text(b"") + struct.pack("<Q", 0) + text(b"zstd")
               + struct.pack("<QQ", len(one) - 53, size))
        for offset in offsets
    ]  # fmt: skip
    body = MAGIC + record(0x01, text(b"ros2") + text(b"test")) + one * 6
    footer = record(0x02, struct.pack("<QQI", len(body), 0, 0)) + MAGIC
    (tmp_path / "bomb.mcap").write_bytes(body + b"".join(index) + footer)
    status, said = inspect("info", tmp_path / "bomb.mcap")
    assert status == 1
    assert said.endswith("chunks that overlap in time declare more than 1024 MiB")


def test_metadata_with_aliases_or_without_end_is_refused(tmp_path):
    write_bag(tmp_path / "bag", [("/words", 0.0, String(data="word"))])
    metadata = tmp_path / "bag/metadata.yaml"
    good = metadata.read_text()
    for addition, message in [
        (bomb(8), "its YAML has an alias in line"),
        ("deep: " + "[" * 10_000 + "]" * 10_000, "its YAML is nested deeper than 50"),
        ("long: " + "x" * 5 * MEBIBYTE, "its YAML has 5 MiB, more than 4 MiB"),
    ]:
        metadata.write_text(good + addition)
        status, said = inspect("info", tmp_path / "bag")
        assert status == 1
        assert said.startswith(f"Cannot read bag '{tmp_path / 'bag'}': {message}")
        assert "\n" not in said


def test_qos_with_aliases_in_a_storage_file_is_refused(tmp_path):
    qos = text(b"offered_qos_profiles") + text(bomb(8).encode())
    schema = record(0x03, struct.pack("<H", 1) + text(b"std_msgs/msg/String") + text(b"ros2msg") + text(b""))
    channel = record(0x04, struct.pack("<HH", 1, 1) + text(b"/words") + text(b"cdr") + text(qos))
    status, said = inspect("info", write_mcap(tmp_path / "bomb.mcap", schema, channel))
    assert status == 1
    assert "its YAML has an alias in line" in said
    assert "\n" not in said


def test_a_good_bag_is_read_within_the_memory(tmp_path):
    write_bag(
        tmp_path / "bag", [("/words", 0.01 * k, String(data="word" * 1000)) for k in range(2000)], compressed=True
    )
    assert inspect("info", tmp_path / "bag") == (0, "")
    assert storage_file(tmp_path / "bag").stat().st_size < MEBIBYTE
