"""`ros2 run cliport_policy reliability`: how far a checkpoint's own doubts can be trusted, on data it has not seen.

The done head: how many finished scenes are called finished, and unfinished ones not, at each threshold. The
confidences: what is gained by acting only above a threshold, as the server's `min_confidence` does.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cliport_core.command_line import CommandParser
from cliport_policy.calibration import expected_calibration_error
from cliport_policy.card import resolve_checkpoint
from cliport_policy.data.absences import Absences
from cliport_policy.data.demonstrations import Demonstration, DemonstrationSet, Index, load_demonstrations
from cliport_policy.data.mixture import Drawn, Mixture, Source
from cliport_policy.errors import ConfigError, DataError, InstructionError, PolicyError
from cliport_policy.inference import Inference
from cliport_policy.peaks import CellGrid
from cliport_policy.policy import Policy, load_policy
from cliport_policy.reliability_plot import plot_reliability
from cliport_policy.whole_files import write_json

PICTURES = (".png", ".pdf", ".svg")
THRESHOLDS = (0.1, 0.3, 0.5, 0.7, 0.9)


@dataclass(frozen=True, eq=False)
class Reliability:
    """Answers of a policy, one entry for each observation.

    finished, unfinished: the null action's probability in scenes of either kind.
    confidence: the lesser one of pick and place in unfinished scenes, as the server takes it.
    right: True if both lie within 3 cm of the expert's, which is a lower bound: if several objects would do, another
    one than the expert's counts as wrong.
    refused: number of further observations whose sentence the policy refused; they are in no share.
    foreign, own: probability that what is named is not here, under a sentence about what the scene lacks and under its
    own; empty where the data set does not list the things on the table, or an image of the goal is acted on.
    """

    finished: NDArray[np.float64]
    unfinished: NDArray[np.float64]
    confidence: NDArray[np.float64]
    right: NDArray[np.bool_]
    refused: int = 0
    foreign: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    own: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def joined(cls, parts: Sequence[Reliability]) -> Reliability:
        """Return the answers of all parts as those of one data set."""
        arrays = {
            one.name: np.concatenate([getattr(part, one.name) for part in parts])
            for one in fields(cls)
            if one.name != "refused"
        }
        return cls(**arrays, refused=sum(part.refused for part in parts))

    def absent_right(self, threshold: float) -> tuple[float, float]:
        """Return the shares of foreign sentences called not here, and of own ones not; NaN if there are none."""
        return _share(self.foreign > threshold), _share(self.own <= threshold)

    def done_right(self, threshold: float) -> tuple[float, float]:
        """Return the shares of finished scenes called finished, and of unfinished ones not; NaN if there are none."""
        return _share(self.finished > threshold), _share(self.unfinished <= threshold)

    def acted(self, threshold: float) -> tuple[float, float]:
        """Return the share of observations acted on, and the share of right ones among these; NaN if there are none."""
        sure = self.confidence >= threshold
        return _share(sure), _share(self.right[sure])

    def to_dict(self) -> dict[str, object]:
        """Return the shares, with the number of observations behind them, ready for JSON."""
        return {
            "finished": len(self.finished),
            "unfinished": len(self.unfinished),
            "refused": self.refused,
            "done": {str(t): [_number(share) for share in self.done_right(t)] for t in THRESHOLDS},
            "foreign": len(self.foreign),
            "absent": {str(t): [_number(share) for share in self.absent_right(t)] for t in THRESHOLDS},
            "acted": {str(t): [_number(share) for share in self.acted(t)] for t in (0.0, *THRESHOLDS)},
            "calibration_error": expected_calibration_error(self.confidence, self.right),
        }


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    args = _parser().parse_args(argv)
    try:
        if args.count < 1:
            raise ConfigError(f"--count is {args.count}: give at least 1")
        if args.out.suffix not in PICTURES:
            raise ConfigError(f"--out is {args.out}: give a picture's name, with {', '.join(PICTURES)}")
        sets = [load_demonstrations(folder) for folder in args.data]
        path = resolve_checkpoint(args.checkpoint)
        policy = load_policy(path)
        parts = [measure(policy, data, args.count, _progress) for data in sets]
        found = Reliability.joined(parts)
        args.out.parent.mkdir(parents=True, exist_ok=True)
        each = [{"data": data.meta, **part.to_dict()} for data, part in zip(sets, parts, strict=True)]
        write_json(args.out.with_suffix(".json"), {"checkpoint": path.stem, **found.to_dict(), "sets": each})
        plot_reliability(found.finished, found.unfinished, found.confidence, found.right, args.out)
    except PolicyError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except OSError as error:
        print(f"error: can't write {args.out} ({error.strerror or error}): give another --out", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nerror: interrupted", file=sys.stderr)
        return 130
    print(table(found))
    if len(sets) > 1:
        print(table_of_sets({str(folder): part for folder, part in zip(args.data, parts, strict=True)}))
    print(f"written: {args.out}, {args.out.with_suffix('.json')}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="reliability", description="How far a checkpoint's own doubts can be trusted.")
    parser.add_argument("--checkpoint", default="default", help="a .safetensors file, a training folder or a name")
    parser.add_argument(
        "--data",
        action="append",
        required=True,
        type=Path,
        metavar="DIR",
        help="data set it was not trained on; several are counted together and each alone",
    )
    parser.add_argument("--count", type=int, default=200, metavar="N", help="episodes of each to look at (default 200)")
    parser.add_argument("--out", type=Path, default=Path("out/reliability.png"), help="picture; a JSON beside it")
    return parser


def measure(
    policy: Policy, data: DemonstrationSet, count: int, tell: Callable[[int, int], None] = lambda done, total: None
) -> Reliability:
    """Ask a policy about one finished and one unfinished scene, drawn at random, of each of the first `count` episodes.

    tell: called with the numbers of scenes done and in all.

    Raises:
        DataError: if the data set has another workspace, or no unfinished scene whose sentence the policy takes.
    """
    if data.workspace != policy.workspace:
        raise DataError(
            f"{data.folder} has the workspace {data.workspace}, the checkpoint {policy.workspace}: "
            "give data of the workspace that it was trained in"
        )
    finished, unfinished = _draw(data, count)
    if not unfinished:
        raise DataError(f"{data.folder} holds no scene in which something is to be done")
    answered, refusals = _ask(policy, data, [*finished, *unfinished], tell)
    acting = [(inference, demo) for inference, demo in answered if not demo.done]
    if not acting:
        raise DataError(f"the policy refuses every sentence of {data.folder}, as in: {refusals[-1]}")
    foreign = _ask_for_what_is_not_there(policy, data, unfinished)
    return Reliability(
        np.array([inference.done_probability for inference, demo in answered if demo.done]),
        np.array([inference.done_probability for inference, _ in acting]),
        np.array([inference.confidence for inference, _ in acting]),
        np.array([_is_right(policy.grid, inference, demo) for inference, demo in acting], bool),
        len(refusals),
        np.array(foreign),
        np.array([inference.absent_probability for inference, _ in acting]) if foreign else np.zeros(0),
    )


def _ask(
    policy: Policy, data: DemonstrationSet, indices: Sequence[Index], tell: Callable[[int, int], None]
) -> tuple[list[tuple[Inference, Demonstration]], list[str]]:
    """Return a policy's answers beside what the expert did, and its words about the sentences that it refused."""
    goals, answered, refusals = data.goal_frames(), [], []
    for number, index in enumerate(indices, start=1):
        frame, demo = data.frames[index.frame], data.demo(index)
        goal = None if index.frame not in goals else data.observation(data.frames[goals[index.frame]])
        try:
            answered.append((policy.infer(data.observation(frame), demo.instruction, goal=goal), demo))
        except InstructionError as refusal:
            refusals.append(str(refusal))
        tell(number, len(indices))
    return answered, refusals


