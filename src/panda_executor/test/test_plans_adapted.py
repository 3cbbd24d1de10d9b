"""A plan that is checked among newer columns, and one whose way down follows an object that went a little."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cliport_core.pose import Pose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import transfer
from panda_executor.errors import PlanningError
from panda_executor.grasp import Grasp
from panda_executor.phase import Phase
from panda_executor.transfer import TransferPlanner
from panda_executor.transfer_attempts import PickPlacePlan
from panda_model import load_preset

READY = load_preset().ready
SPACE = WorkspaceSpec()
NAMES = ("go_above", "descend", "raise_up", "carry", "lower", "leave", "retreat")
CLOUD = np.array([[0.4, 0.1, 0.05], [0.4, 0.1, 0.06], [0.5, -0.1, 0.05], [0.5, -0.1, 0.06]], dtype=np.float32)


@dataclass(frozen=True)
class Thing:
    """A grasp of what is at y over 0, 5 cm high."""

    centroid: Any
    highest_z: float = 0.055

    def covers(self, points: np.ndarray, margin: float) -> np.ndarray:
        return np.asarray(points[:, 1] > 0.0)

    owns = Grasp.owns


def noted(asked: list[Any], given: Any, answer: Any = None) -> Any:
    """Write down what was asked and answer it."""
    asked.append(given)
    return answer


@pytest.fixture
def plan() -> PickPlacePlan:
    motions: dict[str, Any] = {name: SimpleNamespace(name=name, scene=f"scene of {name}") for name in NAMES}
    way = np.stack([READY, READY + 0.1, READY + 0.2])
    motions["descend"].trajectory = SimpleNamespace(positions=way, end=way[-1])
    grasp: Any = Thing(np.array([0.4, 0.1, 0.05]))
    placement: Any = "placement"
    return PickPlacePlan(grasp, placement, **motions)


@pytest.fixture
def own(planner: TransferPlanner, monkeypatch: pytest.MonkeyPatch) -> TransferPlanner:
    """A planner that sees every object where it was."""
    monkeypatch.setattr(transfer, "moved_problem", lambda cloud, grasp, limit: None)
    return TransferPlanner(planner.model, replace(planner.config, moved_share=0.4, follow_from=0.005))


def test_a_renewed_plan_has_every_motion_among_the_newer_columns(
    own: TransferPlanner, plan: PickPlacePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(own.motions, "among", lambda motion, grid: (motion.name, (grid.heights > 0).sum()))
    found: Any = own.renewed(plan, CLOUD, SPACE, READY)
    assert (found.grasp, found.placement) == (plan.grasp, plan.placement)
    assert found.motions == (("go_above", 2), *((name, 1) for name in NAMES[1:])), "only the first has the object"
    high = CLOUD + np.array([0.0, 0.0, 0.02], dtype=np.float32)
    found = own.renewed(plan, high, SPACE, READY)
    assert found.descend == ("descend", 2), "what is higher is not the object"


def test_a_plan_for_what_moved_is_neither_renewed_nor_followed(
    own: TransferPlanner, plan: PickPlacePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(transfer, "moved_problem", lambda *given: noted(asked, given, "it moved"))
    for call in (lambda: own.renewed(plan, CLOUD, SPACE, READY), lambda: own.found_again(plan, CLOUD, True)):
        with pytest.raises(PlanningError, match=r"^it moved$"):
            call()
        cloud, grasp, limit = asked.pop()
        assert cloud is CLOUD and grasp is plan.grasp and limit == 0.4


def follows(
    own: TransferPlanner, plan: PickPlacePlan, monkeypatch: pytest.MonkeyPatch, by: tuple[float, float], free: bool
) -> list[Any]:
    """Let the object be seen `by` [m] from where it was; return what is asked of the motions."""
    asked: list[Any] = []
    monkeypatch.setattr(transfer, "seen_shift", lambda cloud, grasp: np.array(by))
    monkeypatch.setattr(own.motions, "straight", lambda *given: noted(asked, given, "down" if free else None))
    monkeypatch.setattr(own.motions, "reversed", lambda *given: noted(asked, given, "up"))
    return asked


def test_the_way_down_goes_to_where_the_object_is_now(
    own: TransferPlanner, plan: PickPlacePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = follows(own, plan, monkeypatch, (0.003, -0.004), True)
    found: Any = own.found_again(plan, CLOUD, True)
    (phase, start, goal, scene), back = asked
    planned = own.model.tcp_pose(READY + 0.2)
    assert (phase, scene) == (Phase.DESCEND, "scene of descend")
    np.testing.assert_array_equal(start, READY)
    assert goal.is_close(Pose(planned.rotation, planned.translation + np.array([0.003, -0.004, 0.0])))
    assert back == (Phase.RAISE, "down", "scene of raise_up")
    np.testing.assert_allclose(found.grasp.centroid, [0.403, 0.096, 0.05])
    others: dict[str, Any] = {"grasp": plan.grasp, "descend": plan.descend, "raise_up": plan.raise_up}
    assert (found.descend, found.raise_up) == ("down", "up") and replace(found, **others).motions == plan.motions


@pytest.mark.parametrize("follow", [True, False])
def test_a_plan_stays_where_the_object_went_too_little(
    own: TransferPlanner, plan: PickPlacePlan, monkeypatch: pytest.MonkeyPatch, follow: bool
) -> None:
    asked = follows(own, plan, monkeypatch, (0.003, -0.0039), True)
    assert own.found_again(plan, CLOUD, follow) is plan and asked == []


def test_a_plan_that_may_not_be_changed_is_given_up_where_it_would_be(
    own: TransferPlanner, plan: PickPlacePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = follows(own, plan, monkeypatch, (0.003, 0.0041), True)
    with pytest.raises(PlanningError, match=r"^the object moved by 5 mm, and what a person approved is not changed$"):
        own.found_again(plan, CLOUD, False)
    assert asked == []


def test_an_object_that_went_where_no_way_is_free_is_left(
    own: TransferPlanner, plan: PickPlacePlan, monkeypatch: pytest.MonkeyPatch
) -> None:
    follows(own, plan, monkeypatch, (0.009, 0.012), False)
    with pytest.raises(PlanningError, match=r"^the object went by 15 mm, to where no way is free$"):
        own.found_again(plan, CLOUD, True)
