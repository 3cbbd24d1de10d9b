"""Summary of an evaluation's episodes, as its JSON has it."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from cliport_benchmark.agents import BLIND, EXPERT
from cliport_benchmark.episode import Episode, Step
from cliport_benchmark.journal import Discarded, Outcome
from sim_bridge.task_mechanics.task import DONE_ABOVE


def summary(settings: dict[str, Any], outcomes: list[Outcome]) -> dict[str, Any]:
    """Return the results; scores 0..100. settings: EvaluateConfig's."""
    episodes = [outcome for outcome in outcomes if isinstance(outcome, Episode)]
    discarded = [outcome for outcome in outcomes if isinstance(outcome, Discarded)]
    steps = [step for episode in episodes for step in episode.actions]
    names = sorted({step.outcome for step in steps})
    result: dict[str, Any] = {
        "mean_score": _percent([e.score for e in episodes]),
        "chance": _percent([e.chance for e in episodes if e.chance is not None]),
        **settings,
        "n_episodes": len(episodes),
        "discarded": len(discarded),
        "redrawn": sum(e.redraws > 0 for e in episodes),
        "redraws": sum(e.redraws for e in episodes),
        "broken": sum(e.broken for e in episodes),
        **(
            {"own_wording": sum(e.own_wording for e in episodes)}
            if {"wording", "survey_colors"} & settings.keys()
            else {}
        ),
        "outcomes": {name: sum(step.outcome == name for step in steps) for name in names},
    }
    if settings["checkpoint"] == BLIND:
        result["mean_score_with_next"] = _percent([_score_with_next(e.actions) for e in episodes])
    if settings["checkpoint"] != EXPERT:
        first_right = [any(s.pick_right and s.place_right for s in e.actions[:1]) for e in episodes]
        result["choices"] = {
            "pick_right": _percent([s.pick_right for s in steps]),
            "place_right": _percent([s.place_right for s in steps]),
            "both_right": _percent([s.pick_right and s.place_right for s in steps]),
            "first_action_both_right": _percent(first_right),  # a refusal counts as wrong
            "refused": sum(bool(e.error) and not e.broken for e in episodes),
        }
    result["episodes"] = [dataclasses.asdict(e) for e in episodes]
    result["discarded_episodes"] = [dataclasses.asdict(d) for d in discarded]
    return result


def _score_with_next(steps: Sequence[Step]) -> float:
    """Return the score, 0..1, under a rule that counts the next goal as far as it is fulfilled without an action, as
    this project's results did before it scored as the public code does."""
    scores = [step.score_with_next or 0.0 for step in steps]
    return next((score for score in scores if score > DONE_ABOVE), scores[-1] if scores else 0.0)


def _percent(values: list[Any]) -> float | None:
    return round(100.0 * float(np.mean(values)), 2) if values else None
