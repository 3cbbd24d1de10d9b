"""The expert's demonstrations in full physics, as episodes that look like a person's (one bag each)."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from pathlib import Path

from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.camera_messages import BASE_FRAME, observation_messages
from cliport_benchmark.errors import OptionError
from cliport_benchmark.observer import Observer
from cliport_benchmark.own_setup import OwnSetup
from cliport_benchmark.variation import Variation
from cliport_core import ActionResult, PickPlaceAction, WorkspaceSpec
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import Source, StepRecord
from cliport_episodes.raw import RawMessage
from cliport_episodes.writer import EpisodeWriter
from sim_bridge.errors import LayoutError, PhysicsError
from sim_bridge.rendering.camera import OPTICAL_FRAME, RgbdFrame
from sim_bridge.rendering.sensor_noise import SensorKind
from sim_bridge.scene import Stream, reset_scene, scene_rng
from sim_bridge.tasks import Task, make_task
from sim_bridge.world import SimWorld


@dataclass(frozen=True)
class RecordConfig:
    """Settings of demonstrations. sentences: what is asked for, scene by scene and over again; empty: the task's own.

    Raises:
        OptionError: on numbers that make no episode.
        UnknownNameError, GoalError: on an unknown task or split, or a sentence that the task makes no scene for.
    """

    task: str
    split: str
    first_seed: int
    episodes: int
    sentences: tuple[str, ...] = ()
    setup: OwnSetup = field(default_factory=OwnSetup)
    variation: Variation = field(default_factory=Variation)

    def __post_init__(self) -> None:
        for sentence in self.sentences or ("",):
            make_task(self.task, self.split, sentence)
        for name, value, least in (("--first-seed", self.first_seed, 0), ("--episodes", self.episodes, 1)):
            if value < least:
                raise OptionError(f"{name} must be {least} or more, got {value}")

    def sentence(self, index: int) -> str:
        """Return the sentence for which the scene of an episode is made; "" leaves it to the task."""
        return self.sentences[index % len(self.sentences)] if self.sentences else ""

    def name(self, index: int) -> str:
        """Return the name of an episode's bag: task, split and seed, the digest of a given sentence, and what varied,
        with a digest of how much where that is not the usual; and the kind of camera where it is not the plain one."""
        sentence = self.sentence(index)
        asked = f"-{_digest(sentence)}" if sentence else ""
        settings = self.variation.settings()
        varied = "".join(f"-{name}" for name in settings)
        if settings != Variation(self.variation.aspects).settings():
            varied += f"-{_digest(json.dumps(settings))}"
        kind = self.setup.camera_kind
        seen = "" if kind is SensorKind.PLAIN else f"-{kind.value}"
        return f"{self.task}-{self.split}-{self.first_seed + index:06d}{asked}{varied}{seen}"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:8]


class Result(Enum):
    """Outcome of a demonstration."""

    SUCCEEDED = "succeeded"
    FAILED = "failed"  # recorded, and marked so
    DISCARDED = "discarded"  # there was nothing to see: no scene, or physics went wrong


@dataclass(frozen=True)
class Recorded:
    """One episode; name: of its bag, "" where there is none."""

    result: Result
    name: str
    steps: int
    sentence: str


class ExpertRecorder:
    """One world, whose expert demonstrates into one data set.

    Raises:
        EpisodesError: when the data set is of another camera or workspace, or cannot be written.
        OptionError: when the task does not fit into the workspace.
    """

    def __init__(self, config: RecordConfig, data_set: Path, now_ns: Callable[[], int]) -> None:
        """Open world and data set; now_ns: the time that an episode's stamps begin with."""
        self._config = config
        self._now_ns = now_ns
        config.setup.check_room(config.task, config.split, config.first_seed)
        self._world = SimWorld(config.setup.sim_config())
        self._observer = Observer(
            self._world.config,
            variation=config.variation,
            whole_image=True,
            camera=config.setup.camera,
            camera_kind=config.setup.camera_kind,
        )
        self._hand = ArmHand(self._world, self._observer)
        self._setup = self._capture_setup(self._world.config.workspace)
        self._data_set = DataSet.open_or_create(data_set, self._setup)

    def close(self) -> None:
        """Give the world back."""
        self._world.close()

    def missing(self) -> list[int]:
        """Return the episodes that the data set lacks; what is left of interrupted ones goes into its trash."""
        finished = {info.name: info.finished for info in self._data_set.episodes()}
        names = [self._config.name(index) for index in range(self._config.episodes)]
        for name in names:
            if not finished.get(name, True):
                self._data_set.delete(name)
        return [index for index, name in enumerate(names) if not finished.get(name)]

    def record(self, index: int) -> Recorded:
        """Record the scene of an episode; when that is interrupted, what there is goes into the trash."""
        config, seed = self._config, self._config.first_seed + index
        try:
            task = reset_scene(self._world, config.task, config.split, seed, config.sentence(index))
            config.variation.add_to(self._world, task, seed)
        except (LayoutError, PhysicsError):
            return Recorded(Result.DISCARDED, "", 0, config.sentence(index))
        self._observer.new_scene(scene_rng(task.name, task.split, seed, Stream.NOISE))
        self._hand.new_scene(task.primitive)
        self._stamps_from = self._now_ns() - round(1e9 * self._world.time)
        writer = EpisodeWriter.create(self._data_set.path, self._setup, config.name(index))
        try:
            said = self._demonstrate(task, writer)
            if not writer.n_steps:
                writer.discard()
                return Recorded(Result.DISCARDED, "", 0, said)
            success = task.done()
            writer.finish(self._messages(self._observer.frame(self._world)), success)
        except PhysicsError:
            writer.discard()
            return Recorded(Result.DISCARDED, "", 0, config.sentence(index))
        except BaseException:
            writer.discard()
            raise
        return Recorded(Result.SUCCEEDED if success else Result.FAILED, writer.name, writer.n_steps, said)

    def _demonstrate(self, task: Task, writer: EpisodeWriter) -> str:
        """Record every step until the task is done or nothing more can be shown; return what was said last."""
        said = ""
        for step in range(task.max_steps):
            action = None if task.done() else task.expert_action()
            if action is None:
                break
            said = task.instruction
            frame = self._observer.frame(self._world)
            messages = self._messages(frame)
            result = self._hand.execute(action, frame)
            task.advance()
            writer.add_step(messages, self._record(step, said, action, result, self._stamp_ns(frame)))
        return said

    def _messages(self, frame: RgbdFrame) -> list[RawMessage]:
        camera, state = self._observer.camera, self._world.panda.state()
        return observation_messages(frame, camera.intrinsics, camera.camera_in_base, state, self._stamp_ns(frame))

    def _stamp_ns(self, frame: RgbdFrame) -> int:
        return self._stamps_from + round(1e9 * frame.time)

    def _record(self, step: int, said: str, action: PickPlaceAction, result: ActionResult, stamp_ns: int) -> StepRecord:
        workspace = self._observer.workspace
        width = result.gripper_width if math.isfinite(result.gripper_width) else 0.0
        return StepRecord(
            step=step,
            stamp_ns=stamp_ns,
            frame_id=BASE_FRAME,
            instruction=said,
            source=Source.EXPERT,
            pick_box=None,
            place_box=None,
            pick_rotation=workspace.bin_of_yaw(action.pick.yaw),
            place_rotation=workspace.bin_of_yaw(action.place.yaw),
            n_rotations=workspace.n_rotations,
            action=PickPlaceAction(action.pick, action.place, action.primitive),
            result=replace(result, gripper_width=width),
        )

    def _capture_setup(self, workspace: WorkspaceSpec) -> CaptureSetup:
        camera = self._observer.camera
        return CaptureSetup(workspace, camera.intrinsics, OPTICAL_FRAME, BASE_FRAME, camera.camera_in_base)
