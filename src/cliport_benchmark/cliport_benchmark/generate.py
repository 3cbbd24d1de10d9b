"""Makes a data set of expert demonstrations, part by part, in parallel processes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, dataclass
from enum import Enum
from functools import partial
from pathlib import Path
from typing import Any

import cv2

from cliport_benchmark.arm_hand import ArmHand
from cliport_benchmark.dataset_format import (
    FORMAT_VERSION,
    META_NAME,
    Row,
    part_path,
    read_json,
    write_json,
    write_part,
)
from cliport_benchmark.episode_recorder import record_episode
from cliport_benchmark.errors import DataFolderError, OptionError
from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.observer import Observer
from cliport_benchmark.parallel import run_parallel
from sim_bridge.camera import CameraConfig
from sim_bridge.errors import LayoutError
from sim_bridge.tasks import PutBlocksInBowls, make_task
from sim_bridge.world import SimConfig, SimWorld, scene_rng

EPISODES_PER_PART = 50
_NOISE_STREAM, _HAND_STREAM, _GOAL_STREAM = 1, 2, 3  # of scene_rng


class Mode(Enum):
    """How the expert's actions are carried out."""

    FAST = "fast"  # blocks are set into bowls, physics settles
    PHYSICS = "physics"  # the arm does it


@dataclass(frozen=True)
class GenerateConfig:
    """What to make; the same values make the same bytes.

    Raises:
        OptionError: on numbers that make no data set.
        UnknownNameError: on an unknown task or split.
    """

    task: str
    split: str
    first_seed: int
    episodes: int
    goals_per_scene: int = 1
    mode: Mode = Mode.FAST
    randomize: bool = False

    def __post_init__(self) -> None:
        make_task(self.task, self.split)
        for name, value, least in (
            ("--first-seed", self.first_seed, 0),
            ("--episodes", self.episodes, 1),
            ("--goals-per-scene", self.goals_per_scene, 1),
        ):
            if value < least:
                raise OptionError(f"{name} must be {least} or more, got {value}")

    @property
    def n_parts(self) -> int:
        """How many files."""
        return -(-self.episodes // EPISODES_PER_PART)

    def episodes_of(self, part: int) -> range:
        """The episode numbers in a part."""
        first = part * EPISODES_PER_PART
        return range(first, min(first + EPISODES_PER_PART, self.episodes))

    def settings(self) -> dict[str, Any]:
        """What a folder must agree in to be continued."""
        camera = CameraConfig()
        intrinsics = camera.intrinsics
        return {
            "version": FORMAT_VERSION,
            "task": self.task,
            "split": self.split,
            "first_seed": self.first_seed,
            "episodes": self.episodes,
            "episodes_per_part": EPISODES_PER_PART,
            "goals_per_scene": self.goals_per_scene,
            "mode": self.mode.value,
            "randomize": self.randomize,
            "workspace": SimConfig().workspace.to_dict(),
            "camera": {
                "width": intrinsics.width,
                "height": intrinsics.height,
                "fx": intrinsics.fx,
                "fy": intrinsics.fy,
                "cx": intrinsics.cx,
                "cy": intrinsics.cy,
                "camera_in_base_xyz": camera.camera_in_base.translation.tolist(),
                "camera_in_base_xyzw": camera.camera_in_base.as_quaternion_xyzw().tolist(),
            },
            "noise": asdict(camera.noise),
        }


@dataclass(frozen=True)
class PartReport:
    """What came of one part."""

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
) -> None:
    """Make the parts that the folder still lacks; on_part(report, parts left) hears of each.

    Raises:
        DataFolderError: when the folder holds other data or cannot be written.
    """
    _open_folder(config, folder, provenance)
    missing = [i for i in range(config.n_parts) if not part_path(folder, i).exists()]
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
    world = SimWorld()
    observer = Observer(world.config, n_threads=1, randomize=config.randomize)
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
        task = world.reset(config.task, config.split, seed)
    except LayoutError:
        return None
    if not isinstance(task, PutBlocksInBowls):
        raise OptionError(f"task {config.task} has no data generation")
    streams = [scene_rng(task.name, task.split, seed, s) for s in (_NOISE_STREAM, _HAND_STREAM, _GOAL_STREAM)]
    observer.new_scene(streams[0])
    if arm is not None:
        arm.new_scene()
    hand = arm or KinematicHand(world, streams[1])
    return record_episode(world, task, observer, hand.pick_and_place, streams[2], config.goals_per_scene, episode, seed)


def _open_folder(config: GenerateConfig, folder: Path, provenance: dict[str, Any]) -> None:
    """Make the folder, or check that it was begun with the same settings."""
    meta = folder / META_NAME
    if meta.exists():
        found, wanted = read_json(meta), config.settings()
        differing = [key for key, value in wanted.items() if found.get(key) != value]
        if differing:
            what = ", ".join(f"{k} {_short(found.get(k))} not {_short(wanted[k])}" for k in differing)
            raise DataFolderError(f"{folder} holds data of other settings ({what}); choose another --out")
        for leftover in folder.glob(".part-*.tmp"):
            leftover.unlink(missing_ok=True)
        return
    if folder.is_dir() and any(folder.iterdir()):
        raise DataFolderError(f"{folder} is not empty and has no {META_NAME}; choose another --out")
    write_json(meta, config.settings() | provenance)


def _short(value: object) -> str:
    text = str(value)
    return text if len(text) <= 40 else text[:37] + "..."
