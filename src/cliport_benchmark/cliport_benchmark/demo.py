"""`make demo`: the whole graph does what a sentence says, watched from outside; pictures go to out/demo/."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from PIL import Image

from cliport_benchmark.animation import Animation
from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_client import JUDGED_AFTER, OVERLAYS, GraphClient
from cliport_benchmark.graph_episode import EPISODE_TIMEOUT, Played, Progress, play_episode
from cliport_benchmark.graph_process import GraphProcess
from cliport_core.command_line import CommandParser
from cliport_core.errors import InstructionError
from cliport_core.instruction import asks_to_stop, normalized_instruction
from cliport_interfaces.msg import PolicyStatus

READY_TIMEOUT = 120.0


def main(argv: list[str] | None = None) -> int:
    """Run the demo; return 0 when the task was done."""
    args = _parser().parse_args(argv)
    out = Path(args.out)
    start = time.monotonic()
    try:
        out.mkdir(parents=True, exist_ok=True)
        for picture in (*out.glob("*.png"), *out.glob("*.gif")):
            picture.unlink()  # of an earlier run
        progress, ended = _run(args, out)
    except (BenchmarkError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted", file=sys.stderr)
        return 130
    if not ended.ended_well:
        print(f"demo: the policy ended with: {ended.message}")
    print(
        f"demo: {'success' if progress.done else 'failure'} task={args.task} seed={args.seed} "
        f"score={progress.score:.2f} steps={ended.steps} wall_s={time.monotonic() - start:.1f}"
    )
    return 0 if progress.done else 1


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="demo", description="Watch the graph do what a sentence says.")
    parser.add_argument("--task", default="put-blocks-in-bowls-seen-colors")
    parser.add_argument("--seed", type=int, default=3)
    parser.add_argument("--instruction", default="", type=_instruction)
    parser.add_argument("--checkpoint", default="default", help="path, name of a shipped one, or default")
    parser.add_argument("--out", default="out/demo")
    return parser


def _run(args: argparse.Namespace, out: Path) -> tuple[Progress, Played]:
    _say(f"starting the graph (its output: {out}/graph.log)")
    arguments = {"task": args.task, "split": "test", "seed": str(args.seed), "checkpoint": args.checkpoint}
    animation = Animation()
    with (
        GraphProcess("sim.launch.yaml", arguments, out / "graph.log") as graph,
        GraphClient("demo") as client,
    ):
        try:
            client.wait_ready(READY_TIMEOUT, lambda: graph.healthy)
            instruction = _set_scene(client, args)
            time.sleep(1.0)  # a camera frame of the new scene
            Image.fromarray(client.camera_image()).save(out / "before.png")
            _say(f"instruction: {instruction}")
            client.on_status = _StatusPrinter()
            client.on_frame = animation.take
            if args.instruction:
                asked = client.instruct_and_wait(instruction, EPISODE_TIMEOUT, lambda: graph.healthy)
                ended = Played(0.0, asked.steps, asked.message, (instruction,), asked.succeeded)
            else:
                ended = play_episode(
                    client, instruction, client.max_steps, EPISODE_TIMEOUT, lambda: graph.healthy, JUDGED_AFTER
                )
            progress = client.judged()
        except BenchmarkError as error:
            errors = [line for line in graph.log_text().splitlines() if "error:" in line]
            raise BenchmarkError(f"{error}{' | ' + errors[-1] if errors else ''} (see {graph.log_path})") from error
        Image.fromarray(client.camera_image()).save(out / "after.png")
        for topic in OVERLAYS:
            for step, picture in enumerate(client.overlays(topic), start=1):
                Image.fromarray(picture).save(out / f"step{step}_{topic.rpartition('/')[2]}.png")
    animation.save(out / "demo.gif")
    _say(f"pictures in {out}/: before.png, after.png, step*_pick.png, step*_place.png, demo.gif")
    return progress, ended


def _set_scene(client: GraphClient, args: argparse.Namespace) -> str:
    """Make the seed's scene, for the instruction if one is given, and return the sentence for the robot."""
    if not args.instruction:
        return client.reset(args.task, "test", args.seed)
    try:
        client.reset(args.task, "test", args.seed, args.instruction)
    except BenchmarkError as error:
        _say(f"{error}; the scene is the seed's own")
        client.reset(args.task, "test", args.seed)
    return str(args.instruction)


def _instruction(text: str) -> str:
    """Return what the policy server will take; argparse says in one line why not."""
    try:
        said = normalized_instruction(text)
    except InstructionError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    if said and asks_to_stop(said):
        raise argparse.ArgumentTypeError(f"'{said}' asks for nothing to be done: say what is to be done")
    return said


class _StatusPrinter:
    """Prints each new status once."""

    def __init__(self) -> None:
        self._last = ""

    def __call__(self, status: PolicyStatus) -> None:
        if status.message != self._last:
            self._last = status.message
            _say(status.message)


def _say(text: str) -> None:
    print(f"demo: {text}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
