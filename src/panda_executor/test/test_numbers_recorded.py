"""Grasps, releases, plans and verdicts on drawn scenes, as they were: a number that moves is a decision, not a slip.

numbers.json holds a row a scene. After a wanted change of how the arm grasps or moves write it anew:

    python src/panda_executor/test/test_numbers_recorded.py
"""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from synthetic_clouds import (
    CAMERA,
    Bowl,
    Cube,
    ball_points,
    bowl_points,
    container_points,
    cube_points,
    ring_points,
    seen_cloud,
)

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.config import ExecutorConfig, SearchConfig
from panda_executor.departure import depart_from
from panda_executor.drag import plan_drag
from panda_executor.errors import GraspError, InverseKinematicsError, PlanningError
from panda_executor.grasp import Grasp, plan_grasps
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose, tilted
from panda_executor.model import PandaModel
from panda_executor.motions import Motion
from panda_executor.placement import plan_placement
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

TABLE = Path(__file__).with_name("numbers.json")
PANDA = load_preset()
WORKSPACE = WorkspaceSpec()
PICK, PLACE = (0.45, 0.15), (0.5, -0.2)
ROWS = {"grasp": 25, "plan": 5, "drag": 2, "ik": 8, "verdict": 2}
NAMES = [f"{kind} {seed}" for kind, count in ROWS.items() for seed in range(count)]


@cache
def the_planner() -> TransferPlanner:
    """Return a planner whose searches end by their number of checks."""
    planner = TransferPlanner(PandaModel(), ExecutorConfig(search=SearchConfig(time_limit=60.0), planning_time=60.0))
    planner.place_cameras(CAMERA)
    return planner


