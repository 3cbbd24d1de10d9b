"""`ros2 run cliport_benchmark card_scores`: writes scores of `evaluate` into the card of the checkpoint they are of."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.json_files import read_json
from cliport_benchmark.own_setup import condition_words
from cliport_core.command_line import CommandParser
from cliport_policy.card import load_card, resolve_checkpoint, weights_sha256
from cliport_policy.errors import PolicyError
from cliport_policy.whole_files import write_json

_COUNTS = ("n_episodes", "discarded", "redrawn", "broken")
_KEPT = ("mean_score", "chance", *_COUNTS, "first_seed", "object_set", "offset", "choices", "command")
_PROVENANCE = ("weights_sha256", "commit", "dirty")


def write_scores(checkpoint: str, results: Sequence[Path]) -> Path:
    """Add the scores of results to a checkpoint's card, in place of those of the same name and of all that name no
    weights or others than the checkpoint's; return the card's path.

    Raises:
        CheckpointError: when there is no such checkpoint or card.
        DataFolderError: when a result cannot be read.
        OptionError: when one is of other weights, or does not say of which; when two are of the same name.
    """
    path = resolve_checkpoint(checkpoint)
    card, present = load_card(path), weights_sha256(path)
    scores: dict[str, dict[str, Any]] = {}
    for result in results:
        name, entry = _entry(read_json(result), result, present)
        if name in scores:
            raise OptionError(f"{result} is a second score of '{name}': give one of them")
        scores[name] = entry
    valid = {name: score for name, score in card.scores.items() if not _is_stale(score, present)}
    write_json(path.with_suffix(".json"), replace(card, scores={**valid, **scores}).to_dict())
    return path.with_suffix(".json")


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return 0 when the card was written, 1 on an error."""
    parser = CommandParser(prog="card_scores", description="Write scores of evaluate into a card.")
    parser.add_argument("--checkpoint", required=True, help="path or name of a shipped one")
    parser.add_argument("results", type=Path, nargs="+", help="JSON files of evaluate")
    options = parser.parse_args(arguments)
    try:
        print(f"{len(options.results)} scores in {write_scores(options.checkpoint, options.results)}")
    except (BenchmarkError, PolicyError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


def _is_stale(score: Any, present: str) -> bool:
    """Return True for a score of an evaluation that was not of these weights, as far as it says; a calibration's errors
    are no score."""
    return isinstance(score, dict) and "mean_score" in score and score.get("weights_sha256") != present


def _entry(result: dict[str, Any], path: Path, present: str) -> tuple[str, dict[str, Any]]:
    """Return the name of a score and what the card says of it."""
    lacking = [name for name in ("mean_score", "task", "split", *_PROVENANCE) if name not in result]
    if lacking:
        raise OptionError(f"{path} does not say {', '.join(lacking)}: evaluate again with this version")
    if result["weights_sha256"] != present:
        raise OptionError(f"{path} is of other weights ({result['weights_sha256'][:12]}, not {present[:12]})")
    name = f"{result['task']} {result['split']}{condition_words(result)}"
    return name, {key: result[key] for key in (*_KEPT, *_PROVENANCE) if key in result}


if __name__ == "__main__":
    sys.exit(main())
