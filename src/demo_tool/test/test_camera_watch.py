"""The age, the rate and the problem of the camera's pictures, at their limits."""

from __future__ import annotations

import pytest
from overhead_camera import flat, view_of

from demo_tool.camera_watch import BEFORE_REST, CameraWatch
from demo_tool.live_view import LiveView
from demo_tool.station_config import StationConfig

S = 1_000_000_000  # ns
NOW = 200_000 * S


def taken(stamp_ns: int) -> LiveView:
    view = view_of(flat())
    return LiveView(stamp_ns, stamp_ns, *(getattr(view, name) for name in _REST))


_REST = ("frame", "camera", "camera_in_base", "raw", "read_color", "read_depth")


def watched(age: float, silence: float = 0.0, fault: str = "") -> str | None:
    """Return the problem with a picture of that age [s] that came `silence` seconds ago."""
    watch = CameraWatch(StationConfig())
    watch.on_view(taken(NOW - round(age * S)), 50.0)
    watch.fault = fault
    return watch.problem(NOW, 50.0 + silence)


@pytest.mark.parametrize(
    ("age", "silence", "words"),
    [
        (0.0, 0.0, None),
        (0.99, 0.0, None),
        (1.04, 0.0, "the picture is older than 1 s: is the camera running?"),
        (1.36, 0.0, "the picture is older than 1 s: is the camera running?"),
        (-0.99, 0.0, None),
        (-1.01, 0.0, "the camera's clock and this station's differ: set use_sim_time alike on every node"),
        (99_999.0, 0.0, "the picture is older than 1 s: is the camera running?"),
        (100_001.0, 0.0, "the camera's clock and this station's differ: set use_sim_time alike on every node"),
        (0.5, 2.99, None),
        (0.5, 3.01, "the camera sends no picture: is it running?"),
    ],
)
def test_pictures_are_used_for_a_second(age: float, silence: float, words: str | None) -> None:
    assert watched(age, silence) == words


def test_a_known_fault_is_said_in_place_of_a_guess() -> None:
    fault = "no /tf_static joins the camera and the arm"
    assert watched(2.0, 0.0, fault) == watched(0.0, 4.0, fault) == fault
    assert watched(0.0, 0.0, fault) is None
    watch = CameraWatch(StationConfig())
    assert watch.problem(NOW, 1.0) == "no picture has come yet: is the camera running?"
    watch.fault = fault
    assert watch.problem(NOW, 1.0) == fault
    watch.on_view(taken(NOW), 1.0)
    assert watch.fault == ""


@pytest.mark.parametrize(
    ("stamp", "now", "problem"),
    [
        (0.0, 0.0, BEFORE_REST),
        (0.099, 0.2, BEFORE_REST),
        (0.1, 0.2, None),
        (-9.8, -9.8, BEFORE_REST),
        (-10.0, -9.9, BEFORE_REST),
        (-10.0, -9.95, None),  # the clock was set back, as where a simulator is started again
    ],
)
def test_a_picture_counts_from_a_tenth_of_a_second_after_the_rest(stamp, now, problem) -> None:
    watch = CameraWatch(StationConfig())
    watch.on_rest(NOW)
    watch.on_view(taken(NOW + round(stamp * S)), 5.0)
    assert watch.problem(NOW + round(now * S), 5.0) == problem


def test_the_age_of_no_picture_is_infinite() -> None:
    watch = CameraWatch(StationConfig())
    assert watch.age(NOW) == float("inf")
    watch.on_view(taken(NOW), 0.0)
    assert watch.age(NOW + S // 4) == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("arrivals", "now", "rate"),
    [
        ([], 0.0, 0.0),
        ([1.0], 1.0, 0.0),
        ([1.0, 1.5], 1.5, 2.0),
        ([1.0, 1.25], 1.25, 0.0),  # too short a time to say
        ([1.0, 1.1, 1.2, 1.6], 1.6, 5.0),
        ([1.0, 1.5], 4.4, 2.0),
        ([1.0, 1.5], 4.6, 0.0),
        ([0.0] * 5 + [1.0 + 0.1 * i for i in range(16)], 2.5, 10.0),  # of the last sixteen
    ],
)
def test_the_rate_is_of_the_last_pictures(arrivals: list[float], now: float, rate: float) -> None:
    watch = CameraWatch(StationConfig())
    for wall in arrivals:
        watch.on_view(taken(NOW), wall)
    assert watch.rate(now) == pytest.approx(rate)
