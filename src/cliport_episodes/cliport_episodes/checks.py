"""Check of a whole episode: everything in it is read once."""

from __future__ import annotations

from contextlib import closing

from cliport_core.bag_library import open_reader
from cliport_core.errors import CoreError
from cliport_episodes.bags import one_line
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.errors import BagError
from cliport_episodes.reader import Episode


def check_episode(episode: Episode, setup: CaptureSetup) -> list[str]:
    """Return one line for a person about each defect of an episode; setup: the data set's."""
    found = list(episode.complaints)
    if not episode.steps:
        found.append("it has no step")
    if not episode.finished:
        found.append("it was not finished: resume it, or mark and keep it as it is")
    found += [f"it was recorded with another setup: {words}" for words in episode.setup.differences(setup)]
    for step in episode.steps:
        try:
            observation = step.observation()
            if observation.heightmap(setup.workspace).valid_fraction == 0.0:
                found.append(f"step {step.record.step} shows nothing of the workspace")
        except (BagError, CoreError) as error:
            found.append(str(error))
    return found + _bag_complaints(episode)


def _bag_complaints(episode: Episode) -> list[str]:
    """Return the defects that any other reader of rosbag2 would find."""
    try:
        with closing(open_reader(episode.path)) as reader:
            times = [time for _, time, _ in reader.messages()]
            if len(times) != reader.message_count:
                return [f"it holds {len(times)} messages and says {reader.message_count}"]
            return [] if times == sorted(times) else ["its messages are not in the order of time"]
    except Exception as error:  # the library does not say what a damaged bag may raise
        return [f"as a rosbag2 bag it cannot be read: {one_line(error)}"]
