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
from cliport_core import Pose
from cliport_perception.camera_file import CameraCalibration
from panda_executor.config import ExecutorConfig
from panda_executor.errors import ExecutorError, InverseKinematicsError
from panda_executor.ik import HandDownIk, IkSolution
from panda_executor.model import PandaModel
from panda_executor.motions import MotionBuilder
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model import FloatArray
from sim_bridge.rendering.mounting import load_camera
from sim_bridge.robot import ROBOT
from sim_bridge.world import SimWorld

LONG = 60.0  # of looking for a way that was not found, where everything is known [s]
LONGER = 20.0  # and in what the cameras saw [s]
DRAWN = 60  # configurations from which the long searches look for branches, too
APART = 0.05  # two branches differ by more in a joint at least [rad]
RISES = (-0.04, 0.04, 0.08, 0.13, 0.18, 0.28)  # of the way down beside the planner's usual height [m]
LEANS = (0.0, 0.2, 0.4, 0.6)  # of the hand above a pose [rad]
SEARCH = 5.0  # of these for one way between two configurations, at most [s]
ASIDE = Pose.looking_at((0.45, 0.95, 0.75), (0.45, 0.0, 0.0))  # of a second camera, in the base frame
CAMERAS = (1, 2)
Cloud = npt.NDArray[np.float32]


@dataclass
class Tried:
    """Planning in what one or two cameras saw: how it ended, how long it took, how near the plan comes to things.

    seconds: of the processor; seen: whether a long search finds a way in the same view, None where there is a plan or
    no way at all. thing_distance, table_distance: [m].
    """

    cameras: int
    refused: str = ""
    seconds: float = 0.0
    seen: bool | None = None
    seen_words: str = ""
    thing_distance: float | None = None
    table_distance: float | None = None
    touches: list[Touch] = field(default_factory=list)


@dataclass
class Record:
    """One scene: what stands there, and what came of it with each number of cameras.

    free_seconds: of planning without the things with one camera; None where that was not measured. exists: whether
    there is a way, by a plan or by a long search where everything is known.
    """

    seed: int
    things: list[str]
    tried: list[Tried] = field(default_factory=list)
    free_seconds: float | None = None
    exists: bool = True
    exists_words: str = ""


class ManyBranches(HandDownIk):
    """Solves from many drawn configurations: what exists is not to be judged by the planner's own few seeds."""

    def solve_all(self, target: Pose, reference: FloatArray, finely: bool = False) -> list[IkSolution]:
        """Return what is found from `DRAWN` seeds over the joints' whole ranges too, the cheapest first."""
        try:
            found = super().solve_all(target, reference, finely=True)
        except InverseKinematicsError:
            found = []
        limits = self._model.limits
        for seed in np.random.default_rng(0).uniform(limits.lower, limits.upper, (DRAWN, len(limits.lower))):
            positions = self.solve_near(target, seed, math.inf)
            if positions is not None and all(np.abs(positions - it.positions).max() > APART for it in found):
                found.append(IkSolution(positions, self.cost(positions, reference)))
        if not found:
            raise InverseKinematicsError(*target.translation.tolist(), 0.0, math.inf)
        return sorted(found, key=lambda solution: solution.cost)


