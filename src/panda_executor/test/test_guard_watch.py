"""The executor moves nothing while no guard watches it."""

from __future__ import annotations

import pytest

from cliport_core.outcome import Refusal
from panda_executor.errors import RequestError
from panda_executor.guard_watch import GuardWatch


def test_a_guard_watches_while_it_reports() -> None:
    now = [100.0]
    watch = GuardWatch(lambda: now[0], 3.0)
    with pytest.raises(RequestError, match=r"^no guard has been heard yet \(at most 3 s\): .*'ros2 run panda_executor"):
        watch.check()
    watch.on_report()
    now[0] = 103.0
    watch.check()
    now[0] = 103.5
    words = r"^no guard was heard for 3\.5 s \(at most 3 s\): .*guard_silence:=0\.0$"
    with pytest.raises(RequestError, match=words) as caught:
        watch.check()
    assert (caught.value.refusal, caught.value.value, caught.value.limit) == (Refusal.NO_GUARD, 3.5, 3.0)


def test_none_is_asked_for_where_a_person_said_so() -> None:
    GuardWatch(lambda: 100.0, 0.0).check()
