"""Pages that are killed beside the running graph, each followed at once by another: how many of those hear the camera.

    python tests/killed_pages.py --pages 40

A killed process may leave harm in Fast DDS's shared memory (docs/motion_safety.md). It ends at the first page that
shows no picture within 20 s, and prints what that one says.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from page_person import Person, workplace

_PATIENCE = 20.0  # until a page that was started has a picture [s]
_LONGEST_LIFE = 2.0  # of a page with a picture, which is killed at any moment of it [s]


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pages", type=int, default=40)
    options = parser.parse_args()
    lives = np.random.default_rng(0).uniform(0.0, _LONGEST_LIFE, options.pages)
    domain = int(os.environ.get("ROS_DOMAIN_ID", "61"))
    with tempfile.TemporaryDirectory() as root, workplace(Path(root), domain, speed=1.0) as place:
        person = Person(place.browser, place.app.address)
        person.sees("ready")
        for number, life in enumerate(lives, start=1):
            time.sleep(life)
            place.kill_and_restart()
            person.page.reload()
            try:
                person.sees("ready", "failed", timeout=_PATIENCE)
            except AssertionError as error:
                print(f"page {number}: {error}")
                return 1
            print(f"page {number} has a picture", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
