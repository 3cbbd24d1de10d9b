"""A run's planner and commands, played: each says what it is asked for, in one log."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.outcome import ActionResult
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import action_run, last_look
from panda_executor.action_run import ActionRun
from panda_executor.config import AfterFailure, ExecutorConfig
from panda_executor.last_look import LastLook
from panda_executor.motions import Motion
from panda_executor.phase import Phase

CONFIG = replace(ExecutorConfig(), grip_force=11.0, open_force=7.0, after_failure=AfterFailure.STAY)
OPEN = CONFIG.hand.opening
ACTION = PickPlaceAction(PlanarPose(0.45, 0.1, 0.3), PlanarPose(0.5, -0.2, 0.3))
WORKSPACE = WorkspaceSpec()


def motion(name: str, phase: Phase = Phase.CARRY) -> Motion:
    """A motion that is known by its trajectory's name, in a scene of that name."""
    trajectory: Any = SimpleNamespace(name=name, duration=1.5)
    scene: Any = SimpleNamespace(name=f"scene of {name}", hand=f"hand of {name}")
    return Motion(phase, trajectory, scene)


def pick_plan(of: str = "") -> Any:
    names = ("go_above", "descend", "raise_up", "carry", "lower", "leave", "retreat")
    motions = {name: motion(of + name) for name in names}
    grasp = SimpleNamespace(opening=0.05, centroid=np.array([1.0, 2.0, 3.0]) + len(of))
    return SimpleNamespace(
        **motions, motions=list(motions.values()), grasp=grasp, placement=SimpleNamespace(opening=0.06)
    )


def drag_plan(of: str = "", lift: bool = True) -> Any:
    names = ("go_above", "descend", "lift", "drag", "leave", "retreat")
    motions: dict[str, Any] = {name: motion(of + name) for name in names}
    shown = [motions[name] for name in names if lift or name != "lift"]
    motions["lift"] = motions["lift"] if lift else None
    return SimpleNamespace(**motions, escape=motion("escape"), opening=0.03, motions=shown)


