"""Fakes for the station: an arm, a policy and a camera over a table with coloured blocks, without ROS."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cliport_core.action import ActionGoal, Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_core.pose import PlanarPose, Pose
from cliport_episodes.observation import Observation
from cliport_episodes.observation_messages import messages_from_observation
from cliport_perception.camera_model import CameraModel
from demo_tool.live_view import ColorImage, DepthImage, LiveView
from demo_tool.ports import ACCEPTED, APPROVAL, OnAnswer, OnEnd, OnFailure, OnPhase
from panda_model import load_preset

_PHASES = (
    "VALIDATING",
    "GRASP_PLANNING",
    "GO_ABOVE_PICK",
    "DESCEND",
    "CLOSE",
    "RAISE",
    "CARRY",
    "LOWER",
    "OPEN",
    "RETREAT",
)
_FRAME = "camera_color_optical_frame"
_ARM = load_preset()
_TABLE_COLOR = (122, 112, 102)


class Block(NamedTuple):
    """A block on the table at (x, y) [m]; size: along x, y and z [m]; color: RGB."""

    x: float
    y: float
    color: tuple[int, int, int] = (200, 40, 40)
    size: tuple[float, float, float] = (0.04, 0.04, 0.04)


BLOCKS = (Block(0.42, -0.12), Block(0.50, 0.12, (40, 70, 200)), Block(0.38, 0.02, (60, 170, 60)))


@dataclass
class FakeTable:
    """A table under a tilted camera. holes: (top, left, bottom, right) of the picture where no depth is known."""

    blocks: Sequence[Block] = BLOCKS
    width: int = 480
    height: int = 270
    holes: Sequence[tuple[int, int, int, int]] = ()
    camera_in_base: Pose = field(default_factory=lambda: Pose.looking_at((1.25, 0.0, 0.95), (0.45, 0.0, 0.0)))

    @property
    def camera(self) -> CameraModel:
        """Camera without distortion."""
        focal = 0.5625 * self.width
        return _camera(self.width, self.height, focal)

    def live_view(self, stamp_ns: int, received_ns: int | None = None) -> LiveView:
        """Return the camera's present view, with the messages that a real one would have sent."""
        color, depth = self._cast()
        received = stamp_ns if received_ns is None else received_ns
        seen = Observation(
            stamp_ns, color, depth, self.camera, self.camera_in_base, dict.fromkeys(_ARM.arm_joints, 0.0)
        )
        raw = tuple(messages_from_observation(seen, _FRAME, _ARM.base_frame, received_ns=received))
        return LiveView(stamp_ns, received, _FRAME, self.camera, self.camera_in_base, raw, lambda: color, lambda: depth)

    def box_around(self, block: Block, margin: int = 3) -> list[int]:
        """Return the box [top, left, bottom, right] around a block, `margin` pixels larger on each side."""
        sx, sy, sz = block.size
        corners = [(block.x + a * sx / 2, block.y + b * sy / 2, z) for a in (-1, 1) for b in (-1, 1) for z in (0.0, sz)]
        pixels = self.camera.project(self.camera_in_base.inverse().apply(corners))
        low, high = np.floor(pixels.min(axis=0)) - margin, np.ceil(pixels.max(axis=0)) + margin
        return [int(low[0]), int(low[1]), int(high[0]), int(high[1])]

    def box_at(self, x: float, y: float, half: int = 12) -> list[int]:
        """Return the box [top, left, bottom, right] around a point of the table [m]."""
        row, col = self.camera.project(self.camera_in_base.inverse().apply([[x, y, 0.0]]))[0]
        return [round(row) - half, round(col) - half, round(row) + half, round(col) + half]

    def move(self, start: PlanarPose, end: PlanarPose) -> None:
        """Carry the block nearest to `start`, if it is within 3 cm, to `end`."""
        distances = [float(np.hypot(b.x - start.x, b.y - start.y)) for b in self.blocks]
        nearest = int(np.argmin(distances))
        if distances[nearest] < 0.03:
            moved = self.blocks[nearest]._replace(x=end.x, y=end.y)
            self.blocks = [moved if i == nearest else block for i, block in enumerate(self.blocks)]

    def _cast(self) -> tuple[ColorImage, DepthImage]:
        rays = self.camera.rays().astype(np.float64) @ self.camera_in_base.rotation.T
        origin = self.camera_in_base.translation
        with np.errstate(divide="ignore"):
            depth = np.where(rays[..., 2] < 0.0, -origin[2] / rays[..., 2], np.inf)
        color: ColorImage = np.empty((*depth.shape, 3), np.uint8)
        color[:] = _TABLE_COLOR
        for block in self.blocks:
            half = np.array(block.size) / 2.0
            centre = np.array([block.x, block.y, half[2]])
            with np.errstate(divide="ignore", invalid="ignore"):
                a, b = (centre - half - origin) / rays, (centre + half - origin) / rays
            enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
            hit = (enter <= leave) & (enter < depth)
            depth[hit] = enter[hit]
            color[hit] = block.color
        depth[depth > 10.0] = np.nan
        for top, left, bottom, right in self.holes:
            depth[top:bottom, left:right] = np.nan
        return color, depth.astype(np.float32)


