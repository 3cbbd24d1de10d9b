"""`ros2 run cliport_policy train`: demonstrations in, a policy out, with progress; run again, it resumes."""

from __future__ import annotations

import argparse
import logging
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from cliport_policy.config import NetworkConfig, TrainConfig
from cliport_policy.demonstrations import load_demonstrations
from cliport_policy.errors import PolicyError
from cliport_policy.language import shared_encoder
from cliport_policy.training import Trainer, agreement


def main(argv: list[str] | None = None) -> int:
    args = _parser().parse_args(argv)
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    try:
        return _train(args)
    except PolicyError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1


def _parser() -> argparse.ArgumentParser:
    defaults = TrainConfig()
    parser = argparse.ArgumentParser(prog="train", description="Train a policy on demonstrations.")
    parser.add_argument("--data", required=True, help="folder that cliport_benchmark generate wrote")
    parser.add_argument("--val", help="folder of held-out demonstrations to measure agreement on")
    parser.add_argument("--out", required=True, help="training folder; run again with the same one to resume")
    parser.add_argument("--steps", type=int, default=defaults.steps)
    parser.add_argument("--batch", type=int, default=defaults.batch_size)
    parser.add_argument("--learning-rate", type=float, default=defaults.learning_rate)
    parser.add_argument("--phrases", type=int, default=defaults.phrases_per_goal, help="wordings a goal")
    parser.add_argument("--seed", type=int, default=defaults.seed)
    parser.add_argument("--demos", type=int, help="use only the first N observations")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="stop (and save) after so long")
    return parser


def _train(args: argparse.Namespace) -> int:
    config = TrainConfig(
        steps=args.steps,
        batch_size=args.batch,
        learning_rate=args.learning_rate,
        phrases_per_goal=args.phrases,
        seed=args.seed,
    )
    data = load_demonstrations(args.data, args.demos)
    print(f"{len(data.frames)} observations, {len(data.samples())} demonstrations from {args.data}", flush=True)
    made_by = {
        "command": shlex.join(["ros2", "run", "cliport_policy", "train", *sys.argv[1:]]),
        "commit": _commit(),
    }
    trainer = Trainer(data, Path(args.out), NetworkConfig(), config, shared_encoder(), made_by)
    if trainer.step:
        print(f"resuming at step {trainer.step}", flush=True)
    stopped = _stop_on_signals()
    started = time.monotonic()
    trainer.run(_show, max_minutes=args.minutes, should_stop=lambda: bool(stopped))
    minutes = (time.monotonic() - started) / 60
    print(f"step {trainer.step} of {config.steps} after {minutes:.1f} min: {args.out}/policy.safetensors")
    if args.val and trainer.step >= config.steps:
        val = load_demonstrations(args.val)
        samples = val.samples()
        chosen = np.random.default_rng(0).permutation(len(samples))[:300]
        print(agreement(trainer.average, val, [samples[i] for i in chosen]))
    return 0


def _show(values: dict[str, float]) -> None:
    print(
        f"step {values['step']:.0f}  locator {values['locator']:.3f}  rotator {values['rotator']:.3f}  "
        f"transport {values['transport']:.3f}  {values['samples_per_s']:.0f} samples/s  "
        f"{values['eta_min']:.0f} min left",
        flush=True,
    )


def _stop_on_signals() -> list[int]:
    """A list that SIGINT or SIGTERM puts an entry in: training saves and ends after the step at hand."""
    received: list[int] = []
    for name in (signal.SIGINT, signal.SIGTERM):
        signal.signal(name, lambda number, _frame: received.append(number))
    return received


def _commit() -> str:
    try:
        here = Path(__file__).resolve().parent
        run = subprocess.run(["git", "rev-parse", "HEAD"], cwd=here, capture_output=True, text=True, timeout=5)
        return run.stdout.strip() or "unknown"
    except (OSError, subprocess.SubprocessError):
        return "unknown"


if __name__ == "__main__":
    sys.exit(main())
