"""The gripper's pose in the base, read from transforms: news only when a link between the two has come."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from cliport_core.errors import FrameError
from cliport_core.pose import Pose
from cliport_core.transforms import TransformTree


class Link(NamedTuple):
    """One transform: the pose of frame `child` in frame `parent`, and its stamp [ns]."""

    parent: str
    child: str
    child_in_parent: Pose
    stamp_ns: int


class GripperFeed:
    """Follows the chain of frames from the base to the gripper among all that is published."""

    def __init__(self, base: str, gripper: str) -> None:
        """Begin with no transform. base, gripper: names of frames."""
        self._base, self._gripper = base, gripper
        self._tree = TransformTree()
        self._parents: dict[str, str] = {}

    def put(self, links: Iterable[Link]) -> None:
        """Take note of links that do not change."""
        for link in links:
            self._tree.put(link.parent, link.child, link.child_in_parent)
            self._parents[_plain(link.child)] = _plain(link.parent)

    def on_links(self, links: Iterable[Link]) -> tuple[int, Pose] | None:
        """Take note of links; return the gripper's pose in the base with its stamp [ns].

        None when no stamped link of the chain is among them: others say nothing about the arm.
        """
        links = list(links)
        self.put(links)
        chain = self._chain()
        stamp_ns = max((link.stamp_ns for link in links if _plain(link.child) in chain), default=0)
        if stamp_ns == 0:
            return None
        try:
            return stamp_ns, self._tree.source_in_target(self._gripper, self._base)
        except FrameError:
            return None

    def _chain(self) -> set[str]:
        """Return the frames whose links lead from one of the two frames to the other."""
        return self._ancestry(self._gripper) ^ self._ancestry(self._base)

    def _ancestry(self, frame: str) -> set[str]:
        found = {_plain(frame)}
        frame = _plain(frame)
        while frame in self._parents and self._parents[frame] not in found:
            frame = self._parents[frame]
            found.add(frame)
        return found


def _plain(frame: str) -> str:
    return frame.lstrip("/")
