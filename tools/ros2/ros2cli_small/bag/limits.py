"""Opening of a bag from elsewhere with caps on what it may declare, which the workspace's core has."""

from __future__ import annotations

from pathlib import Path

from rosbags.rosbag2 import Reader

from ros2cli_small.errors import CommandError


class HostileBag(Exception):
    """A bag that declares, or holds, more than it may."""


def open_reader(path: Path) -> Reader:
    """Open a bag's folder or one of its files.

    Raises:
        HostileBag: when it declares, or holds, more than it may.
        CommandError: when the core is not built.
        Exception: the library does not say what a damaged file may raise.
    """
    try:
        from cliport_core import bag_library
        from cliport_core.bag_limits import TooMuchError
    except ImportError:
        raise CommandError("What reads bags is not built yet: run tools/build and source env.sh") from None
    try:
        return bag_library.open_reader(path)
    except TooMuchError as error:
        raise HostileBag(str(error)) from None
