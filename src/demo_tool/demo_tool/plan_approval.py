"""A person's approval of the plan with which a motion waits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from demo_tool.bulletin import Bulletin
from demo_tool.errors import NotNowError
from demo_tool.motion import Motion
from demo_tool.ports import Arm

_NO_ANSWER = "the executor gave no answer to the approval: approve once more, or stop"


class PlanApproval:
    """Approval of plans by their ids, as the executor answers it. The bulletin's lock guards it.

    answer_timeout: longest wait for the executor's answer [s]; motion: returns the present motion, None without one.
    Times are those of a steady clock [s], handed in.
    """

    def __init__(
        self, arm: Arm, bulletin: Bulletin, answer_timeout: float, motion: Callable[[], Motion | None]
    ) -> None:
        self._arm, self._bulletin, self._answer_timeout = arm, bulletin, answer_timeout
        self._motion = motion
        self._asked: tuple[str, float] | None = None  # a plan whose approval is not answered, and when it was sent
        self._refused = ("", "")  # the plan whose approval was not taken, and why
        self._approved = ""

    def forget(self) -> None:
        """Forget what was asked of earlier plans, with the lock held, as another motion begins."""
        self._asked, self._refused, self._approved = None, ("", ""), ""

    def waiting(self, motion: Motion | None) -> str:
        """Return the id of the plan with which the motion waits for a person, "" while it does not."""
        plan_id = "" if motion is None else motion.waiting_plan
        return "" if plan_id == self._approved else plan_id

    def approve(self, plan_id: str, now: float) -> None:
        """Have the executor approve the plan of that id. Raises NotNowError unless that one waits, unanswered."""
        with self._bulletin.lock:
            waiting = self.waiting(self._motion())
            if not waiting:
                raise NotNowError("no plan waits for your approval")
            if plan_id != waiting:
                named = plan_id or "one without an id"
                raise NotNowError(f"the plan that waits is {waiting}, not {named}: look at it first")
            if self._is_asked(plan_id):
                raise NotNowError(f"the approval of plan {plan_id} is on its way")
            self._asked, self._refused = (plan_id, now), ("", "")
            self._bulletin.touch()
            self._arm.approve(plan_id, lambda ok, words: self._on_answer(plan_id, ok, words))

    def tick(self, now: float) -> None:
        """End a wait for an answer that has lasted too long; to be called often."""
        if self._asked is not None and now - self._asked[1] > self._answer_timeout:
            self._refuse(self._asked[0], _NO_ANSWER)

    def shown(self) -> dict[str, Any] | None:
        """Return the interface Approval of static/protocol.d.ts, None where no plan waits."""
        plan_id = self.waiting(self._motion())
        if not plan_id:
            return None
        refused, why = self._refused
        return {"plan": plan_id, "asked": self._is_asked(plan_id), "words": why if refused == plan_id else ""}

    def _is_asked(self, plan_id: str) -> bool:
        return self._asked is not None and self._asked[0] == plan_id

    def _on_answer(self, plan_id: str, ok: bool, words: str) -> None:
        with self._bulletin.lock:
            if not ok:
                self._refuse(plan_id, words)
                return
            self._asked, self._approved = None, plan_id
            self._bulletin.say(words)

    def _refuse(self, plan_id: str, words: str) -> None:
        self._asked, self._refused = None, (plan_id, words)
        self._bulletin.refuse(f"plan {plan_id} is not approved: {words}")
