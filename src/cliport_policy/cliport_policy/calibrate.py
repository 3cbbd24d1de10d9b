"""`ros2 run cliport_policy calibrate`: make a checkpoint's confidences mean what they say.

Fits the temperatures of pick and place on held-out demonstrations and writes them into the checkpoint's card;
`min_confidence` of the server then is a probability that the chosen point is the expert's to 3 cm.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from cliport_core.command_line import CommandParser
from cliport_policy.calibration import Calibration, JudgedAnswer, TemperatureFit
from cliport_policy.card import resolve_checkpoint
from cliport_policy.checkpoint import load_checkpoint
from cliport_policy.data.demonstrations import DemonstrationSet, load_demonstrations
from cliport_policy.errors import ConfigError, DataError, InstructionError, PolicyError
from cliport_policy.peaks import CellGrid, Peak
from cliport_policy.policy import Policy, load_policy
from cliport_policy.whole_files import write_json


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    args = _parser().parse_args(argv)
    try:
        if args.count < 1:
            raise ConfigError(f"--count is {args.count}: give at least 1")
        path = resolve_checkpoint(args.checkpoint)
        data = load_demonstrations(args.data)
        refusals: list[str] = []
        found = calibrate(load_policy(path), data, args.count, refusals.append)
        _write(path, found, str(args.data))
    except PolicyError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; nothing was written", file=sys.stderr)
        return 130
    if refusals:
        print(f"{len(refusals)} demonstrations left out, whose sentence the policy refuses, as in: {refusals[0]}")
    for name, each in found.items():
        print(
            f"{name}: temperature {each.temperature:.2f}, calibration error {each.ece_before:.3f} -> "
            f"{each.ece_after:.3f} on {each.n} demonstrations"
        )
    print(f"written to {path.with_suffix('.json')}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="calibrate", description="Fit a checkpoint's confidences to held-out data.")
    parser.add_argument("--checkpoint", required=True, help="a .safetensors file, a training folder or a name")
    parser.add_argument("--data", required=True, type=Path, metavar="VAL_DIR", help="data set it was not trained on")
    parser.add_argument("--count", type=int, default=300, metavar="N", help="demonstrations to look at (default 300)")
    return parser


def calibrate(
    policy: Policy, data: DemonstrationSet, count: int, on_refusal: Callable[[str], None] = lambda words: None
) -> dict[str, Calibration]:
    """Return the temperatures of `pick` and `place` that suit up to `count` demonstrations, drawn at random.

    A place is judged only if the pick is the expert's. on_refusal: told why the policy refuses a sentence, whose
    demonstration is left out.

    Raises:
        DataError: if the data set has another workspace or holds no action with a sentence that the policy takes.
    """
    if data.workspace != policy.workspace:
        raise DataError(
            f"{data.folder} has the workspace {data.workspace}, the checkpoint {policy.workspace}: "
            "calibrate on data of the workspace that it was trained in"
        )
    samples = [index for index in data.samples() if not data.demo(index).done]
    goals = data.goal_frames()
    fits = {"pick": TemperatureFit(), "place": TemperatureFit()}
    for number in np.random.default_rng(0).permutation(len(samples))[:count]:
        frame, demo = data.frames[samples[number].frame], data.demo(samples[number])
        goal = goals.get(samples[number].frame)
        image = None if goal is None else data.observation(data.frames[goal])
        try:
            scores = policy.score(data.observation(frame), demo.instruction, image)
        except InstructionError as refusal:
            on_refusal(str(refusal))
            continue
        pick = judge(policy.grid, scores.picks[None], scores.pick, demo.pick_pixel)
        fits["pick"].add(pick)
        if pick.hit:
            fits["place"].add(judge(policy.grid, scores.places.flatten(1), policy.place_peak(scores), demo.place_pixel))
    return {name: fit.result() for name, fit in fits.items()}


def judge(grid: CellGrid, logits: Tensor, peak: Peak, expert: tuple[int, int]) -> JudgedAnswer:
    """Compare an answer, (R, h * w) logits and their peak, with the expert's pixel (row, col)."""
    cell = grid.cell_of(expert)
    right = torch.from_numpy(grid.disc(cell).flatten())
    return JudgedAnswer(logits, right, torch.from_numpy(peak.near.flatten()), bool(peak.near[cell]))


def _write(path: Path, found: dict[str, Calibration], data: str) -> None:
    """Write the temperatures into the card beside the weights."""
    _, card = load_checkpoint(path)
    errors = {name: {"ece": each.ece_after, "ece_before": each.ece_before, "n": each.n} for name, each in found.items()}
    card = replace(
        card,
        temperatures={name: each.temperature for name, each in found.items()},
        scores={**card.scores, "calibration": {"data": data, **errors}},
    )
    write_json(path.with_suffix(".json"), card.to_dict())


if __name__ == "__main__":
    sys.exit(main())
