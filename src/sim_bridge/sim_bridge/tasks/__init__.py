"""The benchmark's tasks by name."""

from __future__ import annotations

from sim_bridge.errors import GoalError, PhysicsError
from sim_bridge.task_mechanics.task import JudgedAction, Split, Task
from sim_bridge.tasks.color_goal import ColorGoal
from sim_bridge.tasks.goal_words import goal_colors
from sim_bridge.tasks.put_blocks_in_bowls import PutBlocksInBowls
from sim_bridge.tasks.registry import (
    ALIASES,
    DEMO_TASKS,
    LANGUAGE_SPLITS,
    TASKS,
    added_tasks,
    is_known,
    make_task,
    split_of,
)
from sim_bridge.tasks.variants import Variant

__all__ = [
    "ALIASES",
    "DEMO_TASKS",
    "LANGUAGE_SPLITS",
    "TASKS",
    "ColorGoal",
    "GoalError",
    "JudgedAction",
    "PhysicsError",
    "PutBlocksInBowls",
    "Split",
    "Task",
    "Variant",
    "added_tasks",
    "goal_colors",
    "is_known",
    "make_task",
    "split_of",
]
