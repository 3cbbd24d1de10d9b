"""Connections that are answered, refused, and never answered."""

from __future__ import annotations

import threading

import pytest

from panda_driver.connecting import connected_within
from panda_driver.errors import ConnectionFailedError


def test_what_connects_in_time_is_returned_and_its_error_raised() -> None:
    assert connected_within(20.0, "arm", "h", lambda: "made") == "made"

    def refused() -> None:
        raise ConnectionFailedError("no arm at h")

    with pytest.raises(ConnectionFailedError, match=r"^no arm at h$"):
        connected_within(20.0, "arm", "h", refused)


def test_an_arm_that_never_answers_is_given_up_in_one_line() -> None:
    ends = threading.Event()
    with pytest.raises(ConnectionFailedError, match=r"no answer from the arm at h for 0\.05 s: another program may be"):
        connected_within(0.05, "arm", "h", ends.wait)
    ends.set()
