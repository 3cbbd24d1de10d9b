"""What a module's tests share is one thing, until a test is tried again."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import pytest
from made_anew import MadeAnew


def the_try(number: int) -> Any:
    return SimpleNamespace(node=SimpleNamespace(execution_count=number))


def test_a_further_try_gets_another_and_the_old_one_is_ended_first() -> None:
    heard: list[str] = []

    @contextmanager
    def one() -> Iterator[int]:
        number = len(heard)
        heard.append(f"begin {number}")
        yield number
        heard.append(f"end {number}")

    with MadeAnew(one) as shared:
        assert (shared.of(the_try(1)), shared.of(the_try(1))) == (0, 0)
        assert shared.of(the_try(2)) == 2
        assert shared.of(the_try(1)) == 2, "the next test goes on with it"
        shared.end()
        assert heard[-1] == "end 2"
        assert shared.of(the_try(1)) == 4, "who asks after its end gets another"
    assert heard == ["begin 0", "end 0", "begin 2", "end 2", "begin 4", "end 4"]


def test_one_that_could_not_be_ended_is_not_met_again() -> None:
    @contextmanager
    def one() -> Iterator[object]:
        yield object()
        raise ValueError("it does not end")

    shared = MadeAnew(one)
    first = shared.of(the_try(1))
    with pytest.raises(ValueError, match="does not end"):
        shared.of(the_try(2))
    assert shared.of(the_try(3)) is not first