@lru_cache(maxsize=4)
def _camera(width: int, height: int, focal: float) -> CameraModel:
    return CameraModel(width, height, focal, focal, width / 2.0, height / 2.0)


@dataclass
class FakeArm:
    """Arm that executes goals at once, or in a thread with `pace` seconds a phase.

    result: how goals end, a plan with PLANNED where this says SUCCEEDED; silent: goals are never answered;
    fault_words: why it cannot be used; on_success: what a goal that succeeds does to the world; waiting_plan: id of the
    plan with which goals wait for approval, "" where they do not wait; recovery_refusal: why it does not recover, ""
    where it does; on_recovered: what a recovery that nobody stops does to the world; held: width of what the hand
    holds; opening_refusal: why it does not open, "" where it does.
    """

    pace: float = 0.0
    result: ActionResult = field(
        default_factory=lambda: ActionResult(Outcome.SUCCEEDED, "done", (0.42, -0.12, 0.03), 0.04)
    )
    silent: bool = False
    fault_words: str | None = None
    on_success: Callable[[ActionGoal], None] = lambda goal: None
    waiting_plan: str = ""
    recovery_refusal: str = ""
    on_recovered: Callable[[], None] = lambda: None
    recoveries: int = 0
    held: float | None = None
    opening_refusal: str = ""
    openings: int = 0
    busy: bool = False
    goals: list[ActionGoal] = field(default_factory=list)
    checks: list[ActionGoal] = field(default_factory=list)
    holds_checks: bool = False
    cancelled_checks: int = 0
    end_check: Callable[..., None] = lambda: None
    stops: int = 0
    stopped: bool = False
    on_stop_failure: OnFailure = lambda words: None
    _cancel: threading.Event = field(default_factory=threading.Event)
    _approved: threading.Event = field(default_factory=threading.Event)

    def begin_anew(self, pace: float) -> None:
        """Forget what was asked of it, and obey at once."""
        for asked in (self.goals, self.checks):
            asked.clear()
        self.recoveries = self.openings = self.cancelled_checks = self.stops = 0
        self.pace, self.waiting_plan, self.held, self.recovery_refusal, self.opening_refusal = pace, "", None, "", ""

    def fault(self) -> str | None:
        """Return the words that were set."""
        return self.fault_words

    def send(self, goal: ActionGoal, on_phase: OnPhase, on_end: OnEnd) -> None:
        """Play all phases."""
        self.goals.append(goal)
        if self.silent:
            return
        if self.stopped:
            on_end(ActionResult(Outcome.REJECTED, "the executor is stopped"))
            return
        self._cancel = threading.Event()
        if self.pace:
            threading.Thread(target=self._play, args=(goal, on_phase, on_end), daemon=True).start()
        else:
            self._play(goal, on_phase, on_end)

    def check(self, goal: ActionGoal, on_end: OnEnd) -> None:
        """Answer at once, unless `holds_checks`: then `end_check` is kept for the test."""
        self.checks.append(goal)

        def end(outcome: Outcome = Outcome.PLANNED) -> None:
            on_end(ActionResult(outcome, "a way was found" if outcome is Outcome.PLANNED else ""))

        self.end_check = end
        if not self.holds_checks:
            end()

    def cancel_check(self) -> None:
        """Take note of it."""
        self.cancelled_checks += 1

    def cancel(self) -> None:
        """End the present goal."""
        self._cancel.set()

    def approve(self, plan_id: str, on_answer: OnAnswer) -> None:
        """Let the goal go on whose plan has that id."""
        if plan_id != self.waiting_plan:
            on_answer(False, f"the plan that waits is {self.waiting_plan}, not {plan_id}")
            return
        on_answer(True, f"plan {plan_id} is approved")
        self._approved.set()

    def recover(self, on_answer: OnAnswer, on_end: Callable[[], None]) -> None:
        """Go back at once, or within ten times `pace`."""
        refusal = "stopped on request" if self.stopped else self.recovery_refusal
        on_answer(not refusal, refusal or "begun; the log says how it ends")
        if refusal:
            return
        self.recoveries += 1
        self._cancel = threading.Event()
        if self.pace:
            threading.Thread(target=self._go_back, args=(on_end,), daemon=True).start()
        else:
            self._go_back(on_end)

    def open_hand(self, on_answer: OnAnswer) -> None:
        """Let go, unless refused."""
        self.openings += 1
        if not self.opening_refusal:
            self.held = None
        on_answer(not self.opening_refusal, self.opening_refusal or "begun; the log says how it ends")

    def held_width(self) -> float | None:
        """Return what was set."""
        return self.held

    def is_busy(self) -> bool:
        """Return what was set."""
        return self.busy

    def stop(self, reason: str, on_failure: OnFailure) -> None:
        """End the present goal, and refuse others until `resume`; on_failure is kept for the test."""
        self.on_stop_failure = on_failure
        self.stops += 1
        self.stopped = True
        self._cancel.set()

    def resume(self) -> None:
        """End a stop."""
        self.stopped = False

    def _play(self, goal: ActionGoal, on_phase: OnPhase, on_end: OnEnd) -> None:
        on_phase(ACCEPTED, 0.0)
        phases = _PHASES[:2] if goal.plan_only or not _moves(self.result.outcome) else _PHASES
        for number, phase in enumerate(phases):
            on_phase(phase, number / len(phases))
            if phase == "GRASP_PLANNING" and self.waiting_plan and not goal.plan_only:
                self._await_approval(on_phase)
            if self.pace and self._cancel.wait(self.pace):
                on_end(ActionResult(Outcome.CANCELLED, f"cancelled during {phase.lower()}; the arm holds"))
                return
        result = self.result
        if goal.plan_only and result.outcome is Outcome.SUCCEEDED:
            result = replace(result, outcome=Outcome.PLANNED, message="a way was found")
        elif result.outcome is Outcome.SUCCEEDED:
            self.on_success(goal)
        on_end(result)

    def _await_approval(self, on_phase: OnPhase) -> None:
        self._approved.clear()
        on_phase(APPROVAL, 0.2, self.waiting_plan)
        while not self._approved.wait(0.01) and not self._cancel.is_set():
            pass

    def _go_back(self, on_end: Callable[[], None]) -> None:
        if not self._cancel.wait(10.0 * self.pace):
            self.on_recovered()
        on_end()


