"""A run's commands over an arm and a gripper that obey at once, and a log of what happened in which order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fake_ports import FakeArm, FakeGripper

from panda_executor import run_commands
from panda_executor.config import ExecutorConfig
from panda_executor.errors import TrajectoryError
from panda_executor.hand_content import HandContent
from panda_executor.motions import Motion
from panda_executor.phase import Phase
from panda_executor.ports import GripperResult, ShouldStop
from panda_executor.run_commands import EarlyEnd, RunCommands
from panda_executor.trajectory import JointTrajectory
from panda_model import FloatArray, load_preset

PANDA = load_preset()
CONFIG = replace(ExecutorConfig.for_arm(PANDA), start_tolerance=0.0625)
OPEN = CONFIG.hand.opening


def motion(phase: Phase = Phase.CARRY) -> Motion:
    """Three points, 0.25 rad apart, in a scene that says which positions it was asked for."""
    way = PANDA.ready + np.array([[0.0], [0.25], [0.5]])
    trajectory = JointTrajectory(PANDA.arm_joints, np.arange(3.0), way, np.zeros((3, 7)), np.zeros((3, 7)))
    scene: Any = SimpleNamespace(leaving=lambda here: ("leaving", here.tolist()))
    return Motion(phase, trajectory, scene)


class Gripper(FakeGripper):
    """Counts how often its width is looked at, and knows with what force it moved."""

    looks = 0
    efforts: tuple[float, ...] = ()

    def width(self) -> float:
        self.looks += 1
        return super().width()

    def move(self, width: float, max_effort: float, should_stop: ShouldStop) -> GripperResult:
        self.efforts = (*self.efforts, max_effort)
        return super().move(width, max_effort, should_stop)


class CommandBench:
    """Commands, and the order of all that happened; `stops` answers each look for a stop."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.arm, self.gripper, self.log = FakeArm(), Gripper(opening=0.04), list[str]()
        self.phases: list[tuple[Phase, float]] = []
        self.stops: Callable[[], bool] = lambda: False
        self.valid = True
        self.hand = HandContent(CONFIG.missed_width, OPEN)
        self.hand.note(OPEN, OPEN)  # it was open before
        self.validated: list[Any] = []
        self.commands = RunCommands(
            self.arm, self.gripper, CONFIG, PANDA.limits, self._on_phase, self._should_stop, self.hand, self._on_plan
        )
        self.waited = True
        self.plans: list[Any] = []
        monkeypatch.setattr(run_commands, "depart_from", self._depart)
        monkeypatch.setattr(run_commands, "validate_trajectory", self._validate)
        monkeypatch.setattr(self.arm, "on_step", lambda number, share: self.log.append("step"))

    def _on_phase(self, phase: Phase, share: float) -> None:
        self.log.append(phase.name)
        self.phases.append((phase, share))

    def _on_plan(self, motions: Any) -> bool:
        self.plans.append(motions)
        self.log.append("plan")
        return self.waited

    def _should_stop(self) -> bool:
        self.log.append("stop?")
        return self.stops()

    def _depart(self, trajectory: Any, here: FloatArray, limits: Any, tolerance: float) -> JointTrajectory:
        assert limits is PANDA.limits and tolerance == CONFIG.start_tolerance
        np.testing.assert_array_equal(here, self.arm.positions)
        self.log.append("depart")
        return replace(trajectory, velocities=np.full((3, 7), 0.5))

    def _validate(self, trajectory: JointTrajectory, limits: Any, scene: Any, straightness: float | None) -> None:
        assert trajectory.velocities[0, 0] == 0.5, "what is sent is what was checked"
        assert limits is PANDA.limits and scene == ("leaving", self.arm.positions.tolist())
        assert straightness is None, "no line is planned here"
        self.log.append("validate")
        if not self.valid:
            raise TrajectoryError("it touches a box")

    def fails(self, **arguments: Any) -> EarlyEnd:
        with pytest.raises(EarlyEnd) as caught:
            self.commands.move(motion(), **arguments)
        return caught.value

    def stop_at(self, number: int) -> None:
        """Ask for a stop from the look of that number on."""
        self.stops = lambda: self.log.count("stop?") >= number
