"""Holder of the arm: the open page that may command it."""

from __future__ import annotations

from enum import Enum

GONE_AFTER_S = 5.0
IDLE_AFTER_S = 180.0


class Standing(Enum):
    """Holder of the arm as seen by a page; the values are the page's."""

    ME = "me"
    OTHER = "other"
    NOBODY = None


class ArmHolder:
    """Holder of the arm: the first page, while the others watch. Times [s] are those of one monotonic clock, handed in.

    A page is known by its random name, kept over a reload. Its hold ends when it gives it up, has been away for
    GONE_AFTER_S, or has commanded nothing for IDLE_AFTER_S: then another may take over.
    """

    def __init__(self) -> None:
        self._page: str | None = None
        self._away_since: float | None = None
        self._last_act = 0.0

    def join(self, page: str, now: float) -> None:
        """Note that a page was opened, or opened again."""
        if self._page is None or page == self._page or self._is_gone(now):
            self._hold(page, now)

    def leave(self, page: str, now: float) -> None:
        """Note that a page's connection has ended."""
        if page == self._page:
            self._away_since = now

    def act(self, page: str, now: float) -> None:
        """Note that a page has sent a command."""
        if page == self._page:
            self._last_act = now

    def give_up(self, page: str) -> None:
        """End a page's hold."""
        if page == self._page:
            self._page = None

    def take_over(self, page: str, now: float) -> bool:
        """Let the page hold the arm if it may; return True if it does."""
        if self.may_take_over(page, now):
            self._hold(page, now)
        return page == self._page

    def may_take_over(self, page: str, now: float) -> bool:
        """Return True if a page does not hold the arm and would get it."""
        return page != self._page and (self._page is None or self._is_gone(now) or now - self._last_act > IDLE_AFTER_S)

    def standing(self, page: str) -> Standing:
        """Return the holder of the arm as seen by a page."""
        if self._page is None:
            return Standing.NOBODY
        return Standing.ME if page == self._page else Standing.OTHER

    def _is_gone(self, now: float) -> bool:
        return self._away_since is not None and now - self._away_since > GONE_AFTER_S

    def _hold(self, page: str, now: float) -> None:
        self._page, self._away_since, self._last_act = page, None, now
