"""Summary of an evaluation's episodes, as its JSON has it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from cliport_benchmark.agents import EXPERT
from cliport_benchmark.episode import Episode
from cliport_benchmark.journal import Discarded, Outcome


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


def _percent(values: list[Any]) -> float | None:
    return round(100.0 * float(np.mean(values)), 2) if values else None
