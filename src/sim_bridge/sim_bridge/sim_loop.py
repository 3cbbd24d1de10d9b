"""The thread that owns a simulated world: steps it at wall time's pace and runs its controllers."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Any, Protocol, TypeVar

from sim_bridge.control.gripper_controller import GripperController, GripperExecution
from sim_bridge.control.joint_trajectory_controller import JointTrajectoryController, TrajectoryExecution
from sim_bridge.errors import SimulationError

T = TypeVar("T")
_HELD_S = 0.002  # from one look to the next while time is held [s]
Execution = TrajectoryExecution | GripperExecution


class SteppedWorld(Protocol):
    """The part of SimWorld that a loop drives."""

    panda: Any

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        ...

    def step(self) -> None:
        """Advance physics by one step."""
        ...


class Pacer(Protocol):
    """Says how many steps are due: RealTimePacer, or another arm whose time is followed."""

    def due(self, now: float) -> int:
        """Return the number of steps to make at wall time `now` [s]."""
        ...

    def delay(self, now: float) -> float:
        """Return how long [s] from `now` until the next look."""
        ...


@dataclass
class _Listener:
    period: float
    callback: Callable[[float, Any], None]
    next_time: float = 0.0


class SimLoop:
    """Owns `world` on one thread: nobody else may touch it, or the controllers, but through `call`.

    Times that listeners get are simulated ones [s].
    """

    def __init__(
        self,
        world: SteppedWorld,
        arm: JointTrajectoryController,
        gripper: GripperController,
        pacer: Pacer,
        on_failure: Callable[[BaseException], None] = lambda error: None,
    ) -> None:
        self.world = world
        self.arm = arm
        self.gripper = gripper
        self._pacer = pacer
        self._on_failure = on_failure
        self._jobs: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._listeners: list[_Listener] = []
        self._held_by: Callable[[], bool] = lambda: False
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="physics", daemon=True)

    def every(self, period: float, callback: Callable[[float, Any], None]) -> None:
        """Have `callback(time, arm_state)` called every `period` s of simulated time; before `start` only."""
        self._listeners.append(_Listener(period, callback))

    def hold_while(self, busy: Callable[[], bool]) -> None:
        """Have simulated time stand still while `busy()`, which is asked before each step; before `start` only."""
        self._held_by = busy

    def start(self) -> None:
        """Begin to step."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread; whatever waits for it is released."""
        self._stopping.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout=5.0)

    def call(self, function: Callable[[], T], timeout: float = 30.0) -> T:
        """Run `function` between two steps; return what it returns or raise what it raises.

        Raises SimulationError when the loop has ended, or has not finished within `timeout` s of wall time. What had
        not begun by then is never run; the message says which it is.
        """
        if threading.current_thread() is self._thread:
            return function()
        future: Future[T] = Future()

        def job() -> None:
            if not future.set_running_or_notify_cancel():
                return
            try:
                future.set_result(function())
            except Exception as error:
                future.set_exception(error)

        self._jobs.put(job)
        deadline = time.monotonic() + timeout
        while not self._stopping.is_set() and time.monotonic() < deadline:
            try:
                return future.result(timeout=0.2)
            except TimeoutError:
                if future.done():
                    raise
        if not future.cancel() and future.done():
            return future.result()
        raise SimulationError(self._why_unfinished(future, timeout))

    def _why_unfinished(self, future: Future[T], timeout: float) -> str:
        if self._stopping.is_set():
            return "the simulation has stopped"
        if future.cancelled():
            return f"the simulation was busy for {timeout:g} s and has not done this: ask again"
        return f"the simulation still does this after {timeout:g} s: wait, then look at the scene"

    def wait(self, execution: Execution, timeout: float) -> bool:
        """Wait up to `timeout` s of wall time for `execution` to end; return whether it has."""
        deadline = time.monotonic() + timeout
        while not execution.done and time.monotonic() < deadline:
            time.sleep(0.005)
        return execution.done

    def _run(self) -> None:
        try:
            while not self._stopping.is_set():
                self._run_jobs()
                if self._make(self._pacer.due(time.monotonic())):
                    time.sleep(min(self._pacer.delay(time.monotonic()), 0.01))
                else:
                    time.sleep(_HELD_S)
        except Exception as error:
            self._on_failure(error)
        finally:
            self._stopping.set()
            self._end()

    def _make(self, steps: int) -> bool:
        """Make steps; return False if time is held, and what is left of them is dropped."""
        for _ in range(steps):
            if self._held_by():
                return False
            self._tick()
        return True

    def _run_jobs(self) -> None:
        while True:
            try:
                self._jobs.get_nowait()()
            except Empty:
                return

    def _tick(self) -> None:
        world, now = self.world, self.world.time
        state = world.panda.state()
        arm = self.arm.update(now, state)
        fingers = self.gripper.update(now, state)
        world.panda.command(arm.positions, arm.velocities)
        world.panda.command_fingers(fingers.width, fingers.max_effort)
        for listener in self._listeners:
            if now >= listener.next_time - 1e-9:
                late = now > listener.next_time + listener.period
                listener.next_time = now + listener.period if late else listener.next_time + listener.period
                listener.callback(now, state)
        world.step()

    def _end(self) -> None:
        reason = "the simulation has stopped"
        self.arm.reset(reason)
        self.gripper.reset(reason)
