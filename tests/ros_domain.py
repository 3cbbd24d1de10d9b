"""ROS domains for tests: one each, so that no graph hears of another's end late, whatever runs beside it."""

import itertools
import os

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

# 0 to 101 leave the ports alone that the system gives to clients. Processes start far apart in the cycle.
_LAST = 101
_domains = itertools.cycle(range(1, _LAST + 1))
for _ in range(os.getpid() * 37 % _LAST):
    next(_domains)


def next_domain() -> int:
    """A ROS_DOMAIN_ID that this process has not used for a hundred calls."""
    return next(_domains)
