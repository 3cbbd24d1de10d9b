"""Say what each extra of the requirements brings, and what it takes on the disk.

    python tools/extras.py          reads this environment, in which everything is installed; prints a Markdown table

An extra is a file requirements-NAME.txt. Counted are the blocks of the files that the installed distributions list as
theirs, for the packages that the extra's pins need (their dependencies included) and no extra before it brings.
"""

from __future__ import annotations

import importlib.metadata
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parents[1]
EXTRAS = ("ros", "runtime", "train", "simulate", "develop", "driver")
GRAPHICS_CARD = re.compile(r"nvidia-|triton$|cuda-")  # packages that PyTorch's CPU build does without


def pins(extra: str, root: Path = ROOT) -> list[Requirement]:
    """Read the pins of an extra's requirement file."""
    lines = (root / f"requirements-{extra}.txt").read_text(encoding="utf-8").splitlines()
    stated = (line.partition("#")[0].strip() for line in lines)
    return [Requirement(line) for line in stated if line]


def closure(roots: Iterable[Requirement], needs: Mapping[str, Sequence[str]]) -> set[str]:
    """Name all packages that come with some, given what each says that it needs (as in its metadata)."""
    seen: dict[str, set[str]] = {}
    waiting = list(roots)
    while waiting:
        wanted = waiting.pop()
        name = canonicalize_name(wanted.name)
        if name not in needs or (name in seen and wanted.extras <= seen[name]):
            continue
        seen.setdefault(name, set()).update(wanted.extras)
        for line in needs[name]:
            need = Requirement(line)
            extras = seen[name] or {""}
            if need.marker is None or any(need.marker.evaluate({"extra": extra}) for extra in extras):
                waiting.append(need)
    return set(seen)


def members(needs: Mapping[str, Sequence[str]], root: Path = ROOT) -> dict[str, set[str]]:
    """Name the packages of each extra, their dependencies included."""
    return {extra: closure(pins(extra, root), needs) for extra in EXTRAS}


def _disk(distribution: importlib.metadata.Distribution) -> int:
    """Add up what a distribution's files take, in bytes."""
    paths = {Path(str(distribution.locate_file(file))) for file in distribution.files or []}
    return sum(path.lstat().st_blocks * 512 for path in paths if path.exists())


def main() -> int:
    """Print the table of extras."""
    found = {canonicalize_name(each.metadata["Name"]): each for each in importlib.metadata.distributions()}
    groups = members({name: each.requires or [] for name, each in found.items()})
    sizes: dict[str, int] = {name: _disk(each) for name, each in found.items()}
    before: set[str] = set()
    print("| extra | packages | GB | of it for graphics cards, GB |\n|---|---|---|---|")
    for extra in EXTRAS:
        new = groups[extra] - before
        before |= new
        cards = sum(sizes[name] for name in new if GRAPHICS_CARD.match(name))
        print(f"| {extra} | {len(new)} | {sum(sizes[name] for name in new) / 1e9:.2f} | {cards / 1e9:.2f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
