"""Reasons to measure a score again: other weights than those at hand, or a source that no commit says."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from cliport_core.source_state import CHANGED, UNKNOWN
from cliport_policy.card import load_card, resolve_checkpoint, weights_sha256
from cliport_policy.errors import CheckpointError


def doubts_about(result: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what is doubtful about a result of `evaluate` and about the scores in its checkpoint's card.

    A checkpoint that is not at hand, as on another machine, gives no doubt of its own.
    """
    what = f"{result.get('task')} {result.get('split')}"
    found = [f"{what} was {words}" for words in _source_doubts(result)]
    path = _weights_at_hand(str(result.get("checkpoint")))
    if path is not None:
        present = _sha256(path)
        scored = result.get("weights_sha256")
        if scored and scored != present:
            found.append(f"{what} was scored on other weights than those that are there now")
        found += card_doubts(path)
    return tuple(found)


def card_doubts(path: Path) -> list[str]:
    """Return what is doubtful about the scores in the card beside a weights file."""
    try:
        scores = load_card(path).scores
    except CheckpointError:
        return []
    found = []
    for name, score in scores.items():
        if not isinstance(score, dict) or "mean_score" not in score:
            continue  # a calibration's errors, say
        doubts = _source_doubts(score)
        if "weights_sha256" not in score:
            doubts.append("scored on weights that it does not name")
        elif score["weights_sha256"] != _sha256(path):
            doubts.append("scored on other weights than the card's")
        found += [f"the card's '{name}' was {words}" for words in doubts]
    return found


def _source_doubts(score: Mapping[str, Any]) -> list[str]:
    commit = str(score.get("commit", UNKNOWN))
    if commit == UNKNOWN:
        return ["measured at an unknown commit"]
    if score.get("dirty") or commit.endswith(CHANGED):
        return [f"measured on changes to commit {commit.removesuffix(CHANGED)[:7]}"]
    return []


def _weights_at_hand(checkpoint: str) -> Path | None:
    try:
        return resolve_checkpoint(checkpoint)
    except CheckpointError:
        return None


@lru_cache(maxsize=64)
def _sha256(path: Path) -> str:
    return weights_sha256(path)
