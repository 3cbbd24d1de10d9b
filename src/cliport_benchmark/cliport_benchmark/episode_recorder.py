"""One expert episode as rows of the data set."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np

from cliport_benchmark.observer import Observer
from cliport_core import PickPlaceAction, Primitive, WorkspaceSpec
from cliport_core.errors import PixelOutsideError
from cliport_policy.data.dataset_format import Demo, Row, SeenThing
from sim_bridge.rendering.camera import RgbdFrame
from sim_bridge.tasks import Task
from sim_bridge.world import SimWorld


class EpisodeNumber(NamedTuple):
    """Number of an episode in its data set, and the seed of its scene."""

    episode: int
    seed: int


class Hand(Protocol):
    """Carries out actions, with the arm or without."""

    def execute(self, action: PickPlaceAction, frame: RgbdFrame) -> object:
        """Execute an action and let the world settle."""


def record_episode(
    world: SimWorld,
    task: Task,
    observer: Observer,
    hand: Hand,
    rng: np.random.Generator,
    goals_per_scene: int,
    number: EpisodeNumber,
    mistake: Callable[[], PickPlaceAction | None] = lambda: None,
) -> list[Row] | None:
    """Record the rows of an episode; where the task was done the last one shows that, under the sentence said last.

    rng draws which further goals of each scene are asked for, at most `goals_per_scene` in all. mistake is asked before
    each of the expert's actions for one that precedes it: the row shows what that left, and the expert puts it right.
    None when the expert did not get the task done, as the original leaves those out, or would have to act outside the
    workspace (docs/benchmark.md, "Demonstrations").

    Raises:
        PhysicsError: when objects flew apart.
    """
    rows: list[Row] = []
    said = ""
    for step in range(task.max_steps + 1):
        done = task.done()
        if not done and step == task.max_steps:
            break
        wrong = None if done else mistake()
        if wrong is not None:
            hand.execute(wrong, observer.frame(world))
            task.advance()
            done = task.done()
        said = said if done else task.instruction
        try:
            # before the own action: the expert takes the last that it was asked for to be the one carried out
            others = _other_demos(task, said, rng, goals_per_scene - 1, observer.workspace)
            action = None if done else task.expert_action()
            if action is None and not done:
                break  # what is left cannot be shown
            own = _demo(said, action, task.primitive, observer.workspace)
        except PixelOutsideError:
            return None
        frame = observer.frame(world)
        demos = (own, *others, *_reached_before(task, said))
        things = tuple(seen_things(world, observer.workspace))
        seen = observer.heightmap(frame)
        rows.append(Row(task.name, task.split.value, number.seed, number.episode, step, seen, demos, things))
        if action is None:
            break
        hand.execute(action, frame)
        task.advance()
    return rows if said and task.done() else None


def _other_demos(task: Task, said: str, rng: np.random.Generator, at_most: int, workspace: WorkspaceSpec) -> list[Demo]:
    """Return the expert's demonstrations for other goals of the same scene
    than the one `said`, where the task has them."""
    if at_most < 1 or not task.several_goals:
        return []
    goals = [goal for goal in task.goals_in_scene() if goal.sentence != said]
    chosen = [goals[i] for i in rng.permutation(len(goals))[:at_most]]
    return [_demo(g.sentence, task.expert_action_for(g), task.primitive, workspace) for g in chosen]


def _reached_before(task: Task, said: str) -> list[Demo]:
    """Return what shows a policy that a goal is reached, though the episode goes on with another one."""
    primitive = task.primitive.label
    return [Demo(sentence, done=True, primitive=primitive) for sentence in task.sentences_done if sentence != said]


def seen_things(world: SimWorld, workspace: WorkspaceSpec) -> list[SeenThing]:
    """Return everything that lies on a world's table, in the order in which it was put there."""
    found = []
    for thing in world.objects:
        red, green, blue = thing.rgb
        try:
            row, col = workspace.xy_to_pixel(*map(float, world.object_xy(thing)))
        except PixelOutsideError:
            row, col = -1, -1
        found.append(SeenThing(thing.name, thing.color, red << 16 | green << 8 | blue, row, col))
    return found


def _demo(sentence: str, action: PickPlaceAction | None, primitive: Primitive, workspace: WorkspaceSpec) -> Demo:
    """Return an action as a demonstration. Raises PixelOutsideError when it leaves the workspace."""
    if action is None:
        return Demo(sentence, done=True, primitive=primitive.label)
    return Demo.of_action(sentence, action.primitive, action.pick, action.pick_yaw_period, action.place, workspace)