def _ask_for_what_is_not_there(policy: Policy, data: DemonstrationSet, indices: Sequence[Index]) -> list[float]:
    """Return how likely the policy thinks that things are not here which are not, one answer an observation.

    A policy that acts on an image of the goal is not asked: the image would show another thing than the sentence says.
    """
    if policy.needs_goal_image or not any(data.frames[index.frame].things for index in indices):
        return []
    absences, rng = Absences(Mixture([Source(data)])), np.random.default_rng(1)
    found = []
    for index in indices:
        frame = data.frames[index.frame]
        drawn = absences.draw(Drawn(data, frame, data.demo(index), None), rng)
        if drawn.demo.absent:
            try:
                found.append(policy.infer(data.observation(frame), drawn.demo.instruction).absent_probability)
            except InstructionError:
                found.append(1.0)  # refused, which is an answer
    return found


def _is_right(grid: CellGrid, inference: Inference, expert: Demonstration) -> bool:
    ends = ((inference.pick_pixel, expert.pick_pixel), (inference.place_pixel, expert.place_pixel))
    return all(grid.disc(grid.cell_of(theirs))[grid.cell_of(ours)] for ours, theirs in ends)


def _draw(data: DemonstrationSet, count: int) -> tuple[list[Index], list[Index]]:
    """Return indices of finished and unfinished scenes of the first episodes, one of each kind for every episode."""
    rng = np.random.default_rng(0)
    by_episode: dict[tuple[str, int], dict[bool, list[Index]]] = defaultdict(lambda: {True: [], False: []})
    for index in data.samples():
        frame = data.frames[index.frame]
        by_episode[frame.task, frame.episode][data.demo(index).done].append(index)
    drawn: dict[bool, list[Index]] = {True: [], False: []}
    for done, chosen in drawn.items():
        for scenes in list(by_episode.values())[:count]:
            if scenes[done]:
                chosen.append(scenes[done][rng.integers(len(scenes[done]))])
    return drawn[True], drawn[False]


