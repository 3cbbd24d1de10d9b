"""An arm and a hand that do what they are told, in a time that the test turns."""

from __future__ import annotations

import numpy as np

from panda_driver.errors import ArmFaultError, HandFaultError
from panda_driver.ports import ArmState, HandState
from panda_model import load_preset
from panda_model.limits import FloatArray

ARM = load_preset("fr3")


class FakeArm:
    """ArmPort whose joints are where they were told to be; its clock goes on by `step` [s] with each reading."""

    def __init__(self, step: float = 0.01) -> None:
        self.step, self.time = step, 100.0
        self.positions, self.velocities = np.array(ARM.ready), np.zeros(7)
        self.fault, self.stops_with, self.keeps_errors = "", "", False
        self.in_control, self.begun, self.closed, self.readings = False, 0, False, 0

    def read(self) -> ArmState:
        self.time += self.step
        self.readings += 1
        return ArmState(self.time, self.positions.copy(), self.velocities.copy(), np.zeros(7), self.fault)

    def begin(self) -> None:
        self.in_control = True
        self.begun += 1

    def follow(self, positions: FloatArray, velocities: FloatArray, accelerations: FloatArray) -> None:
        assert self.in_control
        if self.stops_with:
            raise ArmFaultError(self.stops_with)
        self.positions, self.velocities = np.array(positions), np.array(velocities)

    def end(self) -> None:
        self.in_control = False

    def recover(self) -> None:
        assert not self.in_control
        if self.keeps_errors:
            raise ArmFaultError("the arm keeps its errors")
        self.fault = self.stops_with = ""

    def close(self) -> None:
        self.closed = True


class FakeMotion:
    """HandMotion that ends at once, or never."""

    def __init__(self, ends: bool, done: bool) -> None:
        self._ends, self._done = ends, done

    def wait(self, timeout: float) -> bool:
        return self._ends

    def succeeded(self) -> bool:
        return self._done


class FakeHand:
    """HandPort that closes on an object of a width [m], 0 for none."""

    def __init__(self, object_width: float = 0.0) -> None:
        self.object_width, self.width, self.max_width = object_width, 0.08, 0.08
        self.ends, self.does, self.done, self.fails = True, True, True, ""
        self.told: list[tuple[str, float]] = []
        self.forces: list[float] = []
        self.stops = 0

    def read(self) -> HandState:
        return HandState(self.width, self.max_width)

    def move(self, width: float, speed: float) -> FakeMotion:
        return self._go("move", width, width)

    def grasp(self, width: float, speed: float, force: float, epsilon: tuple[float, float] | None) -> FakeMotion:
        self.forces.append(force)
        end = max(width, self.object_width)
        self.done = self.does and (epsilon is None or width - epsilon[0] <= end <= width + epsilon[1])
        return self._go("grasp", width, end)

    def home(self) -> FakeMotion:
        self.max_width = 0.08
        return self._go("home", 0.0, self.width)

    def stop(self) -> None:
        self.stops += 1

    def _go(self, what: str, width: float, end: float) -> FakeMotion:
        if self.fails:
            raise HandFaultError(self.fails)
        self.told.append((what, width))
        if self.ends:
            self.width = end
        return FakeMotion(self.ends, self.done)
