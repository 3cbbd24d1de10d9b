"""A tree of named frames, as /tf and /tf_static describe it."""

from __future__ import annotations

from cliport_core.errors import FrameError
from cliport_core.pose import Pose


class TransformTree:
    """The latest transform of every child frame in its parent; no history, no interpolation."""

    def __init__(self) -> None:
        self._links: dict[str, tuple[str, Pose]] = {}

    def put(self, parent: str, child: str, child_in_parent: Pose) -> None:
        """Store the pose of `child` in `parent`, in place of an earlier one."""
        self._links[_plain(child)] = (_plain(parent), child_in_parent)

    @property
    def frames(self) -> set[str]:
        """Names of all known frames."""
        return set(self._links) | {parent for parent, _ in self._links.values()}

    def source_in_target(self, source: str, target: str) -> Pose:
        """Return the pose of frame `source` in frame `target`.

        Raises:
            FrameError: when no chain of transforms joins them.
        """
        from_source = self._ancestors(_plain(source))
        from_target = self._ancestors(_plain(target))
        for ancestor, source_in_ancestor in from_source.items():
            if ancestor in from_target:
                return from_target[ancestor].inverse() @ source_in_ancestor
        raise FrameError(_plain(source), _plain(target), self.frames)

    def _ancestors(self, frame: str) -> dict[str, Pose]:
        """Return every ancestor of a frame, itself first, with the frame's pose in it."""
        found = {frame: Pose.identity()}
        while frame in self._links:
            parent, frame_in_parent = self._links[frame]
            if parent in found:  # a cycle: whoever publishes it is wrong, and we must not hang
                break
            found[parent] = frame_in_parent @ found[frame]
            frame = parent
        return found


def _plain(frame: str) -> str:
    return frame.lstrip("/")
