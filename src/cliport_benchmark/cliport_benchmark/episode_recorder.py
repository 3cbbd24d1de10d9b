"""One expert episode as rows of the data set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cliport_benchmark.dataset_format import Demo, Row
from cliport_benchmark.observer import Observer
from cliport_perception import PlanarPose, WorkspaceSpec
from sim_bridge.camera import RgbdFrame
from sim_bridge.tasks import ColorGoal, ExpertAction, PutBlocksInBowls
from sim_bridge.world import SimWorld

PickAndPlace = Callable[[PlanarPose, PlanarPose, RgbdFrame], object]


def record_episode(
    world: SimWorld,
    task: PutBlocksInBowls,
    observer: Observer,
    pick_and_place: PickAndPlace,
    rng: np.random.Generator,
    goals_per_scene: int,
    episode: int,
    seed: int,
) -> list[Row] | None:
    """The rows of an episode; its last one shows the goal reached. None when the expert did not reach it.

    rng draws which further goals of each scene are asked for, at most `goals_per_scene` in all.
    """
    rows: list[Row] = []
    for step in range(task.max_steps + 1):
        action = task.expert_action()
        demos = [_demo(task.goal, action, observer.workspace)]
        others = [goal for goal in task.goals_in_scene() if goal != task.goal]
        count = min(len(others), goals_per_scene - 1)
        for i in rng.permutation(len(others))[:count]:
            demos.append(_demo(others[i], task.expert_action_for(others[i]), observer.workspace))
        frame = observer.frame(world)
        rows.append(Row(episode, seed, step, observer.heightmap(frame), tuple(demos)))
        if action is None:
            break
        pick_and_place(action.pick, action.place, frame)
    return rows if task.done() and rows[-1].demos[0].done else None


def _demo(goal: ColorGoal, action: ExpertAction | None, workspace: WorkspaceSpec) -> Demo:
    if action is None:
        return Demo(goal.sentence, goal.block, goal.bowl, done=True)
    pick_row, pick_col = workspace.xy_to_pixel(action.pick.x, action.pick.y)
    place_row, place_col = workspace.xy_to_pixel(action.place.x, action.place.y)
    return Demo(
        goal.sentence,
        goal.block,
        goal.bowl,
        False,
        pick_row,
        pick_col,
        action.pick.yaw,
        action.pick_yaw_period,
        place_row,
        place_col,
        action.place.yaw,
    )