class Bench:
    """World, cameras and planners, made once a process.

    The planners have the default settings, but time is that which the processor spent on them, and searches end by
    their number of checks: how busy the machine is hardly changes a result.
    """

    def __init__(self) -> None:
        self.world = SimWorld()
        ahead = load_camera()
        self.observers = [
            Observer(self.world.config, n_threads=1, whole_image=True, camera=camera)  # as in the graph
            for camera in (ahead, CameraCalibration(ahead.intrinsics, ASIDE))
        ]
        config = ExecutorConfig.for_arm(ROBOT)
        config = replace(config, search=replace(config.search, time_limit=math.inf))
        self.planners = {count: self._planner(config, count) for count in CAMERAS}
        self.patient = {count: self._long(config, LONG if count == 1 else LONGER, count) for count in CAMERAS}
        self.ik = self.planners[1].ik

    def places(self, count: int) -> list[FloatArray]:
        """Return where the first cameras stand, (3,) [m] each."""
        return [observer.camera.camera_in_base.translation for observer in self.observers[:count]]

    def _long(self, config: ExecutorConfig, seconds: float, cameras: int) -> TransferPlanner:
        """Return a planner that searches all round, from many branches and heights at many leans."""
        search = replace(config.search, max_checks=100_000, margin=2.0 * math.pi, time_limit=SEARCH)
        config = replace(config, search=search, planning_time=seconds, more_rise=RISES, lean=LEANS)
        planner = self._planner(config, cameras)
        planner.ik = ManyBranches(planner.model)
        planner.motions = MotionBuilder(planner.model, planner.ik, config)
        return planner

    def _planner(self, config: ExecutorConfig, cameras: int) -> TransferPlanner:
        planner = TransferPlanner(PandaModel(ROBOT), config, time.thread_time)
        planner.place_cameras(*self.places(cameras))
        return planner

    def clouds(self, seed: int) -> dict[int, Cloud]:
        """Return what one and what two cameras see, joined."""
        seen = []
        for number, observer in enumerate(self.observers):
            observer.new_scene(np.random.default_rng([seed, number] if number else seed))
            seen.append(observer.cloud(observer.frame(self.world)))
        return {count: np.concatenate(seen[:count]) for count in CAMERAS}

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
        scene = make_scene(self.world, self.ik, seed)
        record = Record(seed, [f"{thing.name} {thing.mesh.vertices[:, 2].max():.2f} m" for thing in scene.things])
        clouds = self.clouds(seed)
        record.tried = [self._tried(scene, count, clouds[count]) for count in CAMERAS]
        if all(tried.refused for tried in record.tried):
            known = true_cloud(self.world, self.world.config.workspace)
            record.exists, record.exists_words = self._found((self.planners[1], self.patient[1]), scene, known)
        for tried in record.tried:
            if tried.refused and record.exists:
                among = clouds[tried.cameras]
                tried.seen, tried.seen_words = self._found((self.patient[tried.cameras],), scene, among)
        if free:
            record.free_seconds = self.free_seconds(seed)
        return record

    def _tried(self, scene: ClutteredScene, cameras: int, cloud: Cloud) -> Tried:
        """Plan in a view, and measure the plan against the truth."""
        tried = Tried(cameras)
        planned, tried.seconds = self.plan(self.planners[cameras], scene, cloud)
        if isinstance(planned, str):
            tried.refused = planned
            return tried
        stood = self.world.object_pose(scene.block)
        truth = TrueGeometry(self.world, scene.block, self.places(cameras))
        tried.thing_distance, tried.table_distance, tried.touches = truth.check(planned)
        self.world.move_object(scene.block, stood)
        self.world.panda.reset_home()
        return tried

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
        scene = make_scene(self.world, self.ik, seed)
        without_things(self.world, scene)
        plan, seconds = self.plan(self.planners[1], scene, self.clouds(seed)[1])
        assert not isinstance(plan, str), f"without any things: {plan}"
        return seconds

    def blind_touches(self, seed: int) -> list[Touch]:
        """Return what a plan touches that knows of none of the things."""
        scene = make_scene(self.world, self.ik, seed)
        without_things(self.world, scene)
        plan, _ = self.plan(self.planners[1], scene, self.clouds(seed)[1])
        assert not isinstance(plan, str), f"without any things: {plan}"
        block = make_scene(self.world, self.ik, seed).block
        return TrueGeometry(self.world, block, self.places(1)).check(plan)[2]


@lru_cache(maxsize=1)
def bench() -> Bench:
    """Return the process's own."""
    return Bench()


def record_of(seed: int) -> dict[str, Any]:
    """Return one scene's record as plain values; in every fourth the free scene is planned in, too."""
    return asdict(bench().record(seed, seed % 4 == 0))


def summary_of(records: list[dict[str, Any]], cameras: int) -> dict[str, Any]:
    """Return counts, medians and extremes of many records; times in seconds of the processor, distances in m."""
    tried = [(record, it) for record in records for it in record["tried"] if it["cameras"] == cameras]
    planned = [it for _, it in tried if not it["refused"]]
    missed = [(record["seed"], it) for record, it in tried if it["refused"] and record["exists"]]
    seen = [seed for seed, it in missed if it["seen"]]
    free = [record["free_seconds"] for record in records if record["free_seconds"] is not None]
    words = Counter(re.sub(r"[-+]?\d+(\.\d+)?", "#", it["refused"]) for _, it in tried if it["refused"])
    distances = [it["thing_distance"] for it in planned]
    return {
        "cameras": cameras,
        "scenes": len(tried),
        "planned": len(planned),
        "refused": dict(words),
        "refused_where_a_way_exists": [seed for seed, _ in missed],
        "refused_where_a_way_is_seen": seen,
        "success": len(planned) / max(len(planned) + len(missed), 1),
        "success_in_what_is_seen": len(planned) / max(len(planned) + len(seen), 1),
        "touches": [{"seed": record["seed"], **touch} for record, it in tried for touch in it["touches"]],
        "median_seconds": median(it["seconds"] for it in planned),
        "longest_seconds": max(it["seconds"] for _, it in tried),
        "median_seconds_free_scene": median(free) if free else None,
        "median_distance_to_things": median(distances),
        "least_distance_to_things": min(distances),
        "least_distance_to_table": min(it["table_distance"] for it in planned),
    }
