"""Episodes, and bags read as such, that are made to exhaust memory: one clear line, in a process that has little."""

from __future__ import annotations

from pathlib import Path

import pytest
from hostile_bags import (
    DENSE,
    HUGE,
    bomb,
    chunk,
    dense_zeros,
    read_in_child,
    sized_frame,
    write_aliases,
    write_mcap,
    write_zeros,
    zeros,
)
from ros2_bags import storage_file, write_bag
from std_msgs.msg import String

MOST = 32 * 1024  # KiB that a refusal may take


@pytest.mark.parametrize("footer", [True, False])
@pytest.mark.parametrize(
    ("content", "declared", "message"),
    [
        (dense_zeros(DENSE), DENSE, "declares 578 MiB, more than 256 MiB"),
        (zeros(HUGE), 1000, "declares 1000 bytes and holds more"),
        (sized_frame(HUGE), 1000, "declares 1000 bytes and holds more"),
    ],
)
def test_chunks_are_refused_before_they_are_decompressed(tmp_path, content, declared, message, footer):
    path = write_mcap(tmp_path / "bomb.mcap", chunk(b"zstd", content, declared), footer=footer)
    reading = read_in_child(path)
    assert reading.said == f"'{path}' is not read: the chunk at byte 33 {message}"
    assert reading.memory < MOST


def test_a_chunk_in_a_folder_without_metadata_is_refused(tmp_path):
    """Its files are read as torn ones."""
    path = write_zeros(tmp_path / "step_000.mcap")
    reading = read_in_child(tmp_path)
    assert reading.said.endswith("is not read: the chunk at byte 33 declares 578 MiB, more than 256 MiB")
    assert path.stat().st_size < 18_700
    assert reading.memory < MOST


def test_edits_with_aliases_are_refused(tmp_path):
    folder = write_aliases(tmp_path / "episode")
    assert (folder / "metadata.yaml").stat().st_size < 500
    reading = read_in_child(folder, "edits")
    assert reading.said.startswith("metadata.yaml is not read: its YAML has an alias in line 4")
    assert reading.memory < MOST


def test_a_setup_with_aliases_is_refused(tmp_path):
    (tmp_path / "dataset.yaml").write_text(bomb(7) + "format: 1\nworkspace: *a6\n")
    reading = read_in_child(tmp_path, "setup")
    assert "does not describe a data set: its YAML has an alias in line 2" in reading.said
    assert reading.memory < MOST


def test_a_good_bag_is_read_within_the_memory(tmp_path):
    bag: Path = tmp_path / "bag"
    write_bag(bag, [("/words", 0.01 * k, String(data="word" * 1000)) for k in range(2000)], compressed=True)
    assert storage_file(bag).stat().st_size < 1 << 20
    assert read_in_child(bag).said == "2000 messages"
