"""Commands of the page that list and edit recorded episodes; none moves the arm."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from cliport_episodes.data_set import DataSet, draw_statistics
from cliport_episodes.edits import verdict_words
from cliport_episodes.errors import EpisodeError
from cliport_episodes.motion_video import read_frames, video_path
from cliport_episodes.names import check_name
from cliport_episodes.reader import Step
from demo_tool.arguments import number_of, text_of
from demo_tool.errors import CommandError, NotNowError
from demo_tool.live_view import ColorImage
from demo_tool.recording import Recorder, step_shown

_MAX_STEP = 100_000
_MAX_PARTS = 10
_MAX_EPISODES = 1_000_000
_MAX_SEED = 2**31 - 1


class Library:
    """The open data set, edited by commands. Raises StationError, EpisodesError."""

    def __init__(self, root: Path, recorder: Recorder) -> None:
        self._root, self._recorder = root, recorder
        self.commands: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "episodes": self._episodes,
            "episode": self._episode,
            "relabel": self._relabel,
            "trim": self._trim,
            "delete": self._delete,
            "restore": self._restore,
            "trash": self._trash,
            "empty_trash": self._empty_trash,
            "statistics": self._statistics,
            "merge": self._merge,
            "split": self._split,
        }

    def picture(self, name: str, step: int, data_set: str | None = None) -> ColorImage:
        """Read the colour image (H, W, 3) RGB of a recorded step; data_set: None for the open one."""
        return self._source(data_set).episode(name).step(step).observation().color

    def motion_picture(self, name: str, step: int, frame: int, data_set: str | None = None) -> bytes:
        """Read a frame of the video of a recorded step's motion, a JPEG file; data_set: None for the open one."""
        frames, _ = _motion_of(self._source(data_set).episode(name).step(step))
        if frame >= len(frames):
            raise NotNowError(f"step {step} of episode {name} has {len(frames)} frames of its motion")
        return frames[frame]

    def statistics_png(self) -> bytes:
        """Draw the statistics as a PNG file; return its bytes."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "statistics.png"
            draw_statistics(self._open().statistics(), path)
            return path.read_bytes()

    def mark(self, name: str, success: bool | None) -> dict[str, Any]:
        """Mark whether an episode reached its goal; return the answer to the page."""
        self._open().mark(name, success)
        return {"words": f"episode {name}: {verdict_words(success)}"}

    def _source(self, data_set: str | None) -> DataSet:
        return self._open() if data_set is None else DataSet.open(self._root / check_name("data set", data_set))

    def _open(self) -> DataSet:
        if self._recorder.data_set is None:
            raise NotNowError("open a data set first")
        return self._recorder.data_set

    def _episodes(self, _: Mapping[str, Any]) -> dict[str, Any]:
        return {
            "episodes": [
                {
                    "name": info.name,
                    "n_steps": info.n_steps,
                    "instructions": list(info.instructions),
                    "success": info.success,
                    "finished": info.finished,
                    "bytes": info.bytes,
                    "complaints": list(info.complaints),
                }
                for info in self._open().episodes()
            ]
        }

    def _episode(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        episode = self._open().episode(text_of(arguments, "name"))
        return {
            "name": episode.name,
            "success": episode.success,
            "complaints": list(episode.complaints),
            "steps": [{**step_shown(step.record), **_motion_shown(step)} for step in episode.steps],
        }

    def _relabel(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        name, text = text_of(arguments, "name"), text_of(arguments, "text")
        self._open().relabel(name, text, _step_of(arguments, "step"))
        return {"words": f"episode {name} is relabelled"}

    def _trim(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        name = text_of(arguments, "name")
        first, last = (_step_of(arguments, key) for key in ("first", "last"))
        self._open().trim(name, first, last)
        return {"words": f"episode {name} is trimmed"}

    def _delete(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        name = text_of(arguments, "name")
        self._open().delete(name)
        self._recorder.look_over()
        return {"words": f"episode {name} is in the trash"}

    def _restore(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        name = text_of(arguments, "name")
        self._open().restore(name)
        self._recorder.look_over()
        return {"words": f"episode {name} is back"}

    def _trash(self, _: Mapping[str, Any]) -> dict[str, Any]:
        return {"trashed": self._open().trashed(), "undone_steps": self._open().undone_steps()}

    def _empty_trash(self, _: Mapping[str, Any]) -> dict[str, Any]:
        count = self._open().empty_trash()
        return {"words": f"{count} episodes are gone for good; the trash is empty"}

    def _statistics(self, _: Mapping[str, Any]) -> dict[str, Any]:
        return {"statistics": self._open().statistics().to_dict()}

    def _merge(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Merge another data set of the same folder into the open one."""
        data_set, name = self._open(), text_of(arguments, "other")
        merged = data_set.merge(self._root / check_name("data set", name))
        self._recorder.look_over()
        return {"words": merged.words(name)}

    def _split(self, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """Split the open data set into new ones beside it."""
        data_set, parts = self._open(), _parts_of(arguments)
        if self._recorder.episode is not None:
            raise NotNowError("an episode is being recorded: end or discard it before the split")
        made = data_set.split(parts, number_of({"seed": 0, **arguments}, "seed", 0, _MAX_SEED))
        self._recorder.list_data_sets()
        counts = ", ".join(f"{part.name}: {len(part.episodes())} episodes" for part in made.values())
        return {"words": f"{counts}; {data_set.name} stays as it is"}


def _motion_of(step: Step) -> tuple[tuple[bytes, ...], float]:
    """Return the frames of a step's motion, and the time between two of them [s]; none where there is no video."""
    if step.record.result is None:  # one that was recorded before on the same picture
        return (), 0.0
    return read_frames(video_path(step.path.parent, step.record.stamp_ns))


def _motion_shown(step: Step) -> dict[str, Any]:
    """Return how many frames of a step's motion there are, and the time between two [ms]."""
    try:
        frames, period = _motion_of(step)
    except EpisodeError:  # it is a help to the eye, and no part of the episode
        frames, period = (), 0.0
    return {"frames": len(frames), "frame_ms": round(1000 * period)}


def _parts_of(arguments: Mapping[str, Any]) -> list[tuple[str, float]]:
    """Return each part's name and share, or number of episodes, from [[name, share], …].

    Raises:
        CommandError, BadNameError.
    """
    value = arguments.get("parts")
    entries = value if isinstance(value, list) and 0 < len(value) <= _MAX_PARTS else [None]  # None is refused below
    parts: list[tuple[str, float]] = []
    for entry in entries:
        match entry:
            case [str(name), int(share) | float(share)] if not isinstance(share, bool) and abs(share) <= _MAX_EPISODES:
                parts.append((check_name("part", name), share))
            case _:
                raise CommandError(
                    f"'parts' must be 1 to {_MAX_PARTS} pairs of a name and a share, as in [['train', 0.8], "
                    "['val', 0.2]]"
                )
    return parts


def _step_of(arguments: Mapping[str, Any], name: str) -> int | None:
    """Return a step's number, None where it is not given. Raises CommandError."""
    return None if arguments.get(name) is None else number_of(arguments, name, 0, _MAX_STEP)
