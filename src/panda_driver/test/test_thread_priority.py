"""The priority of the thread that drives an arm."""

import os
import sys
import threading

import pytest

from panda_driver.thread_priority import PRIORITY, put_this_thread_first


@pytest.fixture(autouse=True)
def same_interval():
    before = sys.getswitchinterval()
    yield
    sys.setswitchinterval(before)


def of_a_thread() -> tuple[bool, int, int]:
    """Return what a thread of its own is answered, its scheduler and its priority."""
    found = []

    def body() -> None:
        said = put_this_thread_first()
        found.append((said, os.sched_getscheduler(0), os.sched_getparam(0).sched_priority))

    thread = threading.Thread(target=body)
    thread.start()
    thread.join()
    return found[0]


def test_the_calling_thread_alone_comes_first_where_the_system_permits_it():
    said, scheduler, priority = of_a_thread()
    assert (scheduler, priority) == ((os.SCHED_FIFO, PRIORITY) if said else (os.SCHED_OTHER, 0))
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_without_permission_only_the_interpreter_is_handed_over_sooner(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert of_a_thread() == (False, os.SCHED_OTHER, 0)
    assert sys.getswitchinterval() < 0.001
