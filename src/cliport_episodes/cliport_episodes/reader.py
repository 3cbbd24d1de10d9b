"""Reading of an episode: its steps as edited; observations are read when they are asked for."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from cliport_core import topics
from cliport_episodes.bags import read_messages
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set_file import read_setup
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.demonstration_messages import record_from_message
from cliport_episodes.edits import Edits
from cliport_episodes.episode_folder import FINAL, read_edits, read_own_setup, step_paths
from cliport_episodes.errors import BagError, EpisodeError
from cliport_episodes.observation import OBSERVATION_TOPICS, Observation, observation_from_messages


@dataclass(frozen=True, eq=False)
class Step:
    """A step of an episode as edited: record has the relabelled instruction, and its number as recorded."""

    record: StepRecord
    path: Path
    setup: CaptureSetup

    def observation(self) -> Observation:
        """Read the observation before the step from the disk, at each call.

        Raises:
            ObservationError: when the step's file lacks a message of it, or has an unusable one.
        """
        return _observation(self.path, f"step {self.record.step} of episode '{self.path.parent.name}'", self.setup)


@dataclass(frozen=True, eq=False)
class Episode:
    """An episode as edited.

    success: None where nobody judged; steps: those that count; final: the scene after the last step, where it was
    recorded; complaints: a line for a person about each part that could not be used, and why.
    """

    path: Path
    name: str
    setup: CaptureSetup
    success: bool | None
    finished: bool
    steps: tuple[Step, ...]
    final: Observation | None
    complaints: tuple[str, ...]

    def step(self, number: int) -> Step:
        """Return the step of a number. Raises EpisodeError when there is none, or it was trimmed off."""
        found = next((step for step in self.steps if step.record.step == number), None)
        if found is None:
            numbers = ", ".join(str(step.record.step) for step in self.steps) or "none"
            raise EpisodeError(f"episode '{self.name}' has no step {number}: it has {numbers}")
        return found


@dataclass(frozen=True)
class StepsRead:
    """An episode's steps without its pictures; records: after trimming and relabelling."""

    edits: Edits
    records: tuple[StepRecord, ...]
    complaints: tuple[str, ...]


def read_episode(path: Path) -> Episode:
    """Read an episode's folder; torn files are read up to the tear.

    Raises:
        EpisodeError: when there is no such folder.
        DataSetError: when neither the episode nor its data set holds the setup of the recording.
    """
    read = read_steps(path)
    setup = read_own_setup(path) or read_setup(path.parent.parent)
    files = step_paths(path)
    steps = tuple(Step(record, files[record.step], setup) for record in read.records)
    final, complaint = _final(path, read.edits, files, setup)
    complaints = list(read.complaints)
    if complaint is not None:
        complaints.append(complaint)
    edits = read.edits
    return Episode(path, path.name, setup, edits.success, edits.finished, steps, final, tuple(complaints))


def read_steps(path: Path) -> StepsRead:
    """Read the records of an episode's steps, and no pictures. Raises EpisodeError when there is no such folder."""
    files = step_paths(path)
    edits, complaint = read_edits(path)
    complaints = [complaint] if complaint and files else []
    records = []
    for number, file in files.items():
        if not edits.keeps(number):
            continue
        try:
            record = read_record(file, complaints)
            instruction = edits.instructions.get(number, record.instruction)
            records.append(replace(record, step=number, instruction=instruction))
        except BagError as error:
            if file.exists():  # it may have been undone meanwhile
                complaints.append(f"step {number} is not used: {error}")
    return StepsRead(edits, tuple(records), tuple(complaints))


def read_record(file: Path, complaints: list[str] | None = None) -> StepRecord:
    """Read the record in a step's file, as it was recorded; complaints: takes a line about each part that is torn.

    Raises:
        BagError: when the file holds no usable record.
    """
    complain = (lambda _: None) if complaints is None else complaints.append
    messages = list(read_messages(file, {topics.DEMONSTRATION}, complain))
    if not messages:
        raise BagError(f"'{file.name}' holds no demonstration")
    return record_from_message(messages[-1])


def _final(
    path: Path, edits: Edits, files: dict[int, Path], setup: CaptureSetup
) -> tuple[Observation | None, str | None]:
    """Return the scene after the last step that counts, and a complaint where it cannot be read."""
    after = [file for number, file in files.items() if edits.last is not None and number > edits.last]
    file = after[0] if after else path / FINAL
    if not after and not (edits.finished and file.exists()):
        return None, None
    try:
        return _observation(file, f"'{file.name}'", setup), None
    except BagError as error:
        return None, f"the scene after the last step is not known: {error}"


def _observation(file: Path, where: str, setup: CaptureSetup) -> Observation:
    return observation_from_messages(read_messages(file, OBSERVATION_TOPICS), where, setup)
