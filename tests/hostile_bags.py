"""Bags that are made to exhaust memory, and a reading of an episode in a process that may have little.

    python tests/hostile_bags.py [MIB]

makes the two and prints what a read of each takes; MIB: the memory that it may take beyond what the imports do.
"""

from __future__ import annotations

import struct
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from backports import zstd

MEBIBYTE = 1 << 20
HUGE = 1800 * MEBIBYTE
DENSE = 578 * MEBIBYTE
MAGIC = b"\x89MCAP0\r\n"
ROOM = 100  # MiB of memory that a read may ask for beyond what the imports do
TIMEOUT = 120  # s
READER = f"""
import resource, sys, time
from pathlib import Path
from cliport_episodes import bags, data_set_file, episode_folder
from cliport_episodes.errors import EpisodesError

def peak():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

path, before = Path(sys.argv[1]), peak()
mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (mapped + int(sys.argv[3]) * {MEBIBYTE},) * 2)
begin = time.perf_counter()
try:
    if sys.argv[2] == "messages":
        said = f"{{len(list(bags.read_messages(path, complain=print)))}} messages"
    elif sys.argv[2] == "edits":
        said = episode_folder.read_edits(path)[1]
    else:
        said = str(data_set_file.read_setup(path))
except EpisodesError as error:
    said = str(error)
print(said)
print(peak() - before, time.perf_counter() - begin)
"""


@dataclass(frozen=True)
class Reading:
    """What a read said, and what it took beyond the imports: memory [KiB] and time [s]."""

    said: str
    memory: int
    seconds: float


def read_in_child(path: Path, what: str = "messages", room: int = ROOM) -> Reading:
    """Read a bag's messages, an episode's edits or a data set's setup in a process that may have little memory."""
    done = subprocess.run(
        [sys.executable, "-c", READER, str(path), what, str(room)], capture_output=True, text=True, timeout=TIMEOUT
    )
    assert done.returncode == 0, done.stderr[-2000:]
    *said, figures = done.stdout.splitlines()
    memory, seconds = figures.split()
    return Reading("\n".join(said), int(memory), float(seconds))


def record(kind: int, content: bytes) -> bytes:
    return bytes([kind]) + struct.pack("<Q", len(content)) + content


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def chunk(compression: bytes, content: bytes, declared: int, start: int = 0, end: int = 10) -> bytes:
    fields = struct.pack("<QQQI", start, end, declared, 0) + text(compression)
    return record(0x06, fields + struct.pack("<Q", len(content)) + content)


def zeros(size: int) -> bytes:
    """Return zeros of that size as a frame of Zstandard that does not say its size, made piece by piece."""
    compressor = zstd.ZstdCompressor()
    pieces = [compressor.compress(bytes(MEBIBYTE)) for _ in range(size // MEBIBYTE)]
    return b"".join([*pieces, compressor.flush()])


def sized_frame(size: int) -> bytes:
    """Return a whole frame of Zstandard that says its size; it is made of a magic, a header and empty blocks."""
    return b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", size) + b"\x01\x00\x00"


def write_mcap(path: Path, *records: bytes, footer: bool = True) -> Path:
    end = record(0x02, bytes(20)) + MAGIC if footer else b""
    path.write_bytes(MAGIC + record(0x01, text(b"ros2") + text(b"test")) + b"".join(records) + end)
    return path


def bomb(levels: int) -> str:
    """Return YAML in which each of some lists has nine times the one before."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    for level in range(1, levels):
        lines.append(f"a{level}: &a{level} [" + ", ".join([f"*a{level - 1}"] * 9) + "]")
    return "\n".join(lines) + "\n"


def write_zeros(path: Path) -> Path:
    """Write a storage file of 18.5 kB whose one chunk declares 578 MiB of zeros, and holds them."""
    return write_mcap(path, chunk(b"zstd", dense_zeros(DENSE), DENSE))


def dense_zeros(size: int) -> bytes:
    """Return zeros of that size as a frame of Zstandard, as small as its blocks of 128 KiB allow."""
    block = (1 << 17 << 3 | 2).to_bytes(3, "little") + b"\0"  # a run of one byte
    last = (1 << 17 << 3 | 3).to_bytes(3, "little") + b"\0"
    return b"\x28\xb5\x2f\xfd\x00\x58" + block * (size // (1 << 17) - 1) + last


def write_aliases(folder: Path) -> Path:
    """Write an episode's folder with a metadata.yaml of some hundred bytes of aliases."""
    folder.mkdir()
    lines = "".join(f"  {line}\n" for line in bomb(7).splitlines())
    (folder / "metadata.yaml").write_text(f"rosbag2_bagfile_information:\n custom_data:\n{lines}")
    return folder


def main() -> None:
    """Print what reads of the two take."""
    with tempfile.TemporaryDirectory() as place:
        file = write_zeros(Path(place) / "zeros.mcap")
        folder = write_aliases(Path(place) / "aliases")
        for path, what in ((file, "messages"), (folder, "edits")):
            size = path.stat().st_size if path.is_file() else (path / "metadata.yaml").stat().st_size
            begin = time.perf_counter()
            reading = read_in_child(path, what, int(sys.argv[1]) if sys.argv[1:] else ROOM)
            whole = time.perf_counter() - begin
            print(
                f"{path.name}, {size} bytes: {reading.memory / 1024:.1f} MiB, {reading.seconds * 1000:.1f} ms", end=""
            )
            print(f" ({whole:.1f} s with the imports): {reading.said.replace(place, '')}")


if __name__ == "__main__":
    main()
