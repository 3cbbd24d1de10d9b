"""Services of the policy server for a person: stop, resume and approve."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from std_srvs.srv import Trigger

from cliport_core import topics
from cliport_core.ros_late_service import Give, LateService
from cliport_interfaces.srv import ApprovePlan
from cliport_policy.server.executor_link import ExecutorLink
from cliport_policy.server.logic import PolicyServer
from cliport_policy.server.types import Answer, Moment
from cliport_policy.server.wording import APPROVAL_UNHEARD, RESUME_UNHEARD


class PersonServices:
    """Offers the services; what concerns the executor is answered with what that says, or that it says nothing."""

    def __init__(self, node: Node, server: PolicyServer, link: ExecutorLink, now: Callable[[], Moment]) -> None:
        self._server, self._link, self._now = server, link, now
        LateService(node, Trigger, topics.STOP, self._on_stop)
        LateService(node, Trigger, topics.RESUME, self._on_resume)
        LateService(node, ApprovePlan, topics.APPROVE, self._on_approve)

    def _on_stop(self, _: Any, give: Give) -> None:
        self._confirmed(self._server.stop(self._now()), self._server.confirm_stop, give)

    def _on_resume(self, _: Any, give: Give) -> None:
        answer = self._server.resume()

        def confirm(said: Answer | None) -> Answer:
            if said is None:
                return Answer(False, RESUME_UNHEARD)
            return answer if said.success else said

        self._confirmed(answer, confirm, give)

    def _on_approve(self, request: ApprovePlan.Request, give: Give) -> None:
        answer = self._server.approve(str(request.plan_id), self._now())
        self._confirmed(answer, lambda said: said or Answer(False, APPROVAL_UNHEARD), give)

    def _confirmed(self, answer: Answer, confirm: Callable[[Answer | None], Answer], give: Give) -> None:
        """Give the answer: what `confirm` makes of the executor's own, where that was asked."""
        if not self._link.when_answered(lambda said: give(*confirm(said))):
            give(*answer)
