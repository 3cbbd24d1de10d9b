"""The policy server's state machine in a world of its own: a fake executor, policy and clock."""

from __future__ import annotations

from typing import Any

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_core.pose import PlanarPose
from cliport_policy.errors import InstructionError
from cliport_policy.inference import Inference
from cliport_policy.server.logic import PolicyServer
from cliport_policy.server.types import Answer, Moment, ServerConfig

S = 1_000_000_000
GOAL = "put the red blocks in the green bowl"


def inference(
    done: float = 0.0,
    confidence: float = 0.9,
    primitive: Primitive = Primitive.PICK_PLACE,
    absent: float = 0.0,
    missing: str = "",
) -> Inference:
    pose = PlanarPose(0.4, 0.1, 0.3)
    action = PickPlaceAction(pose, pose, primitive, confidence)
    nulls = {"absent_probability": absent, "missing": missing}
    return Inference(action, (200, 60), (200, 60), confidence, confidence, done, **nulls)  # type: ignore[arg-type]


class World:
    """Fakes of all ports, and a server on two clocks that `wait` moves."""

    def __init__(self, **settings: Any) -> None:
        self.now = Moment(100.0, 5000 * S)
        self.ready = True
        self.statuses: list[ServerStatus] = []
        self.proposals: list[ActionGoal] = []
        self.inferences: list[tuple[int, Any, str]] = []
        self.goals: list[tuple[int, ActionGoal]] = []
        self.cancelled: list[int] = []
        self.approved: list[str] = []
        self.stops = self.resumes = 0
        self.server = PolicyServer(ServerConfig(**settings), self, self.check_instruction, self)

    # effects

    def publish_status(self, status: ServerStatus) -> None:
        self.statuses.append(status)

    def publish_proposal(self, goal: ActionGoal) -> None:
        self.proposals.append(goal)

    def start_inference(self, token: int, observation: Any, instruction: str) -> None:
        self.inferences.append((token, observation, instruction))

    def check_instruction(self, instruction: str) -> None:
        if "block" not in instruction:
            raise InstructionError(f"the instruction '{instruction}' is not understood")

    def agree(self) -> Answer:
        """Approve what waits, or nothing."""
        return self.server.approve(self.statuses[-1].proposal_id if self.statuses else "", self.now)

    # executor

    def is_ready(self) -> bool:
        return self.ready

    def send(self, token: int, goal: ActionGoal) -> None:
        self.goals.append((token, goal))

    def cancel(self, token: int) -> None:
        self.cancelled.append(token)

    def stop(self) -> bool:
        self.stops += 1
        return self.ready

    def resume(self) -> bool:
        self.resumes += 1
        return self.ready

    def approve(self, plan_id: str) -> bool:
        self.approved.append(plan_id)
        return self.ready

    # events

    @property
    def state(self) -> PolicyState:
        return self.server.status.state

    @property
    def message(self) -> str:
        return self.server.status.message

    def wait(self, seconds: float, heartbeat: bool = True) -> None:
        for _ in range(max(1, round(seconds / 0.05))):
            self.now = Moment(self.now.wall + 0.05, self.now.ros_ns + S // 20)
            if heartbeat:
                self.server.on_heartbeat(self.now)
            self.server.tick(self.now)

    def say(self, text: str = GOAL) -> None:
        self.server.on_instruction(text, self.now)

    def see(self, age_s: float = 0.0, wait_s: float = 0.3) -> None:
        self.wait(wait_s)
        self.server.on_observation(self.now.ros_ns - int(age_s * S), f"view {self.now.wall:.2f}", self.now)

    def think(self, **answer: Any) -> None:
        self.server.on_proposal(self.inferences[-1][0], inference(**answer), self.now)

    def accept(self) -> None:
        self.server.on_goal_response(self.goals[-1][0], True, self.now)

    def end(self, outcome: Outcome = Outcome.SUCCEEDED, message: str = "") -> None:
        self.server.on_result(self.goals[-1][0], ActionResult(outcome, message), self.now)

    def act(self, outcome: Outcome = Outcome.SUCCEEDED, message: str = "") -> None:
        """One whole step: see, think, move."""
        self.see()
        self.think()
        self.accept()
        self.wait(1.0)
        self.end(outcome, message)

    def start_moving(self) -> None:
        self.say()
        self.see()
        self.think()
        self.accept()
        assert self.state == PolicyState.EXECUTING
