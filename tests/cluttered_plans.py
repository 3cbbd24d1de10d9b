"""One cluttered scene after the other: seen, planned in, checked against the truth, and a look for what was missed."""

from __future__ import annotations

import math
import re
import time
from collections import Counter
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt
from cluttered_scene import ClutteredScene, make_scene, without_things
from true_geometry import Touch, TrueGeometry, true_cloud

from cliport_benchmark.observer import Observer
from panda_executor.config import ExecutorConfig
from panda_executor.errors import ExecutorError
from panda_executor.model import PandaModel
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from sim_bridge.robot import ROBOT
from sim_bridge.world import SimWorld

LONG = 60.0  # of looking for a way that was not found, where everything is known [s]
LONGER = 20.0  # and in what the camera saw [s]
Cloud = npt.NDArray[np.float32]


@dataclass
class Record:
    """One scene: what stands there, how planning ended and how long it took, and how near the plan comes to things.

    seconds: of the processor; None where that was not measured. exists: whether a long search finds a way where
    everything is known; seen: whether it finds one in what the camera saw; None where there is a plan. thing_distance,
    table_distance: [m].
    """

    seed: int
    things: list[str]
    refused: str = ""
    seconds: float = 0.0
    free_seconds: float | None = None
    exists: bool | None = None
    exists_words: str = ""
    seen: bool | None = None
    seen_words: str = ""
    thing_distance: float | None = None
    table_distance: float | None = None
    touches: list[Touch] = field(default_factory=list)


class Bench:
    """World, camera and planners, made once a process.

    The planner has the default settings, but time is that which the processor spent on it, and searches end by their
    number of checks: how busy the machine is hardly changes a result.
    """

    def __init__(self) -> None:
        self.world = SimWorld()
        self.observer = Observer(self.world.config, n_threads=1, whole_image=True)  # as in the graph
        config = ExecutorConfig.for_arm(ROBOT)
        config = replace(config, search=replace(config.search, time_limit=math.inf))
        self.planner = self._planner(config)
        self.patient, self.less_patient = self._long(config, LONG), self._long(config, LONGER)

    def _long(self, config: ExecutorConfig, seconds: float) -> TransferPlanner:
        """Return a planner that searches all round, each way for a quarter of the time at most."""
        search = replace(config.search, max_checks=1_000_000, margin=2.0 * math.pi, time_limit=seconds / 4)
        return self._planner(replace(config, search=search, planning_time=seconds))

    def _planner(self, config: ExecutorConfig) -> TransferPlanner:
        planner = TransferPlanner(PandaModel(ROBOT), config, time.thread_time)
        planner.place_camera(self.observer.camera.camera_in_base.translation)
        return planner

    def cloud(self, seed: int) -> Cloud:
        self.observer.new_scene(np.random.default_rng(seed))
        return self.observer.cloud(self.observer.frame(self.world))

    def plan(self, planner: TransferPlanner, scene: ClutteredScene, cloud: Cloud) -> tuple[PickPlacePlan | str, float]:
        """Return the plan or why there is none, and the seconds that it took."""
        began = time.thread_time()
        try:
            plan: PickPlacePlan | str = planner.plan(scene.action, cloud, self.world.config.workspace, planner.ready)
        except ExecutorError as error:
            plan = str(error)
        return plan, time.thread_time() - began

    def record(self, seed: int, free: bool) -> Record:
        """Do one scene; free: plan without the things, too."""
        scene = make_scene(self.world, self.planner.ik, seed)
        record = Record(seed, [f"{thing.name} {thing.mesh.vertices[:, 2].max():.2f} m" for thing in scene.things])
        cloud = self.cloud(seed)
        planned, record.seconds = self.plan(self.planner, scene, cloud)
        if isinstance(planned, str):
            record.refused = planned
            known = true_cloud(self.world, self.world.config.workspace)
            record.exists, record.exists_words = self._found((self.planner, self.patient), scene, known)
            if record.exists:
                record.seen, record.seen_words = self._found((self.less_patient,), scene, cloud)
        else:
            truth = TrueGeometry(self.world, scene.block)
            record.thing_distance, record.table_distance, record.touches = truth.check(planned)
        if free:
            record.free_seconds = self.free_seconds(seed)
        return record

    def _found(self, planners: tuple[TransferPlanner, ...], scene: ClutteredScene, cloud: Cloud) -> tuple[bool, str]:
        """Return whether one of the planners, asked in turn, finds a way, and why the last does not."""
        words = ""
        for planner in planners:
            found, _ = self.plan(planner, scene, cloud)
            if not isinstance(found, str):
                return True, ""
            words = found
        return False, words

    def free_seconds(self, seed: int) -> float:
        scene = make_scene(self.world, self.planner.ik, seed)
        without_things(self.world, scene)
        plan, seconds = self.plan(self.planner, scene, self.cloud(seed))
        assert not isinstance(plan, str), f"without any things: {plan}"
        return seconds

    def blind_touches(self, seed: int) -> list[Touch]:
        """Return what a plan touches that knows of none of the things."""
        scene = make_scene(self.world, self.planner.ik, seed)
        without_things(self.world, scene)
        plan, _ = self.plan(self.planner, scene, self.cloud(seed))
        assert not isinstance(plan, str), f"without any things: {plan}"
        return TrueGeometry(self.world, make_scene(self.world, self.planner.ik, seed).block).check(plan)[2]


@lru_cache(maxsize=1)
def bench() -> Bench:
    """Return the process's own."""
    return Bench()


def record_of(seed: int) -> dict[str, Any]:
    """Return one scene's record as plain values; in every fourth the free scene is planned in, too."""
    return asdict(bench().record(seed, seed % 4 == 0))


def summary_of(records: list[dict[str, Any]]) -> dict[str, Any]:
    """Return counts, medians and extremes of many records; times in seconds of the processor, distances in m."""
    planned = [record for record in records if not record["refused"]]
    missed = [record for record in records if record["exists"]]
    seen = [record for record in missed if record["seen"]]
    distances = [record["thing_distance"] for record in planned]
    free = [record["free_seconds"] for record in records if record["free_seconds"] is not None]
    words = Counter(re.sub(r"[-+]?\d+(\.\d+)?", "#", record["refused"]) for record in records if record["refused"])
    return {
        "scenes": len(records),
        "planned": len(planned),
        "refused": dict(words),
        "refused_where_a_way_exists": [record["seed"] for record in missed],
        "refused_where_a_way_is_seen": [record["seed"] for record in seen],
        "success": len(planned) / max(len(planned) + len(missed), 1),
        "success_in_what_is_seen": len(planned) / max(len(planned) + len(seen), 1),
        "touches": [{"seed": record["seed"], **touch} for record in planned for touch in record["touches"]],
        "median_seconds": median(record["seconds"] for record in planned),
        "longest_seconds": max(record["seconds"] for record in records),
        "median_seconds_free_scene": median(free),
        "median_distance_to_things": median(distances),
        "least_distance_to_things": min(distances),
        "least_distance_to_table": min(record["table_distance"] for record in planned),
    }
