"""Scenes of the tasks: what is drawn from a seed, and what the expert does first.

scenes.json holds a row a task; results and data sets of other versions can be compared as long as it stays. After a
wanted change of a task write it anew:

    python src/sim_bridge/test/test_layouts.py
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.goal import PoseMetric, ZoneMetric
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS
from sim_bridge.world import SimWorld

TABLE = Path(__file__).with_name("scenes.json")
LIKE_OTHERS = (  # and take longest
    "packing-seen-google-objects-seq",
    "packing-unseen-google-objects-seq",
    "packing-seen-google-objects-group",
    "manipulating-rope",
    "separating-piles-unseen-colors",
)
TASKS = [name for name in (*LANGUAGE_SPLITS, *DEMO_TASKS) if name not in LIKE_OTHERS]
SEED = 5


def measured(world: SimWorld, name: str) -> dict[str, Any]:
    """Return a scene in words and numbers [mm, degrees]; small things by their number, middle and spread."""
    task = reset_scene(world, name, "val", SEED)
    assert isinstance(task, GoalTask)
    places: dict[str, list[list[float]]] = {}
    for thing in world.objects:
        at = 1000.0 * world.object_pose(thing).translation
        kind = f"{thing.described}{' (fixed)' if thing.fixed else ''}"
        places.setdefault(kind, []).append([*at.tolist(), math.degrees(abs(math.sin(2 * world.object_yaw(thing))))])
    rows = {
        kind: found if len(found) < 6 else [np.mean(found, axis=0).tolist(), np.std(found, axis=0).tolist()]
        for kind, found in places.items()
    }
    action = task.expert_action()
    assert action is not None
    poses = [v for p in (action.pick, action.place) for v in (1000.0 * p.x, 1000.0 * p.y, *_turn(p.yaw))]
    return {
        "instruction": task.instruction,
        "counts": [task.max_steps, len(world.objects), len(task.goals), len(task.goals_in_scene())],
        "flags": [task.stepwise, task.several_goals, task.primitive.label, task.done()],
        "slots": dict(task.sentence_slots),
        "things": {kind: [[round(v, 1) for v in row] for row in found] for kind, found in rows.items()},
        "goals": [_goal(goal) for goal in task.goals],
        "action": [round(v, 1) for v in poses],
        "score": f"{task.score():.3f}",
    }


def _turn(yaw: float) -> tuple[float, float]:
    """Return an angle that turns by half a turn leave as it is, in numbers without a jump."""
    return 30.0 * math.cos(2 * yaw), 30.0 * math.sin(2 * yaw)


def _goal(goal: Any) -> list[Any]:
    targets = np.array([1000.0 * target.translation for target in goal.targets])
    metric = goal.metric
    how: list[float] = []
    if isinstance(metric, PoseMetric):
        how = [1000.0 * metric.position, math.degrees(metric.rotation)]
    elif isinstance(metric, ZoneMetric):
        how = [1000.0 * v for v in (*metric.size, metric.z_cap)] + [len(points) for points in metric.points[:3]]
    numbers = [*targets.mean(axis=0), *targets.std(axis=0), 100.0 * goal.max_reward, *how]
    numbers += [math.degrees(value) for value in goal.symmetries[:3]]
    counts = [len(goal.objects), len(goal.targets), int(goal.matches.sum())]
    words = [goal.sentence, goal.target_name, goal.turn, goal.replace]
    return [words, counts, [round(float(v), 2) for v in numbers]]


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    made = SimWorld()
    yield made
    made.close()


def _close(found: Any, kept: Any) -> bool:
    """Return True if all words and counts are the same, and all measures but for what physics may differ by."""
    if isinstance(kept, dict):
        return found.keys() == kept.keys() and all(_close(found[key], kept[key]) for key in kept)
    if isinstance(kept, list):
        return len(found) == len(kept) and all(map(_close, found, kept))
    return abs(found - kept) < 2.0 if isinstance(kept, float) else bool(found == kept)


@pytest.mark.parametrize("name", TASKS)
def test_a_scene_is_as_its_seed_has_it(world: SimWorld, name: str) -> None:
    found, kept = measured(world, name), json.loads(TABLE.read_text())[name]
    assert {key: (found[key], kept[key]) for key in kept if not _close(found[key], kept[key])} == {}


if __name__ == "__main__":
    a_world = SimWorld()
    lines = [f'  "{task}": {json.dumps(measured(a_world, task))}' for task in TASKS]
    TABLE.write_text("{\n" + ",\n".join(lines) + "\n}\n")
