"""`ros2 run cliport_policy explain`: one picture of what a policy sees, scores and decides.

The observation comes from a data set's row (`--data DIR --row N`), from the running graph (`--live`), or from a bag
(`--bag FOLDER --row N`).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from cliport_core import topics
from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_core.heightmap import Heightmap
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.errors import DataError, PolicyError
from cliport_policy.explain_picture import render_explanation
from cliport_policy.overlays import save_png
from cliport_policy.policy import load_policy


class Scene(NamedTuple):
    """Observation to explain.

    instruction: the sentence recorded with it, if any. goal: an image of the finished scene, if known.
    """

    observation: Heightmap
    instruction: str | None = None
    goal: Heightmap | None = None


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    args = _parser().parse_args(argv)
    try:
        policy = load_policy(args.checkpoint)
        scene = _scene(args)
        instruction = args.instruction if args.instruction is not None else scene.instruction
        if instruction is None:
            raise DataError("give --instruction: only a data set's row comes with one")
        explanation = policy.explain(scene.observation, instruction, scene.goal)
        save_png(args.out, render_explanation(scene.observation, instruction, explanation))
    except (PolicyError, CoreError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: can't write {args.out} ({error.strerror or error}): give another --out", file=sys.stderr)
        return 1
    print(args.out)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="explain", description="Picture what a policy sees, scores and decides: observation, affordances, crop."
    )
    parser.add_argument("--checkpoint", default="default", help="a .safetensors file, a training folder or a name")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--data", type=Path, metavar="DIR", help="data set that cliport_benchmark generate wrote")
    source.add_argument("--bag", type=Path, metavar="FOLDER", help=f"bag with {topics.HEIGHTMAP}")
    source.add_argument("--live", action="store_true", help="the running graph's next heightmap")
    parser.add_argument("--row", type=int, default=0, metavar="N", help="observation of --data or --bag, from 0")
    parser.add_argument("--instruction", help="default: the one of the data set's row")
    parser.add_argument("--timeout", type=float, default=10.0, metavar="S", help="of --live")
    parser.add_argument("--out", type=Path, default=Path("explain.png"))
    return parser


def _scene(args: argparse.Namespace) -> Scene:
    if args.data:
        return data_scene(args.data, args.row)
    from cliport_policy import ros_heightmaps  # only here is ROS needed

    if args.live:
        return Scene(ros_heightmaps.live_heightmap(args.timeout))
    observation, last = ros_heightmaps.bag_heightmaps(args.bag, args.row)
    return Scene(observation, goal=last)


def data_scene(folder: Path, row: int) -> Scene:
    """Return a data set's observation by its number in the order of task, episode and step, with its instruction.

    Raises:
        DataError: if there is none of that number.
    """
    data = load_demonstrations(folder)
    if not 0 <= row < len(data.frames):
        raise DataError(f"{folder} holds {len(data.frames)} observations, numbered from 0: there is none {row}")
    frame, goal = data.frames[row], data.goal_frames().get(row)
    return Scene(
        data.observation(frame),
        frame.demos[0].instruction,
        None if goal is None else data.observation(data.frames[goal]),
    )


if __name__ == "__main__":
    sys.exit(main())
