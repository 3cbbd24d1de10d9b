"""Scores of all 28 tasks over scripted true poses, against the benchmark's rules worked out by hand.

scripted_poses.json holds scenes, poses and scores; benchmark_by_hand.py reads the goals off what is said and what lies
there, and shares nothing with the simulator's own.
"""

from collections.abc import Iterator
from typing import Any

import pytest
from benchmark_by_hand import goals_of, recorded, scores_of, things_in

from cliport_benchmark.agents import ExpertAgent
from cliport_benchmark.episode import Episode, run_episode
from cliport_core import ActionResult, PickPlaceAction, PlanarPose, Pose
from cliport_core.outcome import Outcome
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS, Task
from sim_bridge.world import SimWorld

NOWHERE = PlanarPose(0.9, 0.9, 0.0)


@pytest.fixture(scope="module")
def world() -> Iterator[SimWorld]:
    world = SimWorld()
    yield world
    world.close()


class Blindfold:
    """An observer that takes no pictures."""

    def __getattr__(self, name: str) -> Any:
        return lambda *_: None


class Scripted(ExpertAgent):
    """Asks for as many actions as the script has, then gives up."""

    def __init__(self, steps: int) -> None:
        self.left = steps

    def decide(self, task: Task, *_: Any) -> Any:
        self.left -= 1
        return (PickPlaceAction(NOWHERE, NOWHERE, task.primitive) if self.left >= 0 else None), None


class ScriptedHand:
    """Puts things where the script says instead of where the action does."""

    def __init__(self, world: SimWorld, task: Task, script: list[Any]) -> None:
        self.world, self.task, self.script = world, task, iter(script)

    def new_scene(self, *_: Any) -> None:
        """Nothing to forget."""

    def execute(self, *_: Any) -> ActionResult:
        for i, x, y, z, *rpy in next(self.script):
            self.world.move_object(self.task.objects[int(i)], Pose.from_xyz_rpy((x, y, z), rpy))
        return ActionResult(Outcome.SUCCEEDED, "")


def played(world: SimWorld, task: Task, seed: int, script: list[Any]) -> Episode:
    hand, agent = ScriptedHand(world, task, script), Scripted(len(script))
    return run_episode(world, hand, Blindfold(), agent, task, seed, lambda t: t.instruction)  # type: ignore[arg-type]


def test_every_task_has_its_scripts() -> None:
    assert list(recorded()) == [*LANGUAGE_SPLITS, *DEMO_TASKS]


@pytest.mark.parametrize("name", [*LANGUAGE_SPLITS, *DEMO_TASKS])
def test_scores_are_those_of_the_rules(world: SimWorld, name: str) -> None:
    record = recorded()[name]
    for script, scores in record["scripts"]:
        task = reset_scene(world, name, "test", record["seed"])
        lying = [thing for thing in things_in(record) if thing.fixed]
        fixed = [thing for thing in task.objects if thing.fixed]
        assert (task.instruction, task.max_steps) == (record["sentences"][0], record["max_steps"])
        assert [thing.name for thing in fixed] == [thing.name for thing in lying], "scenes changed: see draw_scripts.py"
        for thing, hand in zip(fixed, lying, strict=True):
            assert world.object_xy(thing) == pytest.approx(hand.pose[:2], abs=1e-6)
        episode = played(world, task, record["seed"], script)
        by_hand = scores_of(
            goals_of(name, record["sentences"], things_in(record), task.max_steps), things_in(record), script
        )
        assert by_hand == pytest.approx(scores, abs=1e-9)
        assert [step.score for step in episode.actions] == pytest.approx(scores, abs=1e-6)
        assert episode.score == pytest.approx(scores[-1], abs=1e-6)
