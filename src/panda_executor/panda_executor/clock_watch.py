"""ROS time beside a steady clock while a motion runs: whether it stands still, and whether it jumped."""

from __future__ import annotations

from panda_executor.errors import PortError

_BACK = 0.25  # ROS time that goes back by more jumped; by less it was corrected [s]
_AHEAD = 0.5  # it jumped where it went so much farther than it can have gone by itself [s]
_FASTEST_SIMULATED = 50.0  # times real time that a simulator's clock may go
_FASTEST = 2.0  # and the machine's own, which may be corrected


class ClockWatch:
    """Looks at ROS time all the time.

    What follows a jumped clock cannot be judged: joint states that are fresh by their stamps may be old, and a motion's
    time may never be over.

    Args:
        now: ROS time [s], wall: steady time [s], both of the first look; simulated: whether a simulator's clock is
            followed, which may go faster.
    """

    def __init__(self, now: float, wall: float, simulated: bool) -> None:
        self._last, self._moved_at = now, wall
        self._fastest = _FASTEST_SIMULATED if simulated else _FASTEST

    def look(self, now: float, wall: float) -> float:
        """Return how far ROS time went since the last look [s]: less than nothing where it was corrected.

        Raises:
            PortError: when it jumped.
        """
        passed = now - self._last
        # What was not delivered for a while comes at once: so the last time that it moved counts, not the last look.
        if passed < -_BACK or passed > _AHEAD + self._fastest * (wall - self._moved_at):
            where = "ahead" if passed > 0.0 else "back"
            raise PortError(
                f"the clock jumped {abs(passed):.1f} s {where} during a motion: what is measured cannot be told from "
                "what is old; the arm stays where it is"
            )
        if passed != 0.0:
            self._last, self._moved_at = now, wall
        return passed

    def stood_for(self, wall: float) -> float:
        """Return how long ROS time has been the same [s, steady time]."""
        return wall - self._moved_at
