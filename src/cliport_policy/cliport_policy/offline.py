"""`ros2 run cliport_policy offline --bag DIR`: what the policy would have done in recorded scenes, without a graph.

The bags are data sets of episodes, episodes, or any bag with colour, depth, camera_info, tf_static, instruction and
pick and place poses. The same bags and weights give the same offline.json.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cliport_core import topics
from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_core.heap import trim_heap
from cliport_episodes.errors import EpisodesError
from cliport_episodes.reader import read_episode
from cliport_policy.comparison import Comparison, RecordedStep, Span, compare
from cliport_policy.data.episode_folders import episodes_in
from cliport_policy.data.plain_bags import plain_steps
from cliport_policy.errors import ConfigError, InstructionError, PolicyError
from cliport_policy.offline_report import REPORT_NAME, save_worst, table, write_report
from cliport_policy.policy import Policy, load_policy

_TOPICS = {
    "color_image": topics.COLOR,
    "camera_info": topics.CAMERA_INFO,
    "depth_image": topics.DEPTH,
    "instruction": topics.INSTRUCTION,
    "pick_pose": topics.PICK_POSE,
    "place_pose": topics.PLACE_POSE,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    args = _parser().parse_args(argv)
    try:
        if args.worst < 0:
            raise ConfigError(f"--worst is {args.worst}: give 0 or more")
        policy = load_policy(args.checkpoint)
        run = OfflineRun(policy, args.worst, {ours: getattr(args, name) for name, ours in _TOPICS.items()})
        started = time.monotonic()
        for bag in args.bag:
            run.add(bag)
        seconds = time.monotonic() - started
        write_report(args.out, args.checkpoint, run.comparisons, run.finished)
        pictures = save_worst(args.out, policy, run.worst)
    except (PolicyError, CoreError, EpisodesError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; nothing was written", file=sys.stderr)
        return 130
    for complaint in run.complaints:
        print(f"note: {complaint}")
    print(table(run.comparisons))
    pace = f"{run.recorded_s:.1f} s of recording in {seconds:.1f} s: {run.recorded_s / max(seconds, 1e-9):.1f} x"
    print(f"{pace}; {', '.join(str(path) for path in (args.out / REPORT_NAME, *pictures))}")
    return 0


@dataclass
class OfflineRun:
    """Pass through bags that keeps the steps with the greatest errors for their pictures.

    n_worst: number of those; renamed: topics of plain bags, by the names of the options.
    """

    policy: Policy
    n_worst: int = 0
    renamed: dict[str, str] = field(default_factory=dict)
    comparisons: list[Comparison] = field(default_factory=list)
    finished: list[dict[str, Any]] = field(default_factory=list)
    worst: list[tuple[Comparison, RecordedStep]] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)
    recorded_s: float = 0.0

    def add(self, bag: Path) -> None:
        """Compare the steps of a data set, an episode, or a plain bag."""
        episodes = episodes_in(bag)
        for path in episodes:
            span = Span()
            self._compare(self._episode_steps(path, span))
            self.recorded_s += span.seconds
        if not episodes:
            span = Span()
            self._compare(plain_steps(bag, self.policy.workspace, span, self.complaints.append, self.renamed))
            self.recorded_s += span.seconds

    def _compare(self, steps: Iterator[RecordedStep]) -> None:
        for step in steps:
            comparison = compare(self.policy, step)
            self.comparisons.append(comparison)
            if comparison.errors is not None:
                self.worst.append((comparison, step))
                self.worst.sort(key=lambda one: -one[0].errors.worst_mm if one[0].errors else 0.0)
                del self.worst[self.n_worst :]
        trim_heap()

    def _episode_steps(self, path: Path, span: Span) -> Iterator[RecordedStep]:
        episode = read_episode(path)
        self.complaints += [f"{episode.name}: {complaint}" for complaint in episode.complaints]
        for step in episode.steps:
            record, observation = step.record, step.observation()
            span.add(observation.stamp_ns)
            yield RecordedStep(
                episode.name,
                record.step,
                observation.stamp_ns,
                observation.heightmap(self.policy.workspace),
                record.instruction,
                record.action,
            )
        if episode.final is not None and episode.steps:
            span.add(episode.final.stamp_ns)
            said = episode.steps[-1].record.instruction
            self.finished.append(
                {"source": episode.name, "success": episode.success, **self._done(episode.final, said)}
            )

    def _done(self, observation: Any, instruction: str) -> dict[str, Any]:
        try:
            inference = self.policy.infer(observation.heightmap(self.policy.workspace), instruction)
        except InstructionError as refusal:
            return {"done_probability": None, "refused": str(refusal)}
        return {"done_probability": round(inference.done_probability, 4), "refused": ""}


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="offline", description="Compare what a policy would do with what was recorded, without a graph."
    )
    add = parser.add_argument
    add("--bag", type=Path, nargs="+", required=True, metavar="DIR", help="data sets, episodes or other bags")
    add("--checkpoint", default="default", help="a .safetensors file, a training folder or a name")
    add("--out", type=Path, default=Path("offline"), metavar="DIR", help="folder of offline.json and the pictures")
    add("--worst", type=int, default=3, metavar="N", help="how many pictures of the worst steps")
    for name, topic in _TOPICS.items():
        add(
            f"--{name.replace('_', '-')}",
            default=topic,
            metavar="TOPIC",
            help=f"of a bag that has another than {topic}",
        )
    return parser


if __name__ == "__main__":
    sys.exit(main())
