"""`ros2 run cliport_policy train`: demonstrations in, a policy out, with progress; run again, it resumes.

With `--init CHECKPOINT` it goes on from a policy's weights, as few demonstrations of something new ask for.
`torchrun --nproc-per-node N -m cliport_policy.train ...` shares each step among N processes.
"""

from __future__ import annotations

import logging
import shlex
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from cliport_core.source_state import source_state
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.mixture import Mixture, Source, check_same_workspace
from cliport_policy.data.mixture_file import SourceEntry
from cliport_policy.errors import InstructionError, PolicyError, TrainingError
from cliport_policy.language import shared_encoder
from cliport_policy.overlays import save_png
from cliport_policy.training.agreement import agreement
from cliport_policy.training.allocator import keep_freed_memory
from cliport_policy.training.curves import save_curves
from cliport_policy.training.distributed import Group, join_group
from cliport_policy.training.log import EventLog, ProgressLine, affordance_picture
from cliport_policy.training.options import TrainOptions, parse_options
from cliport_policy.training.sample_sheet import sample_sheet
from cliport_policy.training.stopping import stop_on_signals
from cliport_policy.training.trainer import Progress, Trainer

logger = logging.getLogger(__name__)
N_AGREEMENT = 300  # demonstrations that agreement is measured on


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    logging.basicConfig(level=logging.INFO, format="%(message)s", stream=sys.stderr)
    logging.getLogger("tensorboard").setLevel(logging.WARNING)  # it tells of each file that it reads
    try:
        options = parse_options(argv)
        group = join_group(options.device)
        try:
            _train(options, group, argv)
        finally:
            group.leave()
    except PolicyError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _train(options: TrainOptions, group: Group, argv: Sequence[str] | None) -> None:
    keep_freed_memory()
    stopped = stop_on_signals()
    n_sets = len(options.data) + (options.val is not None)
    sources = [_source(entry, options, options.cache_bytes // n_sets) for entry in options.data]
    val = load_demonstrations(options.val, options.cache_bytes // n_sets) if options.val else None
    if val is not None:
        check_same_workspace(sources[0].data, val)
    if options.initial is not None:
        options.initial.check_workspace(sources[0].data.workspace)
    words = sys.argv[1:] if argv is None else argv
    command = shlex.join(["ros2", "run", "cliport_policy", "train", *words])
    made_by = {"command": command, "config": options.config_name, **source_state().to_dict()}
    trainer = Trainer(
        sources, options.out, options.network, options.train, shared_encoder(), made_by, group, options.initial
    )
    held_out = Mixture([Source(val)], with_goals=trainer.network.needs_goal_image) if val else None
    if not group.is_first:
        _run(trainer, options, stopped)
        return
    print(f"{len(trainer.data)} demonstrations to draw from; step {trainer.step} of {options.train.steps}", flush=True)
    started = time.monotonic()
    _run_and_show(trainer, options, stopped, held_out)
    minutes = (time.monotonic() - started) / 60
    print(f"step {trainer.step} of {options.train.steps} after {minutes:.1f} min: {options.out}/policy.safetensors")


def _source(entry: SourceEntry, options: TrainOptions, cache_bytes: int) -> Source:
    data = load_demonstrations(entry.folder, cache_bytes)
    kept = data if options.n_demos is None else data.first_episodes(options.n_demos)
    return Source(kept, entry.weight, entry.settings)


def _run_and_show(trainer: Trainer, options: TrainOptions, stopped: list[int], held_out: Mixture | None) -> None:
    """Train with a progress line, TensorBoard's files in OUT/events, and pictures: OUT/samples.png, OUT/curves.png."""
    line, events = ProgressLine(sys.stderr), EventLog(options.out / "events", trainer.step)
    _show_samples(trainer, options.out / "samples.png", events)
    shown = held_out or trainer.data
    sample = next((shown[i] for i in range(len(shown)) if not shown[i].demo.done), shown[0])

    def show(progress: Progress) -> None:
        line(progress)
        events(progress)

    def picture() -> None:
        try:
            events.picture("affordance", affordance_picture(trainer.policy(), sample), trainer.step)
        except InstructionError as error:  # the sentences of --val may be unlike those of --data
            logger.warning("no picture: %s", error)
        _show_curves(trainer, options.out / "curves.png", events)

    def compare() -> None:
        if held_out is not None:
            _compare(trainer, held_out, events)

    try:
        _run(trainer, options, stopped, show, picture, compare)
        if trainer.step >= options.train.steps and not events.is_compared(trainer.step):
            compare()
            _show_curves(trainer, options.out / "curves.png", events)
    finally:
        events.close()


def _compare(trainer: Trainer, held_out: Mixture, events: EventLog) -> None:
    chosen = np.random.default_rng(0).permutation(len(held_out))[:N_AGREEMENT]
    found = agreement(trainer.average, held_out, chosen.tolist())
    events.agreement(found, trainer.step)
    shares = ", ".join(f"{name} {share:.3g}" for name, share in found.shares().items())
    print(f"step {trainer.step}: agreement with --val: {shares}, n {found.n}", flush=True)


def _show_curves(trainer: Trainer, path: Path, events: EventLog) -> None:
    try:
        save_curves(events.curves, trainer.config.batch_size, path)
    except OSError as error:
        raise TrainingError(f"can't write {path} ({error.strerror or error}): give another --out") from error


def _show_samples(trainer: Trainer, path: Path, events: EventLog) -> None:
    sheet = sample_sheet(trainer.loader.step(0).parts[0], trainer.data.workspace)
    events.picture("samples", sheet, trainer.step)
    try:
        save_png(path, sheet)
    except OSError as error:
        raise TrainingError(f"can't write {path} ({error.strerror or error}): give another --out") from error


def _run(
    trainer: Trainer,
    options: TrainOptions,
    stopped: list[int],
    on_step: Callable[[Progress], None] = lambda _: None,
    on_save: Callable[[], None] = lambda: None,
    on_keep: Callable[[], None] = lambda: None,
) -> None:
    limits = options.save_minutes, options.max_minutes, lambda: bool(stopped), options.keep_steps
    trainer.run(on_step, *limits, on_save, on_keep)


if __name__ == "__main__":
    sys.exit(main())
