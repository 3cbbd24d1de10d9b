"""Bias of "done" under each primitive, fitted to answers about scenes whose goal is known to be reached or not."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

from cliport_benchmark.understanding import Asked, Question

_LEAST = 1e-7  # a probability is taken to be no nearer to 0 or 1
_TOO_EARLY = 2  # a "done" while work is left counts as so many that are missing: who ends too early has failed


class FittedBias(NamedTuple):
    """Bias of one primitive, and how many of its answers are wrong from 0.5 on, before and with it, of all asked."""

    bias: float
    wrong_before: int
    wrong: int
    asked: int


def fitted_done_bias(questions: Sequence[Question], present: Mapping[str, float]) -> dict[str, FittedBias]:
    """Return, for each primitive that would act, the bias whose wrong answers at a threshold of 0.5 weigh least.

    present: the biases that the policy answered with, by the primitives' names. A primitive without answers of both
    kinds, work left and goal reached, is left out.
    """
    found: dict[str, FittedBias] = {}
    for name in sorted({question.primitive for question in questions if question.primitive}):
        answers = [question for question in questions if question.primitive == name]
        left = [_log_odds(question) for question in answers if question.asked == Asked.OPEN.value]
        reached = [_log_odds(question) for question in answers if question.asked == Asked.REACHED.value]
        if left and reached:
            cut = _best_cut(left, reached)
            before, wrong = _wrong(left, reached, 0.0), _wrong(left, reached, cut)
            found[name] = FittedBias(present.get(name, 0.0) - cut, before, wrong, len(left) + len(reached))
    return found


def _best_cut(left: Sequence[float], reached: Sequence[float]) -> float:
    """Return the log odds from which "done" is wrong least, in the middle of where that is so."""
    values = sorted({*left, *reached})
    cuts = [values[0] - 1.0, *((a + b) / 2 for a, b in pairwise(values)), values[-1] + 1.0]
    wrong = [_wrong(left, reached, cut, _TOO_EARLY) for cut in cuts]
    best = [cut for cut, count in zip(cuts, wrong, strict=True) if count == min(wrong)]
    return best[len(best) // 2]


def _wrong(left: Sequence[float], reached: Sequence[float], cut: float, too_early: int = 1) -> int:
    return too_early * sum(value >= cut for value in left) + sum(value < cut for value in reached)


def _log_odds(question: Question) -> float:
    probability = min(max(question.done_probability, _LEAST), 1.0 - _LEAST)
    return math.log(probability / (1.0 - probability))
