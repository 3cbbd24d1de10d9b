"""The benchmark's tasks by name."""

from __future__ import annotations

from collections.abc import Callable

from sim_bridge.errors import GoalError, UnknownNameError
from sim_bridge.tasks.base import ExpertAction, Split, Task
from sim_bridge.tasks.color_goal import ColorGoal
from sim_bridge.tasks.goal_words import goal_colors
from sim_bridge.tasks.put_blocks_in_bowls import PutBlocksInBowls

TaskMaker = Callable[[str, Split, ColorGoal | None], Task]

TASKS: dict[str, TaskMaker] = {
    "put-blocks-in-bowls-seen-colors": lambda name, split, goal: PutBlocksInBowls(name, split, False, goal),
    "put-blocks-in-bowls-unseen-colors": lambda name, split, goal: PutBlocksInBowls(name, split, True, goal),
}


def split_of(name: str) -> Split:
    """The split of that name.

    Raises:
        UnknownNameError: naming the nearest ones.
    """
    try:
        return Split(name)
    except ValueError:
        raise UnknownNameError("split", name, [s.value for s in Split]) from None


def make_task(name: str, split: str, instruction: str = "") -> Task:
    """A task by name, not yet set up; with an instruction, for the goal that it names.

    Raises:
        UnknownNameError: on an unknown task or split, naming the nearest ones.
        GoalError: when the instruction names no goal that the task knows.
    """
    if name not in TASKS:
        raise UnknownNameError("task", name, TASKS)
    goal = None
    if instruction.strip():
        goal = goal_colors(instruction)
    return TASKS[name](name, split_of(split), goal)


__all__ = [
    "TASKS",
    "ColorGoal",
    "ExpertAction",
    "GoalError",
    "PutBlocksInBowls",
    "Split",
    "Task",
    "goal_colors",
    "make_task",
    "split_of",
]
