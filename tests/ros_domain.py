"""ROS domains for tests: one each, so that no graph hears of another's end late, whatever runs beside it."""

import gc
import itertools
import os

os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")

# 0 to 101 leave the ports alone that the system gives to clients. Workers of one run take turns at them; processes of
# other runs start far apart in the cycle.
_LAST = 101
_WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
_WORKERS = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
_OWN = range(1 + _WORKER, _LAST + 1, _WORKERS)
_RUN = os.getppid() if _WORKERS > 1 else os.getpid()
_domains = itertools.cycle(_OWN)
for _ in range(_RUN * 37 % len(_OWN)):
    next(_domains)


def next_domain() -> int:
    """Return a ROS_DOMAIN_ID that no other worker uses and this one has not used for many calls."""
    domain = next(_domains)
    if domain == _OWN[0]:  # once between two uses of any
        gc.collect()  # rclpy's action servers outlive their nodes, and are found in their domains, until then
    return domain
