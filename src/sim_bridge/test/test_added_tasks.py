"""Tasks that other packages add: found by entry points, and refused in one clear line where they cannot be used."""

from collections.abc import Iterator, Sequence
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from sim_bridge.errors import GoalError, TaskPackageError, UnknownNameError
from sim_bridge.scene import reset_scene
from sim_bridge.task_mechanics.goal import Goal
from sim_bridge.task_mechanics.task import Task
from sim_bridge.tasks import TASKS, added_tasks, is_known, make_task, registry
from sim_bridge.tasks.block_insertion import BlockInsertion
from sim_bridge.world import SimWorld

GROUP = "sim_bridge.tasks"


@pytest.fixture(autouse=True)
def forget() -> Iterator[None]:
    added_tasks.cache_clear()
    yield
    added_tasks.cache_clear()


def install(monkeypatch: pytest.MonkeyPatch, *entries: tuple[str, str]) -> None:
    """Pretend that packages with these entry points are installed."""
    made = [EntryPoint(name, value, GROUP) for name, value in entries]
    monkeypatch.setattr(registry, "entry_points", lambda group: made if group == GROUP else [])


def test_an_added_task_is_made_by_its_name(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, ("insertion-again", "sim_bridge.tasks.block_insertion:BlockInsertion"))
    task = make_task("insertion-again", "val")
    assert isinstance(task, BlockInsertion) and task.name == "insertion-again"
    assert is_known("insertion-again") and is_known("align-rope") and not is_known("insertion")
    with pytest.raises(UnknownNameError, match="did you mean insertion-again"):
        make_task("insertion-agian", "val")


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ([("mine", "no_such_module:Mine")], r"no_such_module:Mine fails \(ModuleNotFoundError"),
        ([("mine", "sim_bridge.colors:Missing")], r"fails \(AttributeError"),
        ([("mine", "builtins:zip")], r"fails \(TypeError"),
        ([("mine", "builtins:print")], "made a NoneType instead of a Task"),
        ([("align-rope", "somewhere:Rope")], "has the name of a task of the benchmark"),
        ([("mine", "a:Mine"), ("mine", "b:Mine")], "a:Mine and b:Mine have this name"),
    ],
)
def test_what_cannot_be_used_is_named(
    entries: list[tuple[str, str]], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(monkeypatch, *entries)
    with pytest.raises(TaskPackageError, match=words) as caught:
        make_task("mine", "test")
    assert str(caught.value).endswith("mend or uninstall its package") and "\n" not in str(caught.value)


def test_two_copies_of_one_package_are_one(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, *[("again", "sim_bridge.tasks.block_insertion:BlockInsertion")] * 2)
    assert list(added_tasks()) == ["again"]


class Clumsy(BlockInsertion):
    """A task whose scene cannot be made."""

    def set_up(self, world: SimWorld, rng: np.random.Generator) -> Sequence[Goal]:
        raise ZeroDivisionError("a scene\nof nothing")


def test_a_scene_that_fails_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch, ("clumsy", f"{__name__}:Clumsy"))
    monkeypatch.setattr(EntryPoint, "load", lambda entry: Clumsy)
    world = SimWorld()
    with pytest.raises(TaskPackageError, match=r"its scene cannot be made \(ZeroDivisionError") as caught:
        reset_scene(world, "clumsy", "test", 0)
    world.close()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", sorted(TASKS))
def test_tasks_answer_what_is_asked_before_their_scene_is_made(name: str) -> None:
    task = make_task(name, "test")
    assert isinstance(task, Task)
    assert task.stepwise == ("-seq" in name)
    is_bowls = name.startswith(("put-blocks-in-bowls", "place-red"))
    assert task.several_goals == is_bowls
    if not name.startswith("put-blocks-in-bowls"):
        with pytest.raises(GoalError, match=f"{name} makes no scene for a chosen sentence"):
            make_task(name, "test", "put the red blocks in a green bowl")
