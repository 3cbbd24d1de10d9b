"""The priority of the thread that drives an arm."""

import os
import sys

import pytest

from panda_driver.thread_priority import PRIORITY, put_this_thread_first


@pytest.fixture(autouse=True)
def same_interval():
    before = sys.getswitchinterval()
    yield
    sys.setswitchinterval(before)


def test_the_calling_thread_asks_for_real_time_priority(monkeypatch: pytest.MonkeyPatch):
    asked = []
    monkeypatch.setattr(os, "sched_setscheduler", lambda who, policy, param: asked.append((who, policy, param)))
    put_this_thread_first()
    assert asked == [(0, os.SCHED_FIFO, os.sched_param(PRIORITY))]
    assert sys.getswitchinterval() < 0.001


def test_without_permission_the_interpreter_is_still_handed_over_sooner(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    put_this_thread_first()
    assert sys.getswitchinterval() < 0.001
