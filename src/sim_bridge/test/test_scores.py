"""Scores of all 28 tasks against the benchmark's formulae, written out a second time, over scripted poses."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest

from cliport_core import PlanarPose, Pose
from sim_bridge.objects import SceneObject
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.goal import Goal
from sim_bridge.task_mechanics.goal_task import GoalTask
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS
from sim_bridge.world import SimWorld

STEPS = 16
FULL, QUARTER = 360.0, 90.0
PERIODS = {  # of kitting shapes, by the benchmark's names [degrees]; 0: the yaw does not count
    "letter R shape": FULL, "letter A shape": FULL, "triangle": 120.0, "square": QUARTER, "plus": QUARTER,
    "letter T shape": FULL, "diamond": 180.0, "pentagon": 72.0, "rectangle": 180.0, "flower": QUARTER,
    "star": 72.0, "circle": 0.0, "letter G shape": FULL, "letter V shape": FULL, "letter E shape": FULL,
    "letter L shape": FULL, "ring": 0.0, "hexagon": 60.0, "heart": FULL, "letter M shape": FULL,
}  # fmt: skip


@dataclass(frozen=True)
class Rule:
    """A task's row of the benchmark: distance [m] and period [degrees] of the pose metric, or height [m] and edge [m]
    of the zone's, and how many goals there are (0: as many as the scene has)."""

    near: float = 0.01
    period: float | None = None  # None: the shape's own
    cap: float = 0.0  # 0: no zone
    edge: float = 0.0  # 0: the container's or the pallet's
    goals: int = 1


RULES = {
    "align-rope": Rule(near=0.02, period=0.0),
    "manipulating-rope": Rule(near=0.02, period=0.0),
    "packing-unseen-shapes": Rule(cap=0.30),
    "assembling-kits-seq": Rule(goals=5),
    "assembling-kits": Rule(),
    "put-blocks-in-bowls": Rule(near=0.05, period=0.0),
    "place-red-in-green": Rule(near=0.05, period=0.0),
    "packing-box-pairs": Rule(cap=0.0525),
    "packing-boxes": Rule(cap=0.08),
    "packing-seen-google-objects-seq": Rule(cap=0.30, goals=0),
    "packing-unseen-google-objects-seq": Rule(cap=0.30, goals=0),
    "packing-seen-google-objects-group": Rule(cap=0.30),
    "packing-unseen-google-objects-group": Rule(cap=0.30),
    "stack-block-pyramid-seq": Rule(period=QUARTER, goals=6),
    "stack-block-pyramid": Rule(period=QUARTER, goals=3),
    "separating-piles": Rule(cap=0.30, edge=0.15),
    "sweeping-piles": Rule(cap=0.30, edge=0.12),
    "towers-of-hanoi-seq": Rule(period=0.0, goals=7),
    "towers-of-hanoi": Rule(period=0.0, goals=7),
    "block-insertion": Rule(period=FULL),
    "align-box-corner": Rule(period=FULL),
    "palletizing-boxes": Rule(cap=0.30),
}


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


class ByHand:
    """The public environment's bookkeeping: the running score is kept, then the goal that is complete goes."""

    def __init__(self, world: SimWorld, task: GoalTask, rule: Rule) -> None:
        self.world, self.task, self.rule = world, task, rule
        self.goals = list(task.goals)
        assert len(self.goals) == (rule.goals or task.max_steps - 1)
        self.progress = self.running = 0.0

    def share(self, goal: Goal) -> float:
        if self.task.name == "stack-block-pyramid":
            return len(goal.objects) / 6
        return 1.0 / (self.rule.goals or self.task.max_steps - 1)

    def reward(self) -> float:
        """Return the environment's reward for an action: the difference of two running scores."""
        if not self.goals:
            return 0.0
        goal, before = self.goals[0], self.running
        step = self.share(goal) * (self.zone(goal) if self.rule.cap else self.pose(goal))
        self.running = self.progress + step
        if abs(self.share(goal) - step) < 0.01:
            self.progress += self.share(goal)
            self.goals.pop(0)
        return self.running - before

    def pose(self, goal: Goal) -> float:
        hits = 0
        for i, thing in enumerate(goal.objects):
            x, y, yaw = planar(self.world.object_pose(thing))
            period = PERIODS[thing.name] if self.rule.period is None else self.rule.period
            for j, target in enumerate(goal.targets):
                tx, ty, target_yaw = planar(target)
                if not goal.matches[i, j] or (x - tx) ** 2 + (y - ty) ** 2 >= self.rule.near**2:
                    continue
                turn = abs(math.degrees(yaw - target_yaw)) % period if period else 0.0
                if min(turn, period - turn) < 15.0:
                    hits += 1
                    break
        return hits / len(goal.objects)

    def zone(self, goal: Goal) -> float:
        zone = self.zone_frame(goal)
        edges = self.edges()
        inside = total = 0
        for thing in goal.objects:
            pose = self.world.object_pose(thing)
            for point in points_of(self.task.name, thing):
                local = zone.rotation.T @ (pose.rotation @ point + pose.translation - zone.translation)
                inside += abs(local[0]) < edges[0] / 2 and abs(local[1]) < edges[1] / 2 and local[2] < self.rule.cap
                total += 1
        if self.task.name == "palletizing-boxes":  # boxes that have not appeared are outside
            total = total * 18 // len(goal.objects)
        return inside / total

    def zone_frame(self, goal: Goal) -> Pose:
        containers = [thing for thing in self.task.objects if thing.fixed and thing.name == "brown box"]
        return self.world.object_pose(containers[0]) if containers else goal.targets[0]

    def edges(self) -> tuple[float, float]:
        if self.rule.edge:
            return self.rule.edge, self.rule.edge
        fixed = next(thing for thing in self.task.objects if thing.fixed)
        width, depth, _ = np.ptp(fixed.mesh.vertices, axis=0)
        wall = 0.002 if fixed.name == "brown box" else 0.0  # whose middle lies on the outline
        return float(width) - wall, float(depth) - wall


