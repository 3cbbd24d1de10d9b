"""Keys pressed in the terminal while a command runs."""

from __future__ import annotations

import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager

POLL_PERIOD = 0.1  # s


@contextmanager
def key_presses(on_key: Callable[[str], None], enabled: bool = True) -> Iterator[bool]:
    """Call `on_key` from a thread for each key; yield whether there is a terminal, and we are in its foreground."""
    file = sys.stdin.fileno() if sys.stdin else -1
    # In the background, to touch the terminal's settings would stop us.
    if not enabled or not os.isatty(file) or os.tcgetpgrp(file) != os.getpgrp():
        yield False
        return
    settings = termios.tcgetattr(file)
    done = threading.Event()

    def read() -> None:
        while not done.is_set():
            if select.select([file], [], [], POLL_PERIOD)[0]:
                key = os.read(file, 1)
                if not key:
                    return
                on_key(key.decode(errors="replace"))

    tty.setcbreak(file)
    thread = threading.Thread(target=read, name="keyboard", daemon=True)
    thread.start()
    try:
        yield True
    finally:
        done.set()
        thread.join()
        termios.tcsetattr(file, termios.TCSADRAIN, settings)
