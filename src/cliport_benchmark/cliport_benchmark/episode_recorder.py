"""One expert episode as rows of the data set."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from cliport_benchmark.observer import Observer
from cliport_perception import PlanarPose, Primitive, WorkspaceSpec
from cliport_perception.errors import PixelOutsideError
from cliport_policy.data.dataset_format import Demo, Row
from sim_bridge.rendering.camera import RgbdFrame
from sim_bridge.tasks import ExpertAction, PutBlocksInBowls, Task
from sim_bridge.world import SimWorld

# The specification (section 6.7) keeps scores above 0.99. Where a goal is a few equal parts this is the same; piles,
# ropes and boxes are kept with a block or two outside, whose demonstrations are as right as the others.
KEPT_FROM = 0.9


class Hand(Protocol):
    """Carries out actions, with the arm or without."""

    def execute(self, pick: PlanarPose, place: PlanarPose, frame: RgbdFrame, primitive: Primitive) -> object:
        """Do it and let the world settle."""


def record_episode(
    world: SimWorld,
    task: Task,
    observer: Observer,
    hand: Hand,
    rng: np.random.Generator,
    goals_per_scene: int,
    episode: int,
    seed: int,
) -> list[Row] | None:
    """The rows of an episode; where the task was done the last one shows that, under the sentence said last.

    rng draws which further goals of each scene are asked for, at most `goals_per_scene` in all.
    None when the expert scored less than KEPT_FROM, or would have to act outside the workspace.

    Raises:
        PhysicsError: when objects flew apart.
    """
    rows: list[Row] = []
    said = ""
    for step in range(task.max_steps + 1):
        action = None if task.done() else task.expert_action()
        if not task.done() and (action is None or step == task.max_steps):
            break  # what is left cannot be shown
        frame = observer.frame(world)
        try:
            own = _demo(action.instruction if action else said, action, task.primitive, observer.workspace)
            others = _other_demos(task, rng, goals_per_scene - 1, observer.workspace)
        except PixelOutsideError:
            return None
        heightmap = observer.heightmap(frame)
        rows.append(Row(task.name, task.split.value, seed, episode, step, heightmap, (own, *others)))
        if action is None:
            break
        said = action.instruction
        hand.execute(action.pick, action.place, frame, action.primitive)
        task.advance()
    return rows if said and task.score() >= KEPT_FROM else None


def _other_demos(task: Task, rng: np.random.Generator, at_most: int, workspace: WorkspaceSpec) -> list[Demo]:
    """What the expert would do for other goals of the same scene, where the task has them."""
    if at_most < 1 or not isinstance(task, PutBlocksInBowls):
        return []
    goals = [goal for goal in task.goals_in_scene() if goal != task.goal]
    chosen = [goals[i] for i in rng.permutation(len(goals))[:at_most]]
    return [_demo(g.sentence, task.expert_action_for(g), task.primitive, workspace) for g in chosen]


def _demo(sentence: str, action: ExpertAction | None, primitive: Primitive, workspace: WorkspaceSpec) -> Demo:
    """Raises PixelOutsideError when the action leaves the workspace."""
    if action is None:
        return Demo(sentence, done=True, primitive=primitive.name.lower())
    return Demo.of_action(sentence, action.primitive, action.pick, action.pick_yaw_period, action.place, workspace)
