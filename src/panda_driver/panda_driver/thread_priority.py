"""Puts the thread that drives an arm before everything else."""

from __future__ import annotations

import os
import sys

PRIORITY = 20  # of SCHED_FIFO; libfranka's own loop takes the highest
_SWITCH_S = 0.0005  # after which another thread hands over the interpreter: a reference 5 ms late is felt as a jerk


def put_this_thread_first() -> bool:
    """Give the calling thread real-time priority, and the interpreter soon whenever it asks.

    Returns False where the system does not permit the priority (`ulimit -r`); the rest is done.
    """
    sys.setswitchinterval(_SWITCH_S)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except OSError:
        return False
    return True
