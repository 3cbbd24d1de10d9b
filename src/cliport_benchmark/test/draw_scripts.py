"""Draws scripted_poses.json anew, which a wanted change of a task's scenes makes necessary:

    python src/cliport_benchmark/test/draw_scripts.py

It takes from the simulator what lies where and what is said; poses and scores are worked out by benchmark_by_hand.py.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from benchmark_by_hand import PALLET_BOXES, SCRIPTS, Goal, PoseGoal, Thing, goals_of, scores_of, things_in

from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS
from sim_bridge.world import SimWorld

Script = list[list[list[float]]]  # steps of moves: a thing's index, x, y, z [m], roll, pitch, yaw [rad]


def draw_script(goals: list[Goal], things: list[Thing], steps: int, rng: np.random.Generator) -> Script:
    """Draw poses near to where things belong, and away: all away first, then goals met in part, wholly and ahead of
    their turn."""
    present, script = 0, []
    for step in range(steps):
        goal, later = goals[present], goals[min(present + 1, len(goals) - 1)]
        if step == 0 and steps > 2:
            moves = [[i, 1.2, 0.0, 0.1, 0.0, 0.0, 0.0] for i in _things_of(goal)]
        elif step % 4 == 2 and later is not goal:
            moves = _near(later, things, rng, 0.0)  # fulfilled before its turn
        elif (step % 4 == 3 and later is not goal) or step == steps - 1:
            moves = _near(goal, things, rng, 0.0)
        else:
            moves = _near(goal, things, rng, float(rng.choice([0.4, 0.8, 3.0])))
        script.append([[round(value, 5) for value in move] for move in moves])
        for i, *pose in script[-1]:
            things[int(i)].pose = list(pose)
        if abs(goal.share * (1 - goal.value(things))) < 0.01:
            present += 1
            if present == len(goals):
                break
    return script


def _things_of(goal: Goal) -> list[int]:
    return list(goal.places) if isinstance(goal, PoseGoal) else goal.things


def _near(goal: Goal, things: list[Thing], rng: np.random.Generator, far: float) -> list[list[float]]:
    """Moves of some things of a goal to about where they belong, `far` in tolerances; of all, exactly, for 0."""
    scale = far * (goal.near if isinstance(goal, PoseGoal) else 0.01)
    moves = []
    for i in _things_of(goal):
        if scale and rng.random() > 0.7:
            continue
        if isinstance(goal, PoseGoal):
            x, y, yaw = goal.places[i][int(rng.integers(len(goal.places[i])))]
            height = 0.05
        else:
            zone = things[goal.zone]
            edge = 4.0 * scale + 0.1
            x, y, yaw = zone.at(*(rng.uniform(-edge, edge, 2) * goal.size) * (scale > 0.0), float(rng.uniform(-3, 3)))
            height = float(rng.choice([0.02, 0.05, 0.09, 0.31])) if scale else zone.pose[2]
        dx, dy = rng.normal(0.0, scale, 2)
        turn = math.radians(float(rng.normal(0.0, 10.0))) * (scale > 0.0)
        tilt = float(rng.choice([0.0, 0.4])) * (scale > 0.0)
        moves.append([i, x + dx, y + dy, height, tilt, 0.0, yaw + turn])
    return moves


def _draw_file() -> None:
    world, records = SimWorld(), {}
    for task in (*LANGUAGE_SPLITS, *DEMO_TASKS):
        tries = (_record(world, task, seed) for seed in range(7, 30))
        records[task] = next(record for record in tries if record is not None)
    rows = [f'  "{task}": {json.dumps(record)}' for task, record in records.items()]
    SCRIPTS.write_text("{\n" + ",\n".join(rows) + "\n}\n")


def _record(world: SimWorld, name: str, seed: int) -> dict[str, Any] | None:
    """A scene and its scripts; None for one with a single goal where there may be more."""
    task = reset_scene(world, name, "test", seed)
    assert isinstance(task, GoalTask)
    sentences = list(dict.fromkeys(goal.sentence for goal in task.goals))
    if task.name.endswith("objects-seq") and len(sentences) == 1:
        return None
    things = []
    for thing in task.objects:
        pose = world.planar_pose(thing)
        at = [pose.x, pose.y, float(world.object_pose(thing).translation[2]), 0.0, 0.0, pose.yaw]
        rows = (at, thing.mesh.vertices.min(axis=0), thing.mesh.vertices.max(axis=0))
        things.append([thing.name, thing.color, thing.fixed, *([round(float(v), 7) for v in row] for row in rows)])
    if task.name == "palletizing-boxes":
        things += [things[1]] * (PALLET_BOXES - 1)  # that have not come
    record: dict[str, Any] = {"seed": seed, "max_steps": task.max_steps, "sentences": sentences, "things": things}
    record["scripts"] = []
    rng = np.random.default_rng(11)
    for _ in range(3 if task.max_steps < 6 and "google" not in name else 1):
        goals = goals_of(task.name, sentences, things_in(record), task.max_steps)
        if task.name == "palletizing-boxes":
            script = _pallet_script(things_in(record), rng)
        else:
            script = draw_script(goals, things_in(record), min(task.max_steps, 12), rng)
        record["scripts"].append([script, scores_of(goals, things_in(record), script)])
    return record


def _pallet_script(things: list[Thing], rng: np.random.Generator) -> Script:
    """Each box goes onto the pallet, or half beside it, as it comes; then two leave it, one comes back."""
    pallet, script = things[0], []
    for i in range(1, PALLET_BOXES + 1):
        x, y, yaw = pallet.at(*rng.uniform(-0.16, 0.16, 2), float(rng.uniform(-3, 3)))
        script.append([[i, x, y, float(rng.choice([0.06, 0.2, 0.31])), 0.0, 0.0, yaw]])
    script.append([[1, 0.3, 0.39, 0.05, 0.0, 0.0, 0.0], [2, 0.3, 0.39, 0.12, 0.0, 0.0, 0.0]])
    script.append([[2, *pallet.pose]])
    return [[[round(value, 5) for value in move] for move in moves] for moves in script]


if __name__ == "__main__":
    _draw_file()