class PlayedRun:
    """A run's planner and commands at once; `fail` raises when a line comes that it has."""

    def __init__(self) -> None:
        self.config, self.moved, self.log = CONFIG, False, list[str]()
        self.fail: dict[str, Exception] = {}
        self.stops, self.waits, self.empties = False, False, list[bool]()
        self.hand, self.ik, self.motions = "the hand", "the ik", "the builder"
        self.clouds: Iterator[str] = iter(["first cloud", "second cloud"])
        self.looked: list[str | Exception] = []  # what the looks see, one after the other; then all is fine
        self.lift = True
        self.up: Motion | None = motion("up")
        self.at = 0

    def say(self, words: str) -> None:
        self.log.append(words)
        if words in self.fail:
            raise self.fail.pop(words)

    def check(self, name: str, place: int, *given: Any) -> None:
        self.say(f"{name} {given[place]}")

    def enter(self, phase: Phase) -> None:
        self.say(phase.name)

    def move(self, motion: Any, watch_load: bool = False, may_end_off: bool = False) -> None:
        self.moved = True
        kind = f"{' watched' if watch_load else ''}{' maybe off' if may_end_off else ''}"
        where = "" if motion.phase is Phase.CARRY else f" as {motion.phase.name} in {motion.scene.name}"
        self.say(f"move {motion.trajectory.name}{where}{kind}")

    def move_fingers(self, width: float, effort: float, load: Any = None) -> None:
        self.say(f"fingers {width:g} with {effort:g}{f' on {load}' if load else ''}")

    def let_go(self, opening: float) -> None:
        self.say(f"let go {opening:g}")

    def is_empty(self) -> bool:
        return self.empties.pop(0) if self.empties else False

    has_lost = is_empty

    def offer(self, motions: Any) -> bool:
        self.say(f"offer {len(motions)}")
        return self.waits

    def should_stop(self) -> bool:
        return self.stops

    def progress(self, phase: Phase, within: float) -> None: ...

    def __getattr__(self, name: str) -> Callable[[], Any]:
        """Say and answer the rest of the commands."""
        answers = {"hand_shape": "shape", "check_empty": None, "check_stop": None, "width": 0.02, "positions": "here"}
        if name not in answers:
            raise AttributeError(name)

        def answer() -> Any:
            if name in ("check_empty", "check_stop", "width") and (name != "width" or name in self.fail):
                self.say(name)
            if name == "positions":
                self.at += 1
                return f"at {self.at}"
            return answers[name]

        return answer

    def cloud(self) -> Any:
        return next(self.clouds)

    def look(self) -> Any:
        cloud = self.looked.pop(0) if self.looked else "fine"
        self.log.append(f"look {cloud}")
        if isinstance(cloud, Exception):
            raise cloud
        return cloud

    def plan(self, action: Any, cloud: Any, workspace: Any, start: Any, progress: Any, should_stop: Any) -> Any:
        assert (action, workspace, progress, should_stop) == (ACTION, WORKSPACE, self.progress, self.should_stop)
        self.say(f"plan in {cloud} from {start}")
        return pick_plan()

    def renewed(self, plan: Any, cloud: Any, workspace: Any, positions: Any) -> Any:
        self.say(f"renew in {cloud} from {positions}")
        return pick_plan("new ")

    def found_again(self, plan: Any, cloud: Any, follow: bool) -> Any:
        self.say(f"find in {cloud}{' and follow' if follow else ''}")
        return plan if cloud == "fine" else pick_plan("found ")

    def grid(self, cloud: Any, workspace: Any, positions: Any) -> str:
        return f"grid of {cloud} seen {positions}"

    def upward(self, start: Any, grid: Any, hand: Any) -> Motion | None:
        self.log.append(f"up from {start} in {grid} with {hand}")
        return self.up

    def homeward(self, start: Any, grid: Any, hand: Any) -> Motion:
        self.say(f"home from {start} in {grid} with {hand}")
        return motion("home", Phase.RETREAT)

    def make(self, primitive: Primitive = Primitive.PICK_PLACE, plan_only: bool = False) -> ActionRun:
        self.action = replace(ACTION, primitive=primitive)
        goal = ActionGoal(self.action, plan_only=plan_only)
        return ActionRun(self, self, goal, self.cloud, WORKSPACE, self.look)  # type: ignore[arg-type]

    def run(self, primitive: Primitive = Primitive.PICK_PLACE, plan_only: bool = False) -> ActionResult:
        return self.make(primitive, plan_only).result()


def played_run(monkeypatch: pytest.MonkeyPatch) -> PlayedRun:
    """Return a run whose checks and plans of drags are played, too."""
    bench = PlayedRun()
    monkeypatch.setattr(action_run, "check_poses", lambda action, workspace: bench.say("check_poses"))
    for name, place in {"check_cloud": 0, "check_table": 0, "check_positions": 0, "check_reach": 2}.items():
        monkeypatch.setattr(action_run, name, partial(bench.check, name, place))

    def plan_drag(planner: Any, action: Any, cloud: Any, workspace: Any, start: Any, should_stop: Any) -> Any:
        assert planner is bench and action is bench.action and should_stop == bench.should_stop
        bench.say(f"plan drag in {cloud} from {start}")
        return drag_plan(lift=bench.lift)

    def renewed_drag(planner: Any, action: Any, plan: Any, cloud: Any, workspace: Any, positions: Any) -> Any:
        assert planner is bench and action is bench.action
        bench.say(f"renew drag in {cloud} from {positions}")
        return drag_plan("new ", bench.lift)

    def problem(of: str, plan: Any, view: Any, motions: Any) -> str | None:
        assert motions == bench.motions
        bench.log.append(f"judge the {of} in {view.cloud} at {view.positions}")
        return "a box came" if "box" in view.cloud else None

    def raised(self: LastLook, grid: str, positions: Any) -> str:
        return grid if self._changed is None else f"{grid} raised by {self._changed} at {positions}"

    monkeypatch.setattr(action_run, "plan_drag", plan_drag)
    monkeypatch.setattr(action_run, "renewed_drag", renewed_drag)
    monkeypatch.setattr(last_look, "check_cloud", lambda cloud: None)
    for of in ("pick", "drag", "place"):
        monkeypatch.setattr(last_look, f"{of}_problem", partial(problem, of))
    monkeypatch.setattr(LastLook, "raised", raised)
    return bench
