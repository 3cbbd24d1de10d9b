"""`ros2 run cliport_policy dataset --from-bags DIR ... --out DIR`: recorded episodes as a training set."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.errors import EpisodesError
from cliport_policy.data.episode_folders import find_episodes
from cliport_policy.data.from_bags import Selection, Tally, make_data_set
from cliport_policy.errors import PolicyError

_EVERY_S = 1.0  # pause between lines of progress


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    args = _parser().parse_args(argv)
    try:
        workspace = None if args.workspace is None else WorkspaceSpec.load(args.workspace)
        selection = Selection(unmarked=not args.only_success, failed=args.with_failed)
        paths = find_episodes(args.from_bags)
        tally = make_data_set(paths, args.out, selection, workspace, _Progress(len(paths)))
    except (PolicyError, CoreError, EpisodesError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; nothing was written", file=sys.stderr)
        return 130
    _report(tally, args.out)
    return 0


class _Progress:
    """Progress display that prints at most one line a second."""

    def __init__(self, total: int) -> None:
        self._total, self._started = total, time.monotonic()
        self._shown = self._started

    def __call__(self, done: int, tally: Tally) -> None:
        now = time.monotonic()
        if now - self._shown < _EVERY_S:
            return
        self._shown = now
        left = (self._total - done) * (now - self._started) / done
        print(f"{done} of {self._total} episodes, {tally.steps} steps, {left:.0f} s left", file=sys.stderr, flush=True)


def _report(tally: Tally, out: Path) -> None:
    for complaint in tally.complaints:
        print(f"note: {complaint}")
    for what, counts in (("episode", tally.episodes_left_out), ("step", tally.steps_left_out)):
        for reason, count in sorted(counts.items()):
            print(f"left out: {count} {what}{'s' if count > 1 else ''}, {reason}")
    print(f"{tally.episodes} episodes, {tally.steps} steps and {tally.finished} finished scenes in {out}")


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="dataset", description="Make a training set of recorded episodes.")
    add = parser.add_argument
    add("--from-bags", type=Path, nargs="+", required=True, metavar="DIR", help="data sets of episodes, or episodes")
    add("--out", type=Path, required=True, metavar="DIR", help="folder of the training set; must not exist")
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--only-success", action="store_true", help="leave out what is not marked as a success")
    which.add_argument("--with-failed", action="store_true", help="use what is marked as a failure, too")
    add("--workspace", type=Path, metavar="FILE", help="of the heightmaps; default: what was recorded for")
    return parser


if __name__ == "__main__":
    sys.exit(main())
