"""Errors of libfranka in one line that says what to do."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from panda_driver.franky_ports import error_names, lost_words, reflex_words, words_of


def error(kind: str, text: str) -> Exception:
    return type(kind, (Exception,), {})(text)


@pytest.mark.parametrize(
    ("what", "kind", "text", "said"),
    [
        (
            "arm",
            "NetworkException",
            "libfranka: Connection refused.",
            "no arm at 1.2.3.4 (Connection refused): look",
        ),
        ("hand", "NetworkException", "libfranka: timeout", "no hand at 1.2.3.4 (timeout): initialise it in Desk"),
        ("arm", "IncompatibleVersionException", "server 5,\nlibrary 10", "the protocol (server 5, library 10)"),
        ("arm", "RealtimeException", "libfranka: no realtime", "-p realtime:=false"),
        ("arm", "CommandException", "set load rejected", "the arm at 1.2.3.4: set load rejected"),
    ],
)
def test_a_failed_connection(what: str, kind: str, text: str, said: str) -> None:
    words = words_of(what, "1.2.3.4", error(kind, text))
    assert said in words and "\n" not in words


def test_a_broken_connection_and_a_reflex() -> None:
    lost = lost_words("hand", "h", error("X", "Net Exception"))
    assert "the hand at h was lost (Net Exception): look at the cable" in lost
    said = reflex_words(error("ControlException", "libfranka: Move command aborted: cartesian_reflex"))
    assert said.startswith("the arm stopped by itself: Move command aborted: cartesian_reflex; look what it touched")


def test_a_network_that_fails_in_a_motion_is_no_contact() -> None:
    said = reflex_words(error("NetworkException", "libfranka: UDP receive: Timeout"))
    assert (
        said == "the arm's states stopped coming (UDP receive: Timeout): look at the cable, then call ~/recover_errors"
    )


def test_names_of_errors() -> None:
    assert error_names(SimpleNamespace(joint_reflex=True, cartesian_reflex=False, count=3)) == ["joint_reflex"]
