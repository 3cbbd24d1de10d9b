"""Asking the policy server where it would act, without letting it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from cliport_perception.policy_state import PolicyState
from cliport_perception.pose import PlanarPose
from demo_tool.ports import Policy
from demo_tool.station_config import StationConfig

_CHECK_TIMEOUT = 3.0  # for the server to say how it is set [s]


@dataclass(frozen=True)
class Proposal:
    """Where the policy would pick and place [m, rad, base frame], for an instruction.

    confidence: how sure it is, 0 to 1; None where it does not say.
    """

    instruction: str
    pick: PlanarPose
    place: PlanarPose
    confidence: float | None = None


class _Stage(Enum):
    CHECKING = "whether the policy server waits for approval"
    ASKED = "the policy's proposal"
    ENDED = "nothing"


class ProposalRequest:
    """One request; ends once, with a proposal or the reason why there is none.

    The server must wait for approval, or it would move the arm: that is asked first. As soon as its poses are known
    it is told to drop its goal, so that no approval from elsewhere can start what a person is about to change.
    """

    def __init__(
        self,
        policy: Policy,
        instruction: str,
        config: StationConfig,
        on_end: Callable[[Proposal | None, str], None],
    ) -> None:
        self.instruction = instruction
        self._policy, self._config, self._on_end = policy, config, on_end
        self._stage = _Stage.CHECKING
        self._deadline = 0.0
        self._poses: dict[str, tuple[PlanarPose, int]] = {}
        self._waits = False
        self._confidence: float | None = None

    def begin(self, now: float) -> None:
        """now: of a steady clock [s]."""
        self._deadline = now + _CHECK_TIMEOUT
        self._policy.ask_whether_it_waits(lambda waits: self._on_answer(waits, now))

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

    def on_status(self, state: PolicyState, message: str, instruction: str, confidence: float | None) -> None:
        """The server is in a state; confidence: in what waits for approval."""
        if self._stage is not _Stage.ASKED or instruction != _as_the_server_has_it(self.instruction):
            return
        if state is PolicyState.FAILED:
            self._end(None, f"the policy gives no proposal: {message}")
        elif state is PolicyState.DONE:
            self._end(None, f"the policy would do nothing: {message}")
        elif state is PolicyState.EXECUTING:
            self.cancel("the policy server began to move without approval and was told to stop")
        elif state is PolicyState.WAITING_FOR_APPROVAL:
            self._waits, self._confidence = True, confidence
            self._finish_when_complete()

    def on_pose(self, which: str, pose: PlanarPose, stamp_ns: int) -> None:
        """The server published where it would "pick" or "place"."""
        if self._stage is _Stage.ASKED:
            self._poses[which] = pose, stamp_ns
            self._finish_when_complete()

    def tick(self, now: float) -> None:
        """Call often."""
        if self._stage is not _Stage.ENDED and now > self._deadline:
            self.cancel(f"waited in vain for {self._stage.value}: is the policy server running?")

    def _finish_when_complete(self) -> None:
        if not self._waits or len({stamp for _, stamp in self._poses.values()}) != 1 or len(self._poses) < 2:
            return
        pick, place = (self._poses[which][0] for which in ("pick", "place"))
        proposal = Proposal(self.instruction, pick, place, self._confidence)
        self._policy.instruct("")
        self._end(proposal, "")

    def _end(self, proposal: Proposal | None, why: str) -> None:
        if self._stage is not _Stage.ENDED:
            self._stage = _Stage.ENDED
            self._on_end(proposal, why)


def _as_the_server_has_it(text: str) -> str:
    """The policy server writes blanks for joiners, which some scripts need."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
