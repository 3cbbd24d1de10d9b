"""Learning curves: what is read from the files of a training, and what the picture shows of it."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from cliport_policy.training.agreement import Agreement
from cliport_policy.training.curves import Curves, read_curves, save_curves, smooth
from cliport_policy.training.log import EventLog
from cliport_policy.training.trainer import Progress

BATCH = 16


def _log(folder: Path, first_step: int, steps: range, agreement_at: int | None = None) -> Curves:
    events = EventLog(folder, first_step)
    for step in steps:
        events(Progress(step, steps[-1], {"locator": 100.0 / step, "rotator": 0.0}, 1e-3, 20.0, 3.6))
        if step == agreement_at:
            events.agreement(Agreement(pick=0.0, yaw=0.25, place=0.5, done=1.0, n=4), step)
    events.close()
    return events.curves


def test_a_resumed_training_has_one_curve(tmp_path: Path) -> None:
    _log(tmp_path, 0, range(1, 41), agreement_at=21)
    curves = _log(tmp_path, 20, range(21, 31), agreement_at=30)  # stopped at 40, resumed from a save at 20
    for each in (curves, read_curves(tmp_path, last=100)):
        assert [point.step for point in each["loss/locator"]] == [10, 20, 30]
        assert [point.value for point in each["loss/locator"]] == pytest.approx([10.0, 5.0, 10 / 3])
        shares = {name: points for name, points in each.items() if name.startswith("agreement/")}
        expected = {"pick": 0.0, "yaw": 0.25, "place": 0.5, "done": 1.0}
        assert shares == {f"agreement/{name}": [(30, share)] for name, share in expected.items()}


def test_a_training_resumes_without_its_events(tmp_path: Path) -> None:
    curves = _log(tmp_path / "deleted", 20, range(21, 31))
    assert [point.step for point in curves["loss/locator"]] == [30]


def test_the_picture_is_over_samples(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: dict[str, tuple[list[float], list[float]]] = {}

    def plot(_: Axes, samples: np.ndarray, values: np.ndarray, *style: str, label: str) -> None:
        drawn[label] = (samples.tolist(), values.tolist())

    curves = _log(tmp_path / "events", 0, range(1, 21), agreement_at=20)
    monkeypatch.setattr(Axes, "plot", plot)
    save_curves(curves, BATCH, tmp_path / "curves.png")
    assert drawn["locator"] == ([160, 320], [10.0, 5.0]) and drawn["place"] == ([320], [50.0])
    assert set(drawn) == {"locator", "pick", "yaw", "place", "done"}  # the rotator's loss is always 0: there is none


def test_a_training_without_a_step_has_a_picture(tmp_path: Path) -> None:
    save_curves({}, BATCH, tmp_path / "curves.png")
    assert (tmp_path / "curves.png").stat().st_size > 0


def test_a_smooth_curve_keeps_its_ends_and_its_mean() -> None:
    assert smooth(np.array([])).tolist() == []
    assert smooth(np.array([4.0, 2.0])).tolist() == [4.0, 2.0]
    values = np.arange(100.0)
    values[50] += 10
    smoothed = smooth(values)  # over five points
    assert smoothed[10:40] == pytest.approx(values[10:40])
    assert smoothed[48:53] == pytest.approx(np.array([50, 51, 52, 53, 54]))
    assert (smoothed[0], smoothed[99]) == (1.0, 98.0)
