"""Request for the policy server's proposal, which is not executed."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum

from cliport_core.action import ActionGoal, PickPlaceAction
from cliport_core.policy_state import PolicyState, ServerStatus
from cliport_core.pose import PlanarPose
from demo_tool.bulletin import Bulletin
from demo_tool.ports import Policy
from demo_tool.station_config import StationConfig

_CHECK_TIMEOUT = 3.0  # for the server's answer about its parameter [s]


class _Stage(Enum):
    """Stage of a request; the value says what was waited for in vain."""

    CHECKING = "no answer came as to whether the policy server waits for approval"
    ASKED = "the policy's proposal did not come in time"
    ENDED = ""


class ProposalRequest:
    """One request for a proposal; it ends once, with the proposal or the reason why there is none.

    The server must wait for approval, or it would move the arm: that is asked first. As soon as its poses are known
    it is told to drop its goal, so that no approval from elsewhere can start what a person is about to change.
    """

    def __init__(
        self,
        policy: Policy,
        instruction: str,
        config: StationConfig,
        on_end: Callable[[ActionGoal | None, str], None],
    ) -> None:
        self.instruction = instruction
        self._policy, self._config, self._on_end = policy, config, on_end
        self._stage = _Stage.CHECKING
        self._deadline: float  # as of a steady clock [s], from `begin` on
        self._poses: dict[str, tuple[PlanarPose, int]] = {}
        self._waiting: ServerStatus | None = None  # the status with which the server waits for approval

    def begin(self, now: float) -> None:
        """Ask the server whether it waits for approval; now: a steady clock's time [s]."""
        self._deadline = now + _CHECK_TIMEOUT
        self._policy.ask_require_approval(lambda waits: self._on_answer(waits, now))

    def cancel(self, why: str) -> None:
        """End without a proposal."""
        if self._stage is _Stage.ASKED:
            self._policy.instruct("")
        self._end(None, why)

    def _on_answer(self, waits: bool | None, began: float) -> None:
        if self._stage is not _Stage.CHECKING:
            return
        if waits is None:
            self._end(None, "the policy server does not answer: is it running? (node cliport_policy)")
        elif not waits:
            self._end(
                None,
                "the policy server would move the arm without asking: start it with require_approval:=true to "
                "correct its proposals",
            )
        else:
            self._stage, self._deadline = _Stage.ASKED, began + self._config.proposal_timeout
            self._policy.instruct(self.instruction)

    def on_status(self, status: ServerStatus) -> None:
        """Take a status of the server."""
        if self._stage is not _Stage.ASKED or status.instruction != _published_instruction(self.instruction):
            return
        if status.state in (PolicyState.FAILED, PolicyState.IDLE):
            self._end(None, f"the policy gives no proposal: {status.message}")
        elif status.state is PolicyState.DONE:
            self._end(None, f"the policy would do nothing: {status.message}")
        elif status.state is PolicyState.EXECUTING:
            self.cancel("the policy server began to move without approval and was told to stop")
        elif status.state is PolicyState.WAITING_FOR_APPROVAL:
            self._waiting = status
            self._finish_when_complete()

    def on_pose(self, which: str, pose: PlanarPose, stamp_ns: int) -> None:
        """Take the server's pose of "pick" or "place", chosen on the picture of stamp_ns."""
        if self._stage is _Stage.ASKED:
            self._poses[which] = pose, stamp_ns
            self._finish_when_complete()

    def tick(self, now: float) -> None:
        """End a request that has waited too long; to be called often. now: as for `begin`."""
        if self._stage is not _Stage.ENDED and now > self._deadline:
            self.cancel(f"{self._stage.value}: is the policy server running?")

    def _finish_when_complete(self) -> None:
        stamps = {stamp_ns for _, stamp_ns in self._poses.values()}
        if self._waiting is None or len(stamps) != 1 or len(self._poses) < 2:
            return
        pick, place = (self._poses[which][0] for which in ("pick", "place"))
        action = PickPlaceAction(pick, place, self._waiting.primitive, self._waiting.confidence)
        self._policy.instruct("")
        self._end(ActionGoal(action, self.instruction, stamps.pop()), "")

    def _end(self, proposal: ActionGoal | None, why: str) -> None:
        if self._stage is not _Stage.ENDED:
            self._stage = _Stage.ENDED
            self._on_end(proposal, why)


class Proposals:
    """Proposals of the policy server, one request at a time. The bulletin's lock guards it, and is told of its ends.

    newest: the last proposal, None without one; request: the one that is not answered yet.
    """

    def __init__(self, policy: Policy, config: StationConfig, bulletin: Bulletin) -> None:
        self._policy, self._config, self._bulletin = policy, config, bulletin
        self.newest: ActionGoal | None = None
        self.request: ProposalRequest | None = None

    def begin(self, instruction: str, now: float) -> None:
        """Ask the policy, with the lock held; now: a steady clock's time [s]."""
        self.newest = None
        self._bulletin.clear_failure()
        self.request = ProposalRequest(self._policy, instruction, self._config, self._on_proposal)
        self.request.begin(now)
        self._bulletin.touch()

    def cancel(self, why: str) -> None:
        """End the present request, if there is one."""
        if self.request is not None:
            self.request.cancel(why)

    def tick(self, now: float) -> None:
        """End a request that has waited too long; to be called often. now: as for `begin`."""
        if self.request is not None:
            self.request.tick(now)

    def _on_proposal(self, proposal: ActionGoal | None, why: str) -> None:
        with self._bulletin.lock:
            self.request, self.newest = None, proposal
            if proposal is None:
                self._bulletin.fail(why)
            else:
                self._bulletin.say("the policy has a proposal: correct it, or draw your own")


def _published_instruction(text: str) -> str:
    """Return an instruction as the server publishes it: with blanks for joiners, which some scripts need."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
