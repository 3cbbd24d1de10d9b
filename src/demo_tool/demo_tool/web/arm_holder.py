"""Which of the pages that are open may command the arm."""

from __future__ import annotations

from enum import Enum

GONE_AFTER_S = 5.0
IDLE_AFTER_S = 180.0


class Standing(Enum):
    """What a page is told of who holds the arm; None stands for nobody."""

    ME = "me"
    OTHER = "other"
    NOBODY = None


class ArmHolder:
    """The first page holds the arm, the others watch; the times [s] handed in are of one monotonic clock.

    A page is its own random name, kept over a reload. Its hold ends when it gives it up, has been away for
    GONE_AFTER_S, or has commanded nothing for IDLE_AFTER_S: then another may take over.
    """

    def __init__(self) -> None:
        self._page: str | None = None
        self._away_since: float | None = None
        self._last_act = 0.0

    def join(self, page: str, now: float) -> None:
        """A page has opened, or opened again."""
        if self._page is None or page == self._page or self._is_gone(now):
            self._hold(page, now)

    def leave(self, page: str, now: float) -> None:
        """A page's connection has ended."""
        if page == self._page:
            self._away_since = now

    def act(self, page: str, now: float) -> None:
        """A page has sent a command."""
        if page == self._page:
            self._last_act = now

    def give_up(self, page: str) -> None:
        """A page lets others take over."""
        if page == self._page:
            self._page = None

    def take_over(self, page: str, now: float) -> bool:
        """Let the page hold the arm if it may; whether it does."""
        if self.may_take_over(page, now):
            self._hold(page, now)
        return page == self._page

    def may_take_over(self, page: str, now: float) -> bool:
        """Whether a page that does not hold the arm would get it."""
        return page != self._page and (self._page is None or self._is_gone(now) or now - self._last_act > IDLE_AFTER_S)

    def standing(self, page: str) -> Standing:
        """Who holds the arm, as seen by a page."""
        if self._page is None:
            return Standing.NOBODY
        return Standing.ME if page == self._page else Standing.OTHER

    def _is_gone(self, now: float) -> bool:
        return self._away_since is not None and now - self._away_since > GONE_AFTER_S

    def _hold(self, page: str, now: float) -> None:
        self._page, self._away_since, self._last_act = page, None, now