def scene(seed: int) -> np.ndarray:
    """Return a cloud: something to hold at PICK, something to put it on at PLACE, neighbours of both."""
    rng = np.random.default_rng(seed)
    x, y = PICK
    size = tuple(rng.uniform((0.015, 0.02, 0.015), (0.06, 0.07, 0.06)))
    kinds = (
        cube_points(Cube(x, y, rng.uniform(0, 3), size)),
        bowl_points(Bowl(x, y)),
        ring_points(x, y, 0.0, rng.uniform(0.02, 0.035)),
        np.concatenate([ball_points(x + 0.016 * i, y, 0.0075) for i in range(-2, 3)]),
        np.concatenate([cube_points(Cube(x, y, 0.3, (0.04, 0.04, 0.04), z)) for z in (0.0, 0.04)]),
    )
    under = (
        cube_points(Cube(*PLACE, rng.uniform(0, 3))),
        bowl_points(Bowl(*PLACE)),
        container_points(*PLACE, 0.16, 0.13, rng.uniform(0, 1)),
        ring_points(*PLACE, 0.0, 0.01, hole=0.0, height=0.03),
        np.zeros((0, 3)),
    )
    things = [kinds[seed % 5], under[(seed // 5) % 5]]
    for at_x, at_y in (PICK, PLACE):
        far, turn = rng.uniform(0.045, 0.08), rng.uniform(-math.pi, math.pi)
        near = at_x + far * math.cos(turn), at_y + far * math.sin(turn)
        things.append(cube_points(Cube(*near, rng.uniform(0, 3), (0.025, 0.03, rng.uniform(0.015, 0.06)))))
    return seen_cloud(*things, seed=seed)


def action(seed: int, primitive: Primitive = Primitive.PICK_PLACE) -> PickPlaceAction:
    rng = np.random.default_rng(seed + 1000)
    dx, dy, yaw, turn = rng.uniform((-0.01, -0.01, -1.5, -1.5), (0.01, 0.01, 1.5, 1.5))
    x, y = PICK[0] + dx, PICK[1] + dy
    if seed % 5 == 1:  # a bowl is held by its rim
        x, y = x + 0.054 * math.cos(yaw), y + 0.054 * math.sin(yaw)
    return PickPlaceAction(PlanarPose(x, y, yaw), PlanarPose(*PLACE, turn), primitive)


def _grasp_row(grasp: Grasp, cloud: np.ndarray, place: PlanarPose) -> list[float]:
    held = grasp.held(0.4)
    rest = cloud[~grasp.covers(cloud, 0.01)]
    release = plan_placement(rest, place, place.yaw, grasp, WORKSPACE)
    lengths = [*grasp.centroid, grasp.tcp_z, grasp.opening, grasp.width, grasp.length, grasp.support_z, grasp.top_z]
    lengths += [grasp.spare, held.below, held.above, *held.cells.std(axis=0), release.tcp_z, release.opening]
    lengths += [release.support_z, release.fall]
    counts = [len(grasp.footprint), len(grasp.inner), len(cloud) - len(rest)]
    shape = HandShape(PANDA.hand, grasp.opening, held, 0.005)
    counts += [len(shape.points), len(shape.load)]
    corners = [*shape.points.min(axis=0), *shape.points.max(axis=0), *shape.points.mean(axis=0), shape.load_ball[1]]
    return [*(1000.0 * float(v) for v in (*lengths, *corners)), math.degrees(grasp.yaw), *map(float, counts)]


def _motion_row(motion: Motion) -> list[float]:
    way = motion.trajectory
    q, velocity, acceleration, _ = way.sample(np.linspace(0.0, way.duration, 5))
    numbers = [*q.ravel(), *velocity[2], *acceleration[1], *_departure(motion)]
    return [10.0 * way.duration, *np.degrees(numbers).tolist()]


def _departure(motion: Motion) -> list[float]:
    """Return the motion begun a little beside its start, in the middle of the way and at its end."""
    off = np.array([0.02, -0.01, 0.0, 0.015, -0.02, 0.01, 0.005])
    begun = depart_from(motion.trajectory, motion.trajectory.start + off, PANDA.limits.scaled(0.5, 0.5, 0.2), 0.05)
    q, velocity, _, _ = begun.sample(np.array([0.3, 0.7]) * begun.duration)
    return [*q.ravel(), *velocity.ravel(), *begun.velocities[-1]]


def measured(name: str) -> Any:
    """Return the words and numbers [mm, degrees, tenths of a second] of one row."""
    kind, number = name.split()
    row = {"grasp": _grasps, "plan": _plan, "drag": _drag, "ik": _ik, "verdict": _verdict}[kind]
    return row(int(number))


def _grasps(seed: int) -> Any:
    cloud, wanted = scene(seed), action(seed)
    try:
        return [_grasp_row(grasp, cloud, wanted.place) for grasp in plan_grasps(cloud, wanted.pick, WORKSPACE)]
    except GraspError as error:
        return str(error)


def _plan(seed: int) -> Any:
    try:
        plan = the_planner().plan(action(5 * seed), scene(5 * seed), WORKSPACE, PANDA.ready)
    except (PlanningError, GraspError) as error:
        return str(error)
    return {motion.phase.name: _motion_row(motion) for motion in plan.motions}


def _drag(seed: int) -> Any:
    primitive = Primitive.FOLD if seed % 2 else Primitive.SWEEP
    plan = plan_drag(the_planner(), action(seed, primitive), seen_cloud(), WORKSPACE, PANDA.ready)
    motions = (plan.go_above, plan.descend, plan.drag, plan.leave, plan.retreat)
    return [_motion_row(motion) for motion in motions]


def _ik(seed: int) -> Any:
    rng = np.random.default_rng(seed)
    x, y, z, yaw, lean = rng.uniform((0.2, -0.45, 0.0, -3.0, 0.0), (0.75, 0.45, 0.4, 3.0, 0.5))
    try:
        found = the_planner().ik.solve_all(tilted(hand_down_pose(x, y, z, yaw), lean), PANDA.ready)
    except InverseKinematicsError as error:
        return str(error)
    return [[*np.degrees(solution.positions).tolist(), 10.0 * solution.cost] for solution in found]


def _verdict(seed: int) -> Any:
    """Return how many of the arm's configurations near a table full of things have which problem."""
    planner, rng = the_planner(), np.random.default_rng(seed)
    cloud = np.concatenate([scene(seed), cube_points(Cube(0.4, -0.05, 0.5, (0.1, 0.1, 0.3)))]).astype(np.float32)
    grid = planner.grid(cloud, WORKSPACE, PANDA.ready)
    grasp = plan_grasps(seen_cloud(cube_points(Cube(*PICK))), PlanarPose(*PICK, 0.0), WORKSPACE)[0]
    hand = HandShape(PANDA.hand, grasp.opening, grasp.held() if seed % 2 else None)
    judge = planner.scene(grid, hand)
    said: dict[str, int] = {}
    for _ in range(200):
        x, y, z, yaw, lean = rng.uniform((0.25, -0.4, 0.0, -3.0, -0.3), (0.7, 0.4, 0.3, 3.0, 0.3))
        q, _left = planner.ik.refine(tilted(hand_down_pose(x, y, z, yaw), lean), PANDA.ready + rng.normal(0, 0.3, 7))
        words = (judge.problem(q) or "valid").split(" near ")[0]
        said[words] = said.get(words, 0) + 1
    columns = [float((grid.heights > 0).sum()), 1000.0 * float(grid.heights.clip(0.0).mean())]
    return [said, columns]


def _close(found: Any, kept: Any) -> bool:
    """Return True if words and counts are the same, and measures to a twentieth of a millimetre or a degree."""
    if isinstance(kept, dict):
        return found.keys() == kept.keys() and all(_close(found[key], kept[key]) for key in kept)
    if isinstance(kept, list):
        return len(found) == len(kept) and all(map(_close, found, kept))
    return abs(found - kept) < 0.05 if isinstance(kept, float) else bool(found == kept)


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_rounded(v) for v in value]
    return round(value, 2) if isinstance(value, float) else value


@pytest.mark.parametrize("name", NAMES)
def test_the_numbers_are_as_recorded(name: str) -> None:
    found, kept = measured(name), json.loads(TABLE.read_text())[name]
    assert _close(found, kept), f"{_rounded(found)} instead of {kept}"


if __name__ == "__main__":
    rows = [f'  "{name}": {json.dumps(_rounded(measured(name)))}' for name in NAMES]
    TABLE.write_text("{\n" + ",\n".join(rows) + "\n}\n")
