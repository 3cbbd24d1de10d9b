"""A plan that waits for a person's approval: shown with its id, approved by that id alone, refused in words."""

from __future__ import annotations

from pathlib import Path

import pytest
from page_socket import ask, opened, until
from station_fakes import BLOCKS, FakeArm
from web_workplace import workplace

from cliport_core.action import ActionGoal
from cliport_core.outcome import ActionResult, Outcome
from demo_tool.ports import OnAnswer, OnEnd, OnPhase

PLAN = "1a2b3c4d"
EXPIRED = f"plan {PLAN} was not approved within 30 s (service /panda_executor/approve); nothing moved"


class WaitingArm(FakeArm):
    """Answers goals and approvals only when a test does."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[str] = []

    def send(self, goal: ActionGoal, on_phase: OnPhase, on_end: OnEnd) -> None:
        self.goals.append(goal)
        self.on_phase, self.on_end = on_phase, on_end

    def approve(self, plan_id: str, on_answer: OnAnswer) -> None:
        self.asked.append(plan_id)
        self.answer = on_answer


@pytest.fixture
def waiting(make_bench):
    """A bench whose arm waits with a plan."""
    bench = make_bench(WaitingArm())
    bench.begin()
    bench.draw()
    bench.do("execute")
    bench.arm.on_phase("GRASP_PLANNING", 0.1)
    bench.arm.on_phase("APPROVAL", 0.2, PLAN)
    return bench


def test_a_plan_that_waits_is_shown_with_its_id(waiting) -> None:
    assert waiting.state == "waiting_for_approval"
    assert waiting.view["approval"] == {"plan": PLAN, "asked": False, "words": ""}
    assert waiting.view["words"] == f"Waiting for approval: approve plan {PLAN}, or refuse it by STOP."
    assert "busy waiting for approval" in waiting.refused("pick", box=waiting.table.box_around(BLOCKS[0]), rotation=0)
    assert waiting.arm.asked == []


def test_the_plan_that_is_shown_is_approved_once_and_executed(waiting) -> None:
    before = waiting.station.changed
    waiting.do("approve", plan=PLAN)
    assert waiting.arm.asked == [PLAN] and waiting.view["approval"]["asked"]
    assert waiting.station.changed > before, "other pages are told"
    assert "on its way" in waiting.refused("approve", plan=PLAN)
    waiting.arm.answer(True, f"plan {PLAN} is approved")
    assert waiting.view["approval"] is None and waiting.last == f"plan {PLAN} is approved"
    assert waiting.state == "planning" and "checked again" in waiting.view["words"]
    assert "no plan waits" in waiting.refused("approve", plan=PLAN)
    waiting.arm.on_phase("GO_ABOVE_PICK", 0.3, PLAN)
    assert waiting.state == "executing"
    waiting.arm.on_end(ActionResult(Outcome.SUCCEEDED, "done"))
    assert [step["outcome"] for step in waiting.steps] == ["succeeded"] and waiting.arm.asked == [PLAN]


@pytest.mark.parametrize("other", ["ffffffff", "", PLAN[:-1]])
def test_another_plan_than_the_one_that_waits_is_not_approved(waiting, other) -> None:
    words = waiting.refused("approve", plan=other)
    assert f"the plan that waits is {PLAN}, not " in words
    assert "'plan' must be a text" in waiting.refused("approve", plan=None)
    assert waiting.arm.asked == [] and waiting.state == "waiting_for_approval"


def test_the_executors_reason_is_shown_and_the_plan_can_be_approved_again(waiting) -> None:
    waiting.do("approve", plan=PLAN)
    waiting.arm.answer(False, "the plan that waits is 99999999")
    assert waiting.view["approval"] == {"plan": PLAN, "asked": False, "words": "the plan that waits is 99999999"}
    assert waiting.last == f"plan {PLAN} is not approved: the plan that waits is 99999999"
    assert not waiting.view["last"]["ok"]
    waiting.do("approve", plan=PLAN)
    assert waiting.arm.asked == [PLAN, PLAN] and waiting.view["approval"]["words"] == ""
    waiting.wait(5.1)
    assert "no answer" in waiting.view["approval"]["words"] and not waiting.view["approval"]["asked"]


def test_a_plan_that_nobody_approves_in_time(waiting) -> None:
    waiting.wait(200.0)  # a person's time: the executor limits it
    assert waiting.state == "waiting_for_approval"
    waiting.arm.on_end(ActionResult(Outcome.REJECTED, EXPIRED))
    waiting.see()
    assert waiting.state == "failed" and EXPIRED in waiting.last and "nothing moved" in waiting.last
    assert waiting.view["approval"] is None and waiting.steps == []
    assert "no plan waits" in waiting.refused("approve", plan=PLAN)
    assert waiting.arm.asked == []


def test_an_approval_that_comes_too_late_leaves_the_reason(waiting) -> None:
    waiting.do("approve", plan=PLAN)
    waiting.arm.on_end(ActionResult(Outcome.REJECTED, EXPIRED))
    waiting.arm.answer(False, "no plan waits for approval")
    waiting.see()
    assert EXPIRED in waiting.view["words"] and waiting.state == "failed"
    assert waiting.last == f"plan {PLAN} is not approved: no plan waits for approval"


def test_stop_refuses_a_plan(waiting) -> None:
    waiting.do("stop")
    assert waiting.arm.stops == 1 and waiting.view["approval"] is None
    assert "no plan waits" in waiting.refused("approve", plan=PLAN)
    waiting.arm.on_end(ActionResult(Outcome.CANCELLED, "cancelled; nothing moved"))
    assert waiting.steps == [] and "nothing was recorded" in waiting.last and waiting.arm.asked == []


def test_each_plan_needs_its_own_approval(waiting) -> None:
    waiting.do("approve", plan=PLAN)
    waiting.arm.answer(True, "approved")
    waiting.arm.on_end(ActionResult(Outcome.PLANNING_FAILED, "the scene changed"))
    waiting.see()
    waiting.do("execute")
    waiting.arm.on_phase("APPROVAL", 0.2, "99999999")
    assert waiting.view["approval"]["plan"] == "99999999"
    assert "the plan that waits is 99999999" in waiting.refused("approve", plan=PLAN)
    waiting.arm.on_end(ActionResult(Outcome.REJECTED, "not approved"))
    waiting.see()
    waiting.do("execute")
    waiting.arm.on_phase("APPROVAL", 0.2, PLAN)
    assert waiting.view["approval"] == {"plan": PLAN, "asked": False, "words": ""}, "even if it has the same id"


def test_a_motion_is_limited_in_time_from_its_approval_on(waiting) -> None:
    waiting.wait(200.0)
    waiting.do("approve", plan=PLAN)
    waiting.arm.answer(True, "approved")
    waiting.arm.on_phase("CARRY", 0.6, PLAN)
    waiting.wait(119.0)
    assert waiting.state == "executing"
    waiting.wait(2.0)
    waiting.wait(5.1)
    waiting.see()
    assert "no answer to a cancel" in waiting.last


def test_who_watches_cannot_approve_or_recover(tmp_path: Path) -> None:
    with workplace(tmp_path, pace=0.01) as place:
        place.arm.waiting_plan = PLAN

        place.draw("pick", place.table.box_around(BLOCKS[0]))
        place.draw("place", place.table.box_at(0.5, -0.28))
        with opened(place, "holding-page") as first, opened(place, "watching-page") as second:
            until(second, "holder", "other")
            assert ask(first, "execute")["ok"]
            until(second, "approval", {"plan": PLAN, "asked": False, "words": ""})
            for command, arguments in (("approve", {"plan": PLAN}), ("recover", {}), ("open_hand", {})):
                refusal = ask(second, command, **arguments)
                assert not refusal["ok"] and "this one watches" in refusal["error"]
            assert place.station.view(None)["approval"] is not None and place.arm.recoveries == place.arm.openings == 0
            assert ask(first, "approve", plan=PLAN)["ok"]
            place.wait_for("ready")
            assert [step["outcome"] for step in place.station.view(None)["episode"]["steps"]] == ["succeeded"]
