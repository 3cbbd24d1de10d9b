"""Write requirements-locked.txt: every package of every extra with its version and the hash of its file.

    python tools/lock.py                   asks pip what it would install (some minutes; it installs nothing)
    python tools/lock.py --report FILE     takes an answer of `pip install --dry-run --report FILE`

Each line ends with the extras that need the package, so that `make setup LOCKED=1` takes those of the chosen ones. No
address is written down: pip looks for the files where it always does. The lock holds for the Python and the kind of
machine that it was made on.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from extras import EXTRAS, ROOT, members
from packaging.utils import canonicalize_name

LOCK = ROOT / "requirements-locked.txt"


def pins_digest(root: Path = ROOT) -> str:
    """Digest the pins of all extras: another digest means that the lock must be made anew."""
    lines = [line for extra in EXTRAS for line in (root / f"requirements-{extra}.txt").read_text("utf-8").splitlines()]
    stated = sorted(filter(None, (line.partition("#")[0].strip() for line in lines)))
    return hashlib.sha256("\n".join(stated).encode()).hexdigest()[:16]


def lock_text(report: Mapping[str, Any], root: Path = ROOT) -> str:
    """Write the lock for a report of pip's.

    Raises:
        ValueError: a package has no SHA-256, or an extra's pin is not in the report.
    """
    packages = {canonicalize_name(each["metadata"]["name"]): each for each in report["install"]}
    groups = members({name: each["metadata"].get("requires_dist", []) for name, each in packages.items()}, root)
    where = report["environment"]
    lines = [
        "# Written by tools/lock.py: do not edit. `make setup LOCKED=1` installs these very files.",
        f"# Python and machine: {where['python_version']} {where['platform_machine']}",
        f"# Pins: {pins_digest(root)}",
    ]
    for name in sorted(packages):
        hashes = packages[name]["download_info"].get("archive_info", {}).get("hashes", {})
        if "sha256" not in hashes:
            raise ValueError(f"pip's report has no SHA-256 of {name}")
        if needed := [extra for extra in EXTRAS if name in groups[extra]]:
            version = packages[name]["metadata"]["version"]
            lines.append(f"{name}=={version} --hash=sha256:{hashes['sha256']}  # {' '.join(needed)}")
    return "\n".join(lines) + "\n"


def ask_pip() -> Any:
    """Ask pip what it would install for all extras into an empty environment."""
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "report.json"
        files = [part for extra in EXTRAS for part in ("-r", str(ROOT / f"requirements-{extra}.txt"))]
        asked = [sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--quiet"]
        subprocess.run([*asked, "--report", str(answer), *files], check=True)
        return json.loads(answer.read_text("utf-8"))


def main() -> int:
    """Write the lock."""
    parser = argparse.ArgumentParser(prog="python tools/lock.py", description="Write requirements-locked.txt.")
    parser.add_argument("--report", type=Path, help="pip's report, when it is there already")
    arguments = parser.parse_args()
    report = json.loads(arguments.report.read_text("utf-8")) if arguments.report else ask_pip()
    LOCK.write_text(lock_text(report), encoding="utf-8")
    print(f"{LOCK.name}: {sum(' --hash=' in line for line in LOCK.read_text('utf-8').splitlines())} packages")
    return 0


if __name__ == "__main__":
    sys.exit(main())
