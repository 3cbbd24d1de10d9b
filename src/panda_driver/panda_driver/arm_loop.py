"""The thread that drives the arm: reads its state, asks the trajectory controller, hands on its reference."""

from __future__ import annotations

import threading
import time as clock
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace

import numpy as np

from panda_driver.errors import ArmFaultError, DriverError
from panda_driver.ports import ArmPort, ArmState
from panda_driver.thread_priority import put_this_thread_first
from sim_bridge.control.arm_reflex import ArmControllerConfig
from sim_bridge.control.joint_trajectory_controller import (
    ErrorCode,
    GoalRejectedError,
    JointTrajectoryController,
    TrajectoryExecution,
    TrajectoryFeedback,
)
from sim_bridge.control.trajectory_goal import TrajectoryGoal

PERIOD_S = 0.004  # between two turns, wall clock
LATE_S = 0.05  # of the arm's time, by which the reference goes on in one turn at most: so far the arm goes without one
TELL_S = 0.5  # from the arm's loss until the loop says that it ended: so goals are told first, wall clock
STALLED_S = 0.15  # after which the arm has come to rest by itself, and a trajectory would begin with a jump
HOLD_S = 0.3  # for which the driver keeps control once the reference is at rest, the arm's clock


class ArmLoop:
    """Drives one arm by trajectories, one at a time. Trajectories run in the arm's own time.

    The rules for goals, tolerances and braking are the simulator's controller's, which are those of
    joint_trajectory_controller. The arm is controlled only while a trajectory runs, else it holds by itself. When this
    process was held up, the trajectory goes on where the arm is, and ends later; after STALLED_S it is aborted.

    Args:
        on_state: told of each state that is read, in the loop's thread.
        on_failure: told of the error that ended the loop.
    """

    def __init__(
        self,
        port: ArmPort,
        config: ArmControllerConfig,
        on_state: Callable[[ArmState], None],
        on_failure: Callable[[BaseException], None],
    ) -> None:
        self._port, self._on_state, self._on_failure = port, on_state, on_failure
        self._controller = JointTrajectoryController(config)
        self._lock = threading.RLock()
        self._in_control, self._rest_since = False, 0.0
        self._held_up = 0.0  # by how much the trajectory is late [s]
        self._fault = ""  # of the last motion, until the errors are cleared
        self._state = port.read()
        self._recovery: Future[None] | None = None
        self._ended = ""  # by which error the loop ended
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run_first, name="arm", daemon=True)

    def start_thread(self) -> None:
        """Begin to drive."""
        self._thread.start()

    def stop_thread(self) -> None:
        """Brake, give control back and end the thread."""
        self.hold("the driver ends")
        deadline = clock.monotonic() + 3.0
        while self._in_control and self._thread.is_alive() and clock.monotonic() < deadline:
            clock.sleep(PERIOD_S)
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(2.0)
        self._port.close()

    @property
    def state(self) -> ArmState:
        """The newest state."""
        return self._state

    @property
    def time(self) -> float:
        """The time [s] by which trajectories run: the arm's, less what this process was held up in this motion."""
        return self._state.time - self._held_up

    @property
    def moving(self) -> bool:
        """True while a trajectory is executed, or braked."""
        return self._controller.active is not None

    def check(self, goal: TrajectoryGoal) -> None:
        """Raise GoalRejectedError, in words, unless the goal would be taken now; its start_time is by `time`."""
        with self._lock:
            fault = self._fault or self._state.fault
            if fault:
                raise GoalRejectedError(ErrorCode.INVALID_GOAL, fault)
            if self._controller.active is not None:
                raise GoalRejectedError(ErrorCode.INVALID_GOAL, "another goal is executed: cancel it first")
            self._controller.check(goal, self.time, self._state)

    def start(self, goal: TrajectoryGoal) -> TrajectoryExecution:
        """Take a goal. Raises GoalRejectedError as `check` does."""
        with self._lock:
            self.check(goal)
            return self._controller.start(goal, self.time)

    def cancel(self, execution: TrajectoryExecution) -> None:
        """Brake along the path and hold, where this goal still runs."""
        with self._lock:
            if self._controller.active is execution:
                self._controller.cancel()

    def hold(self, reason: str) -> None:
        """Brake along the path and hold; the goal, if there is one, is aborted with the reason."""
        with self._lock:
            self._controller.hold(reason)

    def feedback(self) -> TrajectoryFeedback | None:
        """Return the desired and the actual motion; None before the first."""
        with self._lock:
            return self._controller.feedback()

    def recover(self, timeout: float) -> None:
        """Clear the arm's errors. Raises ArmFaultError when they stay, or a goal is executed."""
        with self._lock:
            if self.moving:
                raise ArmFaultError("a goal is executed: cancel it first")
            if self._ended:
                raise ArmFaultError(self._ended)
            asked: Future[None] = Future()
            self._recovery = asked
        try:
            asked.result(timeout)
        except TimeoutError:
            raise ArmFaultError(f"no answer from the arm for {timeout:g} s") from None

    def turn(self) -> None:
        """Do one turn: read, decide, hand on. Raises ConnectionFailedError when the arm is lost."""
        state = self._port.read()
        with self._lock:
            recovery, self._recovery = self._recovery, None
            if recovery is not None:
                self._recover(recovery)
            if self._fault and not state.fault:
                state = replace(state, fault=self._fault)
            if self._in_control:
                self._catch_up(state.time - self._state.time)
            self._state = state
            try:
                self._drive(state)
            except ArmFaultError as error:
                self._give_up(str(error))
        self._on_state(state)

    def _catch_up(self, gap: float) -> None:
        """Let the trajectory be as late as the arm is, or end, where no reference came for `gap` s."""
        if gap > STALLED_S:
            self._controller.reset(f"the driver was held up for {gap:.2f} s; the arm holds")
        self._held_up += max(gap - LATE_S, 0.0)

    def _drive(self, state: ArmState) -> None:
        if state.fault:
            if self._controller.active is not None or self._in_control:
                self._give_up(state.fault)
            return
        if self._controller.active is None and not self._in_control:
            return
        if not self._in_control:
            self._port.begin()
            state = self._state = self._port.read()  # taking control takes a while
            self._in_control, self._rest_since = True, state.time
        command = self._controller.update(self.time, state)
        self._port.follow(command.positions, command.velocities, command.accelerations)
        if self._controller.active is not None or np.any(command.velocities != 0.0):
            self._rest_since = state.time
        elif state.time - self._rest_since >= HOLD_S:
            self._release("")

    def _give_up(self, fault: str) -> None:
        """Abort what runs: the arm has stopped by itself."""
        self._fault = fault
        self._release(fault)

    def _release(self, reason: str) -> None:
        self._in_control, self._held_up = False, 0.0
        self._port.end()
        self._controller.reset(reason)  # it may be moved by hand now: what was commanded says nothing any more

    def _recover(self, asked: Future[None]) -> None:
        try:
            if not self._in_control:  # an arm that lets itself be controlled has no errors
                self._port.recover()
        except DriverError as error:
            asked.set_exception(error)
        else:
            self._fault = ""
            asked.set_result(None)

    def _run_first(self) -> None:
        put_this_thread_first()
        self._run()

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                begin = clock.monotonic()
                self.turn()
                clock.sleep(max(PERIOD_S - (clock.monotonic() - begin), 0.0005))
        except Exception as error:
            with self._lock:
                self._ended = str(error)
                self._controller.reset(self._ended)
                if self._recovery is not None:
                    self._recovery.set_exception(ArmFaultError(self._ended))
            self._stopping.wait(TELL_S)
            self._on_failure(error)
            if not isinstance(error, DriverError):
                raise
