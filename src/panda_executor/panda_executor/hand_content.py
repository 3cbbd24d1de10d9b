"""The hand's content, as far as its width tells."""

from __future__ import annotations

from cliport_core import topics
from cliport_core.outcome import Refusal
from panda_executor.errors import RequestError
from panda_executor.hand_geometry import HandShape

_SAME_WIDTH = 0.003  # fingers that have not moved by more still hold what they held [m]
_NEARLY_OPEN = 0.005  # fingers that stand open by all but so much hold nothing [m]


class HandContent:
    """Remembers at which width the fingers closed on something, across runs and whatever ended them.

    What the fingers did before is unknown: where they are first measured neither closed nor open they count as holding
    something, of unknown shape, until they are told to open.

    Args:
        missed_width: fingers closer than this hold nothing [m]; opening: of the whole hand [m].
    """

    def __init__(self, missed_width: float, opening: float) -> None:
        self._missed_width, self._opening = missed_width, opening
        self._held_at: float | None = None
        self._measured = False
        self._since_start = False  # what is held was held when the fingers were first measured
        self._closing = False  # told to close, and not measured since
        self._load: HandShape | None = None

    def begin(self, commanded: float, load: HandShape | None = None) -> None:
        """Note that the fingers are told to go to `commanded` [m]; what they hold is kept until they are measured.

        load: the hand's shape with what it is to close on, where that is known.
        """
        self._closing = commanded < self._missed_width
        if self._closing:
            self._load = load

    def note(self, commanded: float, width: float) -> None:
        """Note that the fingers, told to go to `commanded` [m], are `width` [m] apart, whatever ended their motion."""
        stopped_on_something = commanded < self._missed_width <= width
        self._held_at = width if stopped_on_something else None
        self._closing = self._since_start = False
        self._measured = True

    def holds(self, width: float) -> bool:
        """Return True if the fingers, now `width` [m] apart, hold something."""
        if self._closing:
            return width >= self._missed_width
        if not self._measured:
            self._measured = True
            if self._missed_width <= width <= self._opening - _NEARLY_OPEN:
                self._held_at, self._since_start = width, True
        return self._held_at is not None and abs(width - self._held_at) < _SAME_WIDTH

    def has_lost(self, width: float) -> bool:
        """Return True if the fingers, now `width` [m] apart, do not hold any more what they closed on.

        They closed, or they opened: what is held may give way, but it does not grow.
        """
        opened = self._held_at is not None and width > self._held_at + _SAME_WIDTH
        return opened or width < self._missed_width

    def load(self, width: float) -> HandShape | None:
        """Return the hand's shape with what it holds, now `width` [m] apart; None where that is nothing, or unknown."""
        return self._load if self.holds(width) else None

    def check_empty(self, width: float) -> None:
        """Check that the fingers, now `width` [m] apart, hold nothing.

        Raises:
            RequestError: when they do; says how to let go.
        """
        if not self.holds(width):
            return
        words = (
            f"the hand still holds something {1000.0 * width:.0f} mm wide; call {topics.EXECUTOR_RECOVER} to carry "
            f"it back, {topics.EXECUTOR_OPEN} to let it go"
        )
        if self._since_start:
            words = (
                f"the fingers stood {1000.0 * width:.0f} mm apart when the executor started, and may hold something; "
                f"look, then call {topics.EXECUTOR_OPEN} to let it go ({topics.EXECUTOR_RECOVER} would carry it back "
                "without knowing its size)"
            )
        raise RequestError(words, Refusal.HAND_NOT_EMPTY, width, self._missed_width)
