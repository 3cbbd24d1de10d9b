"""`ros2 run cliport_policy lerobot`: recorded episodes to LeRobot's dataset format (v3.0), and back.

`--from-bags DIR ... --out DIR` writes one that LeRobot opens, `--to-bags DIR --out DIR` makes episodes of it again.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_episodes.errors import EpisodesError
from cliport_policy.data.episode_folders import find_episodes
from cliport_policy.data.from_lerobot import read_lerobot
from cliport_policy.data.to_lerobot import write_lerobot
from cliport_policy.errors import PolicyError


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    args = _parser().parse_args(argv)
    try:
        if args.to_bags is not None:
            episodes, steps = read_lerobot(args.to_bags, args.out)
        else:
            paths = find_episodes(args.from_bags)
            episodes, steps = write_lerobot(paths, args.out, lambda done, steps: _show(done, len(paths), steps))
    except (PolicyError, CoreError, EpisodesError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; nothing was written", file=sys.stderr)
        return 130
    print(f"{episodes} episodes with {steps} steps in {args.out}")
    return 0


def _show(done: int, total: int, steps: int) -> None:
    print(f"{done} of {total} episodes, {steps} steps", file=sys.stderr, flush=True)


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="lerobot", description="Write recorded episodes in LeRobot's format (v3.0), or back.")
    which = parser.add_mutually_exclusive_group(required=True)
    which.add_argument("--from-bags", type=Path, nargs="+", metavar="DIR", help="data sets of episodes, or episodes")
    which.add_argument("--to-bags", type=Path, metavar="DIR", help="a data set of LeRobot that was written here")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write; must not exist")
    return parser


if __name__ == "__main__":
    sys.exit(main())
