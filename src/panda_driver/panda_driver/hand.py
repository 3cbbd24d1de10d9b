"""The hand: GripperCommand by franka_gripper's rule (half a width; closing is a grasp), and franka_msgs' actions."""

from __future__ import annotations

import math
import threading
import time as clock
from collections.abc import Callable

from panda_driver.errors import DriverError, HandFaultError, HandGoalError
from panda_driver.ports import HandMotion, HandPort, HandState
from panda_model import HandModel
from sim_bridge.control.goal_status import GoalStatus
from sim_bridge.control.gripper_controller import GripperGoal, GripperResult, HandTask

_REACHED = 0.002  # from the width asked for [m]
_POLL = 0.02  # [s]
_DEFAULT_EFFORT = 20.0  # [N]
_FRESH = 0.25  # age of a state, wall clock [s]
_MOTION_TIME = 15.0  # longer takes no motion of the fingers, in a slow simulator neither; wall clock [s]


class Hand:
    """One hand, one goal at a time. Thread-safe: goals are executed in threads of their own.

    A hand that is lost refuses goals until `home` has connected it again; the arm goes on without it.

    Args:
        connect: connects the hand, now and whenever `home` is called after it was lost.
        model: opening, speed and force of the hand.
        on_loss: told, in words, that the hand was lost; in the hand's thread.
        period: between two readings of the state, wall clock [s].

    Raises:
        DriverError: when the hand cannot be connected.
    """

    def __init__(
        self,
        connect: Callable[[], HandPort],
        model: HandModel,
        on_loss: Callable[[str], None],
        period: float = 0.02,
    ) -> None:
        self._connect, self._model, self._on_loss, self._period = connect, model, on_loss, period
        self._port = connect()
        self._lost = ""  # why, until it is connected again
        self._state, self._read_at = self._port.read(), clock.monotonic()
        self._busy, self._reading = threading.Lock(), threading.Lock()
        self._halt = threading.Event()
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="hand", daemon=True)

    def start_thread(self) -> None:
        """Begin to read the states."""
        self._thread.start()

    def stop_thread(self) -> None:
        """Stop the fingers and end the thread."""
        self.halt()
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(2.0)

    @property
    def state(self) -> HandState:
        """The newest state."""
        return self._state

    @property
    def lost(self) -> str:
        """Cause of the hand's loss, in words; empty while it is not lost."""
        return self._lost

    def is_fresh(self) -> bool:
        """Return True if the newest state was read a moment ago: an older one says nothing about now."""
        return not self._lost and clock.monotonic() - self._read_at < _FRESH

    @property
    def moving(self) -> bool:
        """True while a goal is executed."""
        return self._busy.locked()

    def check(self, goal: GripperGoal) -> None:
        """Raise HandGoalError, in words, unless the goal would be taken now."""
        half = self._model.opening / 2.0
        if not -1e-6 <= goal.position <= half + 1e-6:
            raise HandGoalError(f"position {goal.position:g} m is half a width: it must be in 0..{half:g} m")
        if not 0.0 <= goal.max_effort < math.inf:
            raise HandGoalError(f"max_effort must be zero (default) or positive, got {goal.max_effort:g} N")
        if not 0.0 <= goal.speed < math.inf:
            raise HandGoalError(f"speed must be zero (the hand's) or positive, got {goal.speed:g} m/s")
        if self._busy.locked():
            raise HandGoalError("another goal is executed: cancel it first")
        if goal.task is HandTask.HOMING:
            return
        if self._lost:
            raise HandGoalError(self._lost)
        if self._state.max_width <= 0.0:
            raise HandGoalError("the hand does not know its range: call ~/home_gripper")

    def execute(self, goal: GripperGoal) -> tuple[GoalStatus, GripperResult, str]:
        """Move the fingers to the goal's end; return how it ended, where, and why.

        `stalled` is true where something stopped the fingers before the width asked for: then it is held.
        """
        if not self._busy.acquire(blocking=False):
            return GoalStatus.ABORTED, self.report(), "another goal is executed"
        try:
            self._halt.clear()
            return self._do(goal)
        except DriverError as error:
            return GoalStatus.ABORTED, self.report(), str(error)
        finally:
            self._busy.release()

    def home(self) -> None:
        """Find the fingers' range, of a lost hand once it is connected again. Raises DriverError when that fails."""
        if not self._busy.acquire(blocking=False):
            raise HandFaultError("a goal is executed: cancel it first")
        try:
            self._halt.clear()
            self._home()
        finally:
            self._busy.release()

    def halt(self) -> None:
        """Stop the fingers where they are, if they move."""
        self._halt.set()

    def report(self, effort: float = 0.0, stalled: bool = False, reached: bool = False) -> GripperResult:
        """Return the full width as it is now, with what else is given."""
        return GripperResult(self._state.width, effort, stalled, reached)

    def _do(self, goal: GripperGoal) -> tuple[GoalStatus, GripperResult, str]:
        """Execute a goal of whichever task."""
        if goal.task is HandTask.HOMING:
            self._home()
            return GoalStatus.SUCCEEDED, self.report(reached=True), ""
        width = min(max(2.0 * goal.position, 0.0), self._state.max_width)
        speed = min(goal.speed or self._model.speed, self._model.speed)
        effort = min(goal.max_effort or _DEFAULT_EFFORT, self._model.allowed_force)
        if goal.task is HandTask.GRASP:
            return self._end_grasp(self._port.grasp(width, speed, effort, goal.epsilon), effort)
        if goal.task is HandTask.COMMAND and width < self._state.width - 1e-4:
            return self._end(self._port.grasp(width, speed, effort, None), width, effort)
        return self._end(self._port.move(width, speed), width, 0.0)

    def _home(self) -> None:
        if self._lost:
            self._port = self._connect()
            self._read()
            self._lost = ""
        motion = self._port.home()
        if self._wait(motion) is not None or not motion.succeeded():
            raise HandFaultError("the homing did not end: is something between the fingers?")
        self._read()

    def _end_grasp(self, motion: HandMotion, effort: float) -> tuple[GoalStatus, GripperResult, str]:
        """Wait for the end of a grasp that the hand itself judges by its epsilon."""
        stopped = self._wait(motion)
        if stopped is not None:
            return stopped[0], self.report(), stopped[1]
        done = motion.succeeded()
        self._read()
        if done:
            return GoalStatus.SUCCEEDED, self.report(effort, reached=True), ""
        words = f"the fingers stand at {self._state.width:.4f} m, outside of the grasp's epsilon"
        return GoalStatus.ABORTED, self.report(), words

    def _end(self, motion: HandMotion, width: float, effort: float) -> tuple[GoalStatus, GripperResult, str]:
        """Wait for a motion's end; effort: with which the fingers close, 0 where they open."""
        stopped = self._wait(motion)
        if stopped is not None:
            status, words = stopped
            return status, self.report(), words
        done = motion.succeeded()
        self._read()
        off = self._state.width - width
        reached = abs(off) <= _REACHED
        stalled = done and effort > 0.0 and off > _REACHED
        if reached or stalled:
            return GoalStatus.SUCCEEDED, self.report(effort if stalled else 0.0, stalled, reached), ""
        words = f"the fingers stand at {self._state.width:.4f} m, asked for {width:.4f} m"
        return GoalStatus.ABORTED, self.report(), words

    def _wait(self, motion: HandMotion) -> tuple[GoalStatus, str] | None:
        """Wait: None when the motion has ended by itself, otherwise how it was stopped and why."""
        deadline = clock.monotonic() + _MOTION_TIME
        while not motion.wait(_POLL):
            if self._halt.is_set():
                self._port.stop()  # whether the motion itself is ever answered then is up to the hand
                return GoalStatus.CANCELED, "stopped on request"
            if clock.monotonic() > deadline:
                self._port.stop()
                return GoalStatus.ABORTED, f"the fingers did not end within {_MOTION_TIME:g} s"
        return None

    def _read(self) -> None:
        with self._reading:
            self._state, self._read_at = self._port.read(), clock.monotonic()

    def _run(self) -> None:
        while not self._stopping.wait(self._period):
            if self._lost:
                continue
            try:
                self._read()
            except DriverError as error:
                self._lost = str(error)
                self._on_loss(self._lost)
