"""Make the cmake files of the ROS wheels name this virtual environment.

The wheels were built under another Python prefix, and their exported targets still name its include and
library folders, so packages of messages would not compile. A call rewrites what is left of that prefix; a
second one changes nothing.
"""

from __future__ import annotations

import re
import sys
import sysconfig
from pathlib import Path

BUILDER_PREFIX = r"/opt/python/cp\d+-cp\d+"


def repaired(text: str, include: str, lib: str) -> str:
    """Return the text of a cmake file with the builder's prefix replaced by this interpreter's folders."""
    text = re.sub(BUILDER_PREFIX + r"/include/python3\.\d+", lambda _: include, text)
    return re.sub(BUILDER_PREFIX + r"/lib(?=/)", lambda _: lib, text)


def main() -> int:
    """Repair the environment that runs this, and say how many files changed."""
    prefix = Path(sys.prefix)
    include, lib = sysconfig.get_path("include"), str(prefix / "lib")
    if not (Path(include) / "Python.h").is_file():
        print(
            f"error: {include}/Python.h is missing: install the headers of this Python (python3-dev)",
            file=sys.stderr,
        )
        return 1
    changed = 0
    for path in sorted(prefix.glob("share/*/cmake/*.cmake")):
        before = path.read_text()
        after = repaired(before, include, lib)
        if after != before:
            path.write_text(after)
            changed += 1
    print(f"{changed} cmake files repaired")
    return 0


if __name__ == "__main__":
    sys.exit(main())