def table(found: Reliability) -> str:
    """Return a table for a terminal."""

    def row(threshold: float, shares: tuple[float, float]) -> str:
        return f"{threshold:14.1f} {_percent(shares[0]):>21} {_percent(shares[1]):>26}"

    lines = [
        f"{len(found.finished)} finished and {len(found.unfinished)} unfinished scenes",
        f"{found.refused} more refused for their sentence",
        f"{'done threshold':>14} {'finished called so':>21} {'unfinished not called so':>26}",
    ]
    lines += [row(t, found.done_right(t)) for t in THRESHOLDS]
    if len(found.foreign):
        lines.append(f"{'not here':>14} {'foreign called so':>21} {'own not called so':>26}")
        lines += [row(t, found.absent_right(t)) for t in THRESHOLDS]
    lines.append(f"{'min_confidence':>14} {'acted on':>21} {'of these right':>26}")
    lines += [row(t, found.acted(t)) for t in (0.0, *THRESHOLDS)]
    return "\n".join(lines)


def table_of_sets(parts: Mapping[str, Reliability]) -> str:
    """Return a table for a terminal with a line for each data set, by its name; thresholds are 0.5."""
    columns = ("finished said so", "unfinished not", "foreign said so", "own not", "acts", "then right")
    wide = max(map(len, parts))
    lines = [" ".join([f"{'from 0.5 on':{wide}}", *(f"{column:>16}" for column in columns)])]
    for name, part in parts.items():
        shares = (*part.done_right(0.5), *part.absent_right(0.5), *part.acted(0.5))
        lines.append(" ".join([f"{name:{wide}}", *(f"{_percent(share):>16}" for share in shares)]))
    return "\n".join(lines)


def _number(share: float) -> float | None:
    return None if np.isnan(share) else share


def _percent(share: float) -> str:
    return "none" if np.isnan(share) else f"{100 * share:.1f} %"


def _share(flags: NDArray[np.bool_]) -> float:
    return float(flags.mean()) if len(flags) else float("nan")


def _progress(done: int, total: int) -> None:
    if done % 20 == 0 or done == total:
        print(f"\r{done}/{total} scenes", end="" if done < total else "\n", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
