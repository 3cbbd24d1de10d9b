"""The newest cloud: how old, how far ahead and how long before the goal and the arm's rest it may have been taken."""

from __future__ import annotations

import struct

import pytest

from cliport_core.outcome import Refusal
from panda_executor.cloud_cache import CloudCache
from panda_executor.errors import RequestError

S = 1_000_000_000
MS = S // 1000


def cache_with(seconds: int, behind: float = 0.5) -> CloudCache:
    cache = CloudCache(max_age=2.0, behind=behind, max_ahead=0.25)
    cache.put(raw(seconds))
    return cache


def raw(seconds: int) -> bytes:
    return b"\x00\x01\x00\x00" + struct.pack("<iI", seconds, 0) + b"the rest"


def refusal(now: int, goal: int = 0, still: int = 0, behind: float = 0.5) -> RequestError | None:
    """Ask for a cloud of 10 s at some times [ms]."""
    try:
        assert cache_with(10, behind).get(now * MS, goal * MS, still * MS) == raw(10)
    except RequestError as error:
        return error
    return None


@pytest.mark.parametrize(
    ("now", "goal", "still", "kind", "value", "limit"),
    [
        (12_001, 0, 0, Refusal.OLD_CLOUD, 2.001, 2.0),
        (9_749, 0, 0, Refusal.FUTURE_CLOUD, 0.251, 0.25),
        (11_000, 10_501, 0, Refusal.OLD_CLOUD, 0.501, 0.5),
        (11_000, 0, 10_001, Refusal.OLD_CLOUD, 0.001, 0.0),
    ],
)
def test_a_cloud_is_given_up_to_each_bound_and_refused_beyond_it(
    now: int, goal: int, still: int, kind: Refusal, value: float, limit: float
) -> None:
    error = refusal(now, goal, still)
    assert error is not None
    assert error.refusal is kind and error.value == pytest.approx(value) and error.limit == limit
    inwards = 1 if kind is Refusal.FUTURE_CLOUD else -1
    moved = [now, goal, still]
    moved[next(i for i in (2, 1, 0) if (now, goal, still)[i])] += inwards
    assert refusal(*moved) is None


def test_a_goal_of_an_unknown_observation_takes_any_fresh_cloud() -> None:
    assert refusal(10_500, behind=-20.0) is None
    error = refusal(10_500, goal=10_400, behind=-20.0)
    assert error is not None and "older than the goal's observation" in str(error)


def test_no_cloud_has_a_refusal_of_its_own() -> None:
    for asked in (lambda cache: cache.get(0, 0, 0), lambda cache: cache.since(0, 0)):
        with pytest.raises(RequestError) as caught:
            asked(CloudCache())
        assert caught.value.refusal is Refusal.NO_CLOUD


@pytest.mark.parametrize(
    ("now", "departed", "kind", "value", "limit"),
    [
        (9_749, 0, Refusal.FUTURE_CLOUD, 0.251, 0.25),
        (12_001, 0, Refusal.OLD_CLOUD, 2.001, 2.0),
        (11_000, 10_001, Refusal.OLD_CLOUD, 0.001, 0.0),
    ],
)
def test_a_cloud_since_the_departure_is_given_up_to_each_bound(
    now: int, departed: int, kind: Refusal, value: float, limit: float
) -> None:
    with pytest.raises(RequestError) as caught:
        cache_with(10).since(now * MS, departed * MS)
    error = caught.value
    assert error.refusal is kind and error.value == pytest.approx(value) and error.limit == limit
    now, departed = (now, 10_000) if departed else (now + (1 if now < 10_000 else -1), 0)
    assert cache_with(10).since(now * MS, departed * MS) == raw(10)


def test_the_usual_bounds_are_two_seconds_a_quarter_ahead_and_no_older_than_the_goal() -> None:
    cache = CloudCache()
    cache.put(raw(10))
    for now in (12_000, 9_750):
        assert cache.get(now * MS, 0, 0) == raw(10)
    for now in (12_001, 9_749):
        with pytest.raises(RequestError):
            cache.get(now * MS, 0, 0)
    assert cache.get(11 * S, 10 * S, 10 * S) == raw(10)
    with pytest.raises(RequestError, match="older than the goal's observation"):
        cache.get(11 * S, 10 * S + 1, 0)


def test_an_age_is_told_in_seconds_and_negative_ahead() -> None:
    assert cache_with(10).age(10_250 * MS) == pytest.approx(0.25)
    assert cache_with(10).age(9_900 * MS) == pytest.approx(-0.1)
