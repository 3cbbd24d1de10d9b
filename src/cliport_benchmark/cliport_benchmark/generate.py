"""Makes a data set of expert demonstrations, part by part, in parallel processes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, dataclass, field
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.episode_recorder import EpisodeNumber, record_episode
from cliport_benchmark.errors import DataFolderError, OptionError
from cliport_benchmark.json_files import differences, read_json, write_json
from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.observer import Observer
from cliport_benchmark.own_setup import OwnSetup
from cliport_benchmark.parallel import run_parallel
from cliport_benchmark.variation import Variation
from cliport_core import PickPlaceAction
from cliport_policy.data.dataset_format import (
    FORMAT_VERSION,
    HEIGHT_UNIT,
    META_NAME,
    Row,
    part_path,
    write_part,
)
from sim_bridge.errors import LayoutError, PhysicsError
from sim_bridge.rendering.sensor_noise import NoiseConfig
from sim_bridge.scene import Stream, reset_scene, scene_rng
from sim_bridge.tasks import Task, make_task
from sim_bridge.world import SimWorld


class Mode(Enum):
    """Execution of the expert's actions."""

    FAST = "fast"  # things are set where they belong, physics settles
    PHYSICS = "physics"  # the arm does it


@dataclass(frozen=True)
class GenerateConfig:
    """Settings of a data set; the same values make the same bytes.

    mistakes: share of the expert's actions before which something is done wrong, which the expert puts right.

    Raises:
        OptionError: on numbers that make no data set, several goals for a task whose scenes have one, or mistakes in a
            task that knows none.
        UnknownNameError: on an unknown task or split.
    """

    task: str
    split: str
    first_seed: int
    episodes: int
    goals_per_scene: int = 1
    mode: Mode = Mode.FAST
    variation: Variation = field(default_factory=Variation)
    setup: OwnSetup = field(default_factory=OwnSetup)
    mistakes: float = 0.0
    episodes_per_part: int = 50

    def __post_init__(self) -> None:
        task = make_task(self.task, self.split)
        if self.goals_per_scene > 1 and not task.several_goals:
            raise OptionError(f"--goals-per-scene must be 1 for {task.name}, which has one goal a scene")
        if not 0 <= self.mistakes <= 1:
            raise OptionError(f"--mistakes must be in 0..1, got {self.mistakes}")
        if self.mistakes and not task.knows_mistakes:
            raise OptionError(f"--mistakes must be 0 for {task.name}, whose expert makes none")
        for name, value, least in (
            ("--first-seed", self.first_seed, 0),
            ("--episodes", self.episodes, 1),
            ("--goals-per-scene", self.goals_per_scene, 1),
        ):
            if value < least:
                raise OptionError(f"{name} must be {least} or more, got {value}")

    @property
    def n_parts(self) -> int:
        """Number of files."""
        return -(-self.episodes // self.episodes_per_part)

    def episodes_of(self, part: int) -> range:
        """Return the episode numbers in a part."""
        first = part * self.episodes_per_part
        return range(first, min(first + self.episodes_per_part, self.episodes))

    def settings(self) -> dict[str, Any]:
        """Return the settings in which a folder must agree to be continued.

        Raises:
            ObjectFolderError: when the task's objects cannot be used.
        """
        return {
            "version": FORMAT_VERSION,
            "task": self.task,
            "split": self.split,
            "object_set": make_task(self.task, self.split).object_source,
            "first_seed": self.first_seed,
            "episodes": self.episodes,
            "episodes_per_part": self.episodes_per_part,
            "goals_per_scene": self.goals_per_scene,
            "mode": self.mode.value,
            "mistakes": self.mistakes or None,
            "randomize": self.variation.settings() or False,
            "height_unit": HEIGHT_UNIT,
            **self.setup.settings(),
            "noise": asdict(NoiseConfig.of_kind(self.setup.camera_kind)),
        }


@dataclass(frozen=True)
class PartReport:
    """Outcome of one part."""

    index: int
    episodes: int
    observations: int
    discarded: int


def generate(
    config: GenerateConfig,
    folder: Path,
    processes: int,
    provenance: dict[str, Any],
    on_part: Callable[[PartReport, int], None],
    first_parts: int | None = None,
) -> None:
    """Make the parts that the folder still lacks; on_part(report, parts left) hears of each.

    first_parts: only so many from the first on, None for all.

    Raises:
        DataFolderError: when the folder holds other data or cannot be written.
        OptionError: when the workspace has no room for the task.
    """
    config.setup.check_room(config.task, config.split, config.first_seed)
    _open_folder(config, folder, provenance)
    wanted = config.n_parts if first_parts is None else min(first_parts, config.n_parts)
    missing = [i for i in range(wanted) if not part_path(folder, i).exists()]
    if not missing:
        return
    work = run_parallel(partial(make_part, config, folder), missing, processes, _set_up)
    with closing(work) as results:
        for done, (_, report) in enumerate(results, start=1):
            on_part(report, len(missing) - done)


def _set_up() -> None:
    cv2.setNumThreads(1)


def make_part(config: GenerateConfig, folder: Path, index: int) -> PartReport:
    """Make one part in this process."""
    world = SimWorld(config.setup.sim_config())
    setup, variation = config.setup, config.variation
    observer = Observer(
        world.config, n_threads=1, variation=variation, camera=setup.camera, camera_kind=setup.camera_kind
    )
    arm = ArmHand(world, observer) if config.mode is Mode.PHYSICS else None
    rows: list[Row] = []
    discarded = 0
    try:
        for episode in config.episodes_of(index):
            recorded = _make_episode(config, world, observer, arm, episode)
            rows += recorded or []
            discarded += recorded is None
    finally:
        world.close()
    write_part(part_path(folder, index), rows)
    return PartReport(index, len(config.episodes_of(index)), len(rows), discarded)


def _make_episode(
    config: GenerateConfig, world: SimWorld, observer: Observer, arm: ArmHand | None, episode: int
) -> list[Row] | None:
    seed = config.first_seed + episode
    try:
        task = reset_scene(world, config.task, config.split, seed)
        config.variation.add_to(world, task, seed)
        streams = (Stream.NOISE, Stream.HAND, Stream.GOALS, Stream.MISTAKES)
        noise, hands, goals, mistakes = (scene_rng(task.name, task.split, seed, s) for s in streams)
        observer.new_scene(noise)
        if arm is not None:
            arm.new_scene(task.primitive)
        hand = arm or KinematicHand(world, hands)
        mistake = partial(_mistake, task, config.mistakes, mistakes)
        number = EpisodeNumber(episode, seed)
        return record_episode(world, task, observer, hand, goals, config.goals_per_scene, number, mistake)
    except (LayoutError, PhysicsError):
        return None


def _mistake(task: Task, share: float, rng: np.random.Generator) -> PickPlaceAction | None:
    return task.mistake(rng) if rng.random() < share else None


def _open_folder(config: GenerateConfig, folder: Path, provenance: dict[str, Any]) -> None:
    """Make the folder, or check that it was begun with the same settings."""
    meta = folder / META_NAME
    if meta.exists():
        found, wanted = read_json(meta), config.settings()
        differing = differences({name: found.get(name) for name in wanted}, wanted)
        if differing:
            raise DataFolderError(f"{folder} holds data of other settings ({differing}); choose another --out")
        for leftover in folder.glob(".part-*.tmp"):
            leftover.unlink(missing_ok=True)
        return
    if folder.is_dir() and any(folder.iterdir()):
        raise DataFolderError(f"{folder} is not empty and has no {META_NAME}; choose another --out")
    stepwise = make_task(config.task, config.split).stepwise
    write_json(meta, config.settings() | {"stepwise": stepwise} | provenance)