def planar(pose: Pose) -> tuple[float, float, float]:
    r = pose.rotation
    steep = abs(r[2, 0]) >= 0.7
    yaw = math.atan2(r[1, 1], r[0, 1]) - math.pi / 2 if steep else math.atan2(r[1, 0], r[0, 0])
    return float(pose.translation[0]), float(pose.translation[1]), yaw


def points_of(task: str, thing: SceneObject) -> list[np.ndarray]:  # type: ignore[type-arg]
    """Every 2 cm from the lowest corner, the far side excluded; kitting shapes and pile blocks have one point."""
    low, high = thing.mesh.vertices.min(axis=0).astype(float), thing.mesh.vertices.max(axis=0).astype(float)
    if task == "packing-unseen-shapes":
        return [np.array([-0.0015, -0.0015, low[2]])]
    counts = [max(1, math.ceil(round((b - a) / 0.02, 6))) for a, b in zip(low, high, strict=True)]
    return [low + 0.02 * np.array(index) for index in np.ndindex(*counts)]


def rule_of(name: str) -> Rule:
    return RULES[name.removesuffix("-seen-colors").removesuffix("-unseen-colors")]


@pytest.mark.parametrize("name", [*LANGUAGE_SPLITS, *DEMO_TASKS])
def test_scores_are_those_of_the_formulae(world: SimWorld, name: str) -> None:
    task = first_scene(world, name)
    rng = np.random.default_rng(11)
    by_hand = ByHand(world, task, rule_of(name))
    returned, seen = 0.0, set()
    for step in range(STEPS):
        disturb(world, task, by_hand.goals, rng, step)
        task.advance()
        returned += by_hand.reward()
        assert task.score() == pytest.approx(by_hand.running, abs=1e-6)
        assert returned == pytest.approx(task.score(), abs=1e-6)
        assert task.done() == (not by_hand.goals or by_hand.running > 0.99)
        if name == "palletizing-boxes":
            by_hand.goals = [goal for goal in (task.present_goal,) if goal is not None]
        else:
            assert task.goals_reached == len(task.goals) - len(by_hand.goals)
        seen.add(round(task.score(), 6))
    assert len(seen) > 1  # the script went through more than one score


def first_scene(world: SimWorld, name: str) -> GoalTask:
    """The first scene with several goals, where a scene may have one or more."""
    for seed in range(7, 30):
        task = reset_scene(world, name, "test", seed)
        assert isinstance(task, GoalTask)
        if rule_of(name).goals or len(task.goals) > 1:
            return task
    raise AssertionError("no such scene")


def disturb(world: SimWorld, task: GoalTask, goals: list[Goal], rng: np.random.Generator, step: int) -> None:
    """Move some things of the present goal, and at times of a later one, near to where they belong, or away."""
    if not goals:
        return
    if step == 0:
        for thing in goals[0].objects:
            world.move_object(thing, PlanarPose(1.2, 0.0, 0.0).as_pose(0.1))
        return
    if step % 4 == 2 and len(goals) > 1:  # the next one is fulfilled before its turn
        for thing, target in zip(goals[1].objects, goals[1].targets, strict=True):
            world.move_object(thing, target)
        return
    goal = goals[0] if step % 4 == 3 or rng.random() < 0.7 else goals[int(rng.integers(len(goals)))]
    for i, thing in enumerate(goal.objects):
        if rng.random() > 0.6 + 0.4 * (step % 4 == 3):
            continue
        allowed = np.flatnonzero(goal.matches[i])
        target = goal.targets[int(rng.choice(allowed))]
        x, y, yaw = planar(target)
        scale = 0.0 if step % 4 == 3 else float(rng.choice([0.004, 0.008, 0.03, 0.1]))
        dx, dy = rng.normal(0.0, scale, 2)
        turn = math.radians(float(rng.normal(0.0, 10.0))) * (scale > 0.0)
        height = float(rng.choice([0.02, 0.05, 0.09, 0.31])) if scale else float(target.translation[2])
        tilt = float(rng.choice([0.0, 0.4])) * (scale > 0.0)
        away = PlanarPose(x + dx, y + dy, yaw + turn).as_pose(height)
        world.move_object(thing, away @ Pose.from_xyz_rpy((0.0, 0.0, 0.0), (tilt, 0.0, 0.0)))
