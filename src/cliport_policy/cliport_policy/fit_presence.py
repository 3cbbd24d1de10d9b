"""`ros2 run cliport_policy fit_presence`: give a checkpoint a presence network, which tells what is not to be seen.

It learns from what data sets list on the table; the policy's own weights stay as they are. Run again, it resumes.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch

from cliport_core.command_line import CommandParser
from cliport_core.source_state import source_state
from cliport_policy.card import load_card, resolve_checkpoint
from cliport_policy.data.demonstrations import CACHE_BYTES, load_demonstrations
from cliport_policy.data.listed_things import read_listed_things
from cliport_policy.data.loader import lost_workers_told
from cliport_policy.data.mixture import Mixture, Source
from cliport_policy.data.mixture_file import read_mixture
from cliport_policy.errors import DataError, PolicyError
from cliport_policy.language import shared_encoder
from cliport_policy.presence.fit import fit_sentences, scene_optimizer, scene_step
from cliport_policy.presence.scene_net import SceneNet
from cliport_policy.presence.scenes import SceneBatches
from cliport_policy.presence.sentence_net import SentenceNet
from cliport_policy.presence.sentences import draw_examples
from cliport_policy.presence.stored import put_presence
from cliport_policy.presence.vocabulary import Vocabulary, vocabulary_of
from cliport_policy.settings import check_least
from cliport_policy.training.allocator import keep_freed_memory
from cliport_policy.training.state import resume_state, save_state
from cliport_policy.training.steps import Schedule, take_steps
from cliport_policy.training.stopping import stop_on_signals

_SENTENCES, _SENTENCE_STEPS = 16_000, 3000


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; return the exit status."""
    words = sys.argv[1:] if argv is None else list(argv)
    args = _parser().parse_args(words)
    keep_freed_memory()
    stopped = stop_on_signals()
    try:
        _check(args)
        path = resolve_checkpoint(args.checkpoint)
        card = load_card(path)
        mixture = _mixture(args)
        if mixture.workspace != card.workspace:
            raise DataError(f"{args.data} has the workspace {mixture.workspace}, the checkpoint {card.workspace}")
        things = [read_listed_things(source.data) for source in mixture.sources]
        sentences = mixture.instructions_by_source()
        frames = [(i, frame) for i, source in enumerate(mixture.sources) for frame in source.data.frames]
        names = ({thing.name for thing in things[i][frame.place]} for i, frame in frames)
        paints = {thing.color: thing.rgb for i, frame in frames for thing in things[i][frame.place]}
        vocabulary = vocabulary_of(names, (sentence for group in sentences for sentence in group), paints)
        batches = SceneBatches(mixture, things, vocabulary, args.batch, args.seed)
        with lost_workers_told():
            nets = _fit(args, batches, vocabulary, [sorted(group) for group in sentences], lambda: bool(stopped))
        if nets is None:
            print(f"stopped; what was learned is in {args.out}: the same command goes on")
            return 130
        facts: dict[str, Any] = {"command": " ".join(["fit_presence", *words]), **source_state().to_dict()}
        put_presence(path, vocabulary, *nets, facts)
    except PolicyError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"written into {path}: {len(vocabulary.kinds)} kinds of things")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="fit_presence", description="Teach a checkpoint what is not to be seen.")
    parser.add_argument("--checkpoint", required=True, help="a .safetensors file, a training folder or a name")
    parser.add_argument("--data", required=True, type=Path, metavar="DIR", help="folder of the mixture's data sets")
    parser.add_argument("--mixture", default="presence", help="name or YAML file (default presence)")
    parser.add_argument("--n-demos", type=int, default=100, help="episodes of each data set (default 100)")
    parser.add_argument("--steps", type=int, default=3200, help="steps of scenes (default 3200)")
    parser.add_argument("--batch", type=int, default=16, help="scenes a step (default 16)")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--save-minutes", type=float, default=2.0)
    parser.add_argument("--out", required=True, type=Path, help="folder of what is learned, to go on from")
    return parser


def _check(args: argparse.Namespace) -> None:
    """Raise ConfigError for numbers that can't be."""
    for name, value, least in (
        ("--n-demos", args.n_demos, 1),
        ("--steps", args.steps, 1),
        ("--batch", args.batch, 1),
        ("--seed", args.seed, 0),
        ("--save-minutes", args.save_minutes, 0),
    ):
        check_least(name, value, least)


def _mixture(args: argparse.Namespace) -> Mixture:
    entries = read_mixture(args.mixture, args.data)
    sets = [load_demonstrations(entry.folder, CACHE_BYTES // len(entries)) for entry in entries]
    return Mixture(
        [Source(data.first_episodes(args.n_demos), entry.weight) for data, entry in zip(sets, entries, strict=True)]
    )


def _fit(
    args: argparse.Namespace,
    batches: SceneBatches,
    vocabulary: Vocabulary,
    sentences: Sequence[Sequence[str]],
    is_stopped: Callable[[], bool],
) -> tuple[SceneNet, SentenceNet] | None:
    """Return both nets, learned; None if it was stopped on the way."""
    torch.manual_seed(args.seed)
    scene = SceneNet(len(vocabulary.kinds), len(vocabulary.colors)).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
    sentence = SentenceNet(len(vocabulary.kinds))
    parts, optimizer = {"scene": scene, "sentence": sentence}, scene_optimizer(scene)
    settings = {"data": str(args.data), "mixture": args.mixture, "n_demos": args.n_demos, "batch": args.batch}
    identity = {**settings, "seed": args.seed, "steps_of_schedule": args.steps, "kinds": list(vocabulary.kinds)}
    first = resume_state(args.out, parts, optimizer, identity)
    if not first:
        examples = draw_examples(sentences, vocabulary, _SENTENCES, np.random.default_rng(args.seed))
        loss = fit_sentences(sentence, examples, _SENTENCE_STEPS, args.seed, shared_encoder(), is_stopped)
        if loss is None:
            return None
        print(f"sentences: loss {loss:.3f}", flush=True)
    done = take_steps(
        Schedule(first, args.steps, args.batch, 60 * args.save_minutes),
        batches.batch,
        lambda step, batch: scene_step(scene, optimizer, batch, step, args.steps),
        optimizer,
        lambda behind: save_state(args.out, parts, optimizer, behind, identity),
        is_stopped,
    )
    return (scene.eval(), sentence.eval()) if done else None


if __name__ == "__main__":
    sys.exit(main())
