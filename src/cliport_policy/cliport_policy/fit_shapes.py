"""`ros2 run cliport_policy fit_shapes`: teach the network of outlines what letters, digits and figures look like.

It learns from Matplotlib's fonts and from drawn figures; no scene and no demonstration is seen. Run again, it resumes.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import torch

from cliport_core.command_line import CommandParser
from cliport_policy.data.loader import lost_workers_told, made_ahead
from cliport_policy.errors import ConfigError, PolicyError
from cliport_policy.shapes.fit import DrawnBatches, outline_optimizer, outline_step, share_right
from cliport_policy.shapes.outline_net import OUTLINES, OutlineNet, save_outline_net
from cliport_policy.training.log import ProgressLine
from cliport_policy.training.state import resume_state, save_state
from cliport_policy.training.stopping import stop_on_signals
from cliport_policy.training.trainer import Progress

_BATCH = 128
_SAVE_SECONDS = 60.0
_FRESH = 1_000_000  # number of the first batch that is only asked about
_ASKED = 16  # batches


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    parser = CommandParser(prog="fit_shapes", description="Teach the network of outlines what named shapes look like.")
    parser.add_argument("--steps", type=int, default=3000, help=f"steps of {_BATCH} drawings (default 3000)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=OUTLINES, help="file of the weights (default the shipped one)")
    parser.add_argument("--state", required=True, type=Path, help="folder of what is learned, to go on from")
    args = parser.parse_args(argv)
    stopped = stop_on_signals()
    try:
        for name, value, least in (("--steps", args.steps, 1), ("--seed", args.seed, 0)):
            if value < least:
                raise ConfigError(f"{name} is {value}: give {least} or more")
        batches = DrawnBatches(_BATCH, args.seed)
        with lost_workers_told():
            net = _fit(batches, args.steps, args.state, lambda: bool(stopped))
        if net is None:
            print(f"stopped; what was learned is in {args.state}: the same command goes on")
            return 130
        right = [share_right(net, batches.batch(_FRESH + number)) for number in range(_ASKED)]
        save_outline_net(net, args.out)
    except PolicyError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"written {args.out}: {100 * sum(right) / len(right):.1f} % of {_ASKED * _BATCH} new drawings named rightly")
    return 0


def _fit(batches: DrawnBatches, steps: int, folder: Path, is_stopped: Callable[[], bool]) -> OutlineNet | None:
    """Return the net, learned; None if it was stopped on the way."""
    torch.manual_seed(batches.seed)
    net = OutlineNet()
    optimizer = outline_optimizer(net)
    identity = {"batch": batches.size, "seed": batches.seed, "steps_of_schedule": steps}
    first = resume_state(folder, {"outlines": net}, optimizer, identity)
    line, began = ProgressLine(sys.stderr), time.monotonic()
    saved, ahead = began, range(first, steps)
    for step, batch in zip(ahead, made_ahead(batches.batch, ahead, workers=1), strict=True):
        loss, done, now = outline_step(net, optimizer, batch, step, steps), step + 1, time.monotonic()
        pace = (done - first) / (now - began)
        left = (steps - done) / pace / 60
        line(Progress(done, steps, {"loss": loss}, optimizer.param_groups[0]["lr"], batches.size * pace, left))
        if is_stopped() or now - saved >= _SAVE_SECONDS or done == steps:
            saved = now
            save_state(folder, {"outlines": net}, optimizer, done, identity)
        if is_stopped() and done < steps:
            return None
    return net.eval()


if __name__ == "__main__":
    sys.exit(main())
