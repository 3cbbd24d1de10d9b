"""What the tests of a module share, made anew for a test that is tried again: no try meets what another left."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, ExitStack
from typing import TYPE_CHECKING, Generic, TypeVar

if TYPE_CHECKING:
    import pytest

Shared = TypeVar("Shared")


class MadeAnew(Generic[Shared]):
    """Something that is made for the first test that asks for it, and again for each further try of a test."""

    def __init__(self, make: Callable[[], AbstractContextManager[Shared]]) -> None:
        self._make = make
        self._made = ExitStack()
        self._shared: Shared | None = None

    def __enter__(self) -> MadeAnew[Shared]:
        return self

    def __exit__(self, *error: object) -> None:
        self._made.close()

    def of(self, request: pytest.FixtureRequest) -> Shared:
        """Return what a test's try may use; a test asks once in each."""
        if self._shared is None or getattr(request.node, "execution_count", 1) > 1:
            self.end()
            self._shared = self._made.enter_context(self._make())
        return self._shared

    def end(self) -> None:
        """End it where a test needs it no more; one that asks for it later gets another."""
        self._shared = None
        self._made.close()
