"""Temperature scaling: one number that makes a policy's confidences mean what they say.

Logits are divided by T > 0, chosen to make held-out labels likeliest (Guo et al., "On Calibration of Modern Neural
Networks", 2017). A label here is the neighbourhood of the expert's point, as a confidence is that of the chosen point,
because training blurs the exact cell on purpose. The best cell stays the best; only how sure the policy is changes.
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
_MIN_PROBABILITY = 1e-12


class JudgedAnswer(NamedTuple):
    """A held-out answer beside the expert's.

    logits: (R, N), R rotations and N cells; a cell's probability is summed over R.
    right: (N,) bool, the cells near the expert's point.
    near: (N,) bool, the cells near the chosen point; their probability is the confidence.
    hit: True if the chosen point lies near the expert's.
    """

    logits: Tensor
    right: Tensor
    near: Tensor
    hit: bool


class Calibration(NamedTuple):
    """Result of a fit.

    temperature: the best temperature.
    ece_before, ece_after: expected calibration error at temperature 1 and at the best one.
    n: number of answers.
    """

    temperature: float
    ece_before: float
    ece_after: float
    n: int


class TemperatureFit:
    """Search for the best temperature over answers that are handed in one by one, since all logits would not fit."""

    def __init__(self) -> None:
        self._losses = np.zeros(len(TEMPERATURES))
        self._confidences: list[list[float]] = []  # each answer's, at each temperature
        self._hits: list[bool] = []

    @torch.inference_mode()
    def add(self, answer: JudgedAnswer) -> None:
        """Take one answer into account."""
        row: list[float] = []
        for i, temperature in enumerate(TEMPERATURES):
            mass = (answer.logits.float() / temperature).flatten().softmax(0).reshape(answer.logits.shape).sum(0)
            self._losses[i] -= float(mass[answer.right].sum().clamp_min(_MIN_PROBABILITY).log())
            row.append(min(float(mass[answer.near].sum()), 1.0))
        self._confidences.append(row)
        self._hits.append(answer.hit)

    def result(self) -> Calibration:
        """Return the temperature of least negative log likelihood.

        Raises:
            DataError: if no answer was added.
        """
        if not self._hits:
            raise DataError(
                "nothing to calibrate on: the data hold no action, or the policy never picks where the expert does"
            )
        best, plain = int(self._losses.argmin()), int(np.abs(np.log(TEMPERATURES)).argmin())
        confidences, hits = np.array(self._confidences).T, np.array(self._hits)
        before, after = (expected_calibration_error(confidences[i], hits) for i in (plain, best))
        return Calibration(TEMPERATURES[best], before, after, len(hits))


def fit_temperature(answers: Iterable[JudgedAnswer]) -> Calibration:
    """Fit a temperature to answers, which may be made on the way.

    Raises:
        DataError: if there are none.
    """
    fit = TemperatureFit()
    for answer in answers:
        fit.add(answer)
    return fit.result()


def expected_calibration_error(confidence: NDArray[np.float64], hit: NDArray[np.bool_], bins: int = BINS) -> float:
    """Return the mean gap between confidence and share of hits, over bins of like confidence.

    confidence, hit: (n,). Each bin counts by its number of answers.
    """
    index = np.minimum((confidence * bins).astype(int), bins - 1)
    error = 0.0
    for number in np.unique(index):
        inside = index == number
        gap = abs(float(confidence[inside].mean() - hit[inside].mean()))
        error += gap * float(inside.mean())
    return error