def _moves(outcome: Outcome) -> bool:
    return outcome not in (Outcome.REJECTED, Outcome.PLANNING_FAILED)


class FakePolicy:
    """Policy that proposes one pick and one place, when it waits for approval; attach the station to hear it."""

    def __init__(self, pick: PlanarPose, place: PlanarPose, waits: bool | None = True) -> None:
        self.pick, self.place, self.waits = pick, place, waits
        self.heard, self.loaded = list[str](), list[str]()
        self.on_status: Callable[[ServerStatus], None] = lambda *_: None
        self.on_pose: Callable[[str, PlanarPose, int], None] = lambda *_: None
        self.failure, self.confidence, self.primitive = "", 0.83, Primitive.PICK_PLACE

    def ask_require_approval(self, on_answer: Callable[[bool | None], None]) -> None:
        """Answer as was set."""
        on_answer(self.waits)

    def instruct(self, text: str) -> None:
        """Propose at once; an empty text drops the proposal."""
        self.heard.append(text)
        if not text:
            self.on_status(ServerStatus(PolicyState.IDLE, "stopped by an empty instruction", ""))
        elif self.failure:
            self.on_status(ServerStatus(PolicyState.FAILED, self.failure, text))
        else:
            self.on_status(ServerStatus(PolicyState.PROPOSING, "choosing", text))
            stamp_ns = time.monotonic_ns()
            self.on_pose("pick", self.pick, stamp_ns)
            self.on_pose("place", self.place, stamp_ns)
            waiting = ServerStatus(PolicyState.WAITING_FOR_APPROVAL, "proposal 12ab34cd waits", text)
            self.on_status(waiting._replace(confidence=self.confidence, primitive=self.primitive))

    def load(self, checkpoint: str, on_answer: OnAnswer) -> None:
        """Take note of it, or refuse."""
        self.loaded.append(checkpoint)
        on_answer(not self.failure, self.failure or f"loading the policy {checkpoint}")


class FakeScenes:
    """A simulator that makes scenes at once, or says why it does not."""

    def __init__(self, failure: str = "") -> None:
        self.failure, self.offered, self.made = failure, True, 0

    def are_offered(self) -> bool:
        """Answer as was set."""
        return self.offered

    def change(self, on_answer: OnAnswer) -> None:
        """Count the scenes; the sentence names the number."""
        if self.failure:
            on_answer(False, self.failure)
            return
        self.made += 1
        on_answer(True, f"put block {self.made} in the bowl")
