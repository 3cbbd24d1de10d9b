"""Temperature scaling: one number that makes a policy's confidences mean what they say.

Guo et al., "On Calibration of Modern Neural Networks", 2017: divide logits by T > 0, chosen to make held-out labels
likeliest; here a label is the neighbourhood of the expert's point, as a confidence is of the chosen one, for the exact
cell is blurred in training on purpose. The best cell stays the best; only how sure the policy is changes.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cliport_policy.errors import DataError

TEMPERATURES = tuple(float(t) for t in np.geomspace(0.25, 4.0, 33))  # 1 is among them
BINS = 10
_LEAST = 1e-12


class Judged(NamedTuple):
    """One held-out answer. logits: (R, N) of R rotations and N cells, whose masses are summed over R;
    right: (N,) bool, the cells near the expert's; near: (N,) bool, those near the chosen one, whose mass is the
    confidence; hit: whether these are the same place."""

    logits: Tensor
    right: Tensor
    near: Tensor
    hit: bool


class Calibration(NamedTuple):
    """temperature: the best one. Expected calibration errors at 1 and at the best; n: of how many answers."""

    temperature: float
    ece_before: float
    ece_after: float
    n: int


class TemperatureFit:
    """Looks at answers one by one, for the logits of all are large, and finds the temperature that suits them."""

    def __init__(self) -> None:
        self._losses = np.zeros(len(TEMPERATURES))
        self._confidences: list[list[float]] = []  # of each answer at each temperature
        self._hits: list[bool] = []

    @torch.inference_mode()
    def add(self, answer: Judged) -> None:
        row: list[float] = []
        for i, temperature in enumerate(TEMPERATURES):
            mass = (answer.logits.float() / temperature).flatten().softmax(0).reshape(answer.logits.shape).sum(0)
            self._losses[i] -= float(mass[answer.right].sum().clamp_min(_LEAST).log())
            row.append(min(float(mass[answer.near].sum()), 1.0))
        self._confidences.append(row)
        self._hits.append(answer.hit)

    def result(self) -> Calibration:
        """The temperature of least negative log likelihood. Raises DataError where nothing was looked at."""
        if not self._hits:
            raise DataError(
                "nothing to calibrate on: the data hold no action, or the policy never picks where the expert does"
            )
        best, plain = int(self._losses.argmin()), int(np.abs(np.log(TEMPERATURES)).argmin())
        confidences, hits = np.array(self._confidences).T, np.array(self._hits)
        before, after = (expected_calibration_error(confidences[i], hits) for i in (plain, best))
        return Calibration(TEMPERATURES[best], before, after, len(hits))


def fit_temperature(answers: Iterable[Judged]) -> Calibration:
    """Of answers at hand or made on the way. Raises DataError where there are none."""
    fit = TemperatureFit()
    for answer in answers:
        fit.add(answer)
    return fit.result()


def expected_calibration_error(confidence: NDArray[np.float64], hit: NDArray[np.bool_], bins: int = BINS) -> float:
    """The mean gap, over answers, between confidence and share of hits in bins of like confidence; both (n,)."""
    index = np.minimum((confidence * bins).astype(int), bins - 1)
    gaps = [
        abs(float(confidence[index == b].mean() - hit[index == b].mean())) * float((index == b).mean())
        for b in np.unique(index)
    ]
    return float(sum(gaps))
