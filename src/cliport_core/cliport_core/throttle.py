"""A throttle for complaints: a new one passes at once, the same one once in a while."""

from __future__ import annotations

import re

_FIGURES = re.compile(r"[-+]?\d+(\.\d+)?")


class MessageThrottle:
    """Lets a text through when it differs from the last one in more than its figures, or after `period_s`."""

    def __init__(self, period_s: float) -> None:
        self._period_s = period_s
        self._last: tuple[str, float] | None = None

    def passes(self, message: str, now_s: float) -> bool:
        """Return True if `message` is to be said at `now_s` (any clock that does not jump)."""
        kind = _FIGURES.sub("#", message)
        if self._last and self._last[0] == kind and now_s - self._last[1] < self._period_s:
            return False
        self._last = kind, now_s
        return True

    def reset(self) -> bool:
        """Forget the last complaint, as things are well again; return True if there was one."""
        had_complaint = self._last is not None
        self._last = None
        return had_complaint
