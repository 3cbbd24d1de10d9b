"""`ros2 run cliport_policy fit_shapes`: teach the network of outlines what letters, digits and figures look like.

It learns from Matplotlib's fonts and from drawn figures; no scene and no demonstration is seen. Run again, it resumes.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import torch

from cliport_core.command_line import CommandParser
from cliport_policy.data.loader import lost_workers_told
from cliport_policy.errors import PolicyError
from cliport_policy.settings import check_least
from cliport_policy.shapes.fit import DrawnBatches, outline_optimizer, outline_step, share_right
from cliport_policy.shapes.outline_net import OUTLINES, OutlineNet, save_outline_net
from cliport_policy.training.state import resume_state, save_state
from cliport_policy.training.steps import Schedule, take_steps
from cliport_policy.training.stopping import stop_on_signals

_BATCH = 128
_SAVE_SECONDS = 60.0
_FRESH = 1_000_000  # number of the first batch that is only asked about
_ASKED = 16  # batches


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    parser = CommandParser(prog="fit_shapes", description="Teach the network of outlines what named shapes look like.")
    parser.add_argument("--steps", type=int, default=4000, help=f"steps of {_BATCH} drawings (default 4000)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=OUTLINES, help="file of the weights (default the shipped one)")
    parser.add_argument("--state", required=True, type=Path, help="folder of what is learned, to go on from")
    args = parser.parse_args(argv)
    stopped = stop_on_signals()
    try:
        check_least("--steps", args.steps, 1)
        check_least("--seed", args.seed, 0)
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
    done = take_steps(
        Schedule(first, steps, batches.size, _SAVE_SECONDS),
        batches.batch,
        lambda step, batch: {"loss": outline_step(net, optimizer, batch, step, steps)},
        optimizer,
        lambda behind: save_state(folder, {"outlines": net}, optimizer, behind, identity),
        is_stopped,
    )
    return net.eval() if done else None


if __name__ == "__main__":
    sys.exit(main())
