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

LONG = 60.0  # of looking for a way that was not found [s]
Cloud = npt.NDArray[np.float32]


@dataclass
class Record:
    """One scene: what stands there, how planning ended and how long it took, and how near the plan comes to things.

    seconds: of the processor; None in a scene in which it was not measured. exists: whether there is a way, of a
    refused scene. thing_distance, table_distance: [m].
    """

    seed: int
    things: list[str]
    refused: str = ""
    seconds: float = 0.0
    free_seconds: float | None = None
    exists: bool | None = None
    exists_words: str = ""
    thing_distance: float | None = None
    table_distance: float | None = None
    touches: list[Touch] = field(default_factory=list)


class Bench:
    """World, camera and planners, made once a process.

    The planner has the default settings, but time is that which the processor spent on it, and searches end by their
    number of checks: how busy the machine is does not change a result.
    """

    def __init__(self) -> None:
        self.world = SimWorld()
        self.observer = Observer(self.world.config, n_threads=1, whole_image=True)  # as in the graph
        config = ExecutorConfig.for_arm(ROBOT)
        config = replace(config, search=replace(config.search, time_limit=math.inf))
        self.planner = self._planner(config)
        wide = replace(config.search, max_checks=1_000_000, time_limit=LONG / 2, margin=2.0 * math.pi)
        self.patient = self._planner(replace(config, search=wide, planning_time=LONG))

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
        planned, record.seconds = self.plan(self.planner, scene, self.cloud(seed))
        if isinstance(planned, str):
            record.refused = planned
            found, _ = self.plan(self.patient, scene, true_cloud(self.world, self.world.config.workspace))
            record.exists, record.exists_words = not isinstance(found, str), found if isinstance(found, str) else ""
        else:
            truth = TrueGeometry(self.world, scene.block)
            record.thing_distance, record.table_distance, record.touches = truth.check(planned)
        if free:
            record.free_seconds = self.free_seconds(seed)
        return record

    def free_seconds(self, seed: int) -> float:
        scene = make_scene(self.world, self.planner.ik, seed)
        without_things(self.world, scene)
        plan, seconds = self.plan(self.planner, scene, self.cloud(seed))
        assert not isinstance(plan, str), f"without any things: {plan}"
        return seconds


@lru_cache(maxsize=1)
def _bench() -> Bench:
    return Bench()


def record_of(seed: int) -> dict[str, Any]:
    """Return one scene's record as plain values; in every fourth the free scene is planned in, too."""
    return asdict(_bench().record(seed, seed % 4 == 0))


def summary_of(records: list[dict[str, Any]]) -> dict[str, Any]:
    """Return counts, medians and extremes of many records; times in seconds of the processor, distances in m."""
    planned = [record for record in records if not record["refused"]]
    missed = [record for record in records if record["exists"]]
    distances = [record["thing_distance"] for record in planned]
    free = [record["free_seconds"] for record in records if record["free_seconds"] is not None]
    words = Counter(re.sub(r"[-+]?\d+(\.\d+)?", "#", record["refused"]) for record in records if record["refused"])
    return {
        "scenes": len(records),
        "planned": len(planned),
        "refused": dict(words),
        "refused_where_a_way_exists": [record["seed"] for record in missed],
        "success": len(planned) / max(len(planned) + len(missed), 1),
        "touches": [{"seed": record["seed"], **touch} for record in planned for touch in record["touches"]],
        "median_seconds": median(record["seconds"] for record in planned),
        "longest_seconds": max(record["seconds"] for record in records),
        "median_seconds_free_scene": median(free),
        "median_distance_to_things": median(distances),
        "least_distance_to_things": min(distances),
        "least_distance_to_table": min(record["table_distance"] for record in planned),
    }
