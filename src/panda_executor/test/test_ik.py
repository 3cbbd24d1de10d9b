"""The hand, pointing down, reaches the whole workspace."""

from __future__ import annotations

import math

import numpy as np
import pytest
from synthetic_clouds import Cube, cloud_of

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from panda_executor.errors import InverseKinematicsError, RequestError
from panda_executor.grasp import plan_grasps
from panda_executor.ik import hand_down_pose, tilted, yaw_of_hand
from panda_executor.model import PandaModel
from panda_executor.request_check import check_reach
from panda_executor.transfer import TransferPlanner
from panda_model import load_preset

READY_POSITIONS = load_preset().ready

YAWS = (0.0, math.pi / 4, math.pi / 2, 3 * math.pi / 4)


def solve_either_way(planner: TransferPlanner, x: float, y: float, z: float, yaw: float):
    """The jaws are the same when turned around: one of the two suffices."""
    for flip in (0.0, math.pi):
        try:
            return hand_down_pose(x, y, z, yaw + flip), planner.ik.solve_all(
                hand_down_pose(x, y, z, yaw + flip), READY_POSITIONS
            )
        except InverseKinematicsError:
            continue
    pytest.fail(f"({x:.3f}, {y:.3f}, {z:.3f}) at yaw {yaw:.2f} cannot be reached")


@pytest.mark.parametrize("z", [0.01, 0.09, 0.17, 0.25])
def test_every_pose_over_the_workspace_is_reached(planner: TransferPlanner, model: PandaModel, z: float) -> None:
    for x in np.linspace(0.25, 0.65, 5):
        for y in np.linspace(-0.4, 0.4, 5):
            for yaw in YAWS:
                target, solutions = solve_either_way(planner, x, y, z, yaw)
                for solution in solutions:
                    pose = model.tcp_pose(solution.positions)
                    assert np.linalg.norm(pose.translation - target.translation) < 1e-4
                    assert np.abs(pose.rotation - target.rotation).max() < 1e-4
                    assert pose.rotation[2, 2] == pytest.approx(-1.0, abs=1e-6)
                    assert model.limits.contains(solution.positions)


def test_solutions_are_distinct_ordered_and_repeatable(planner: TransferPlanner) -> None:
    pose = hand_down_pose(0.5, 0.1, 0.1, 0.4)
    first, second = (planner.ik.solve_all(pose, READY_POSITIONS) for _ in range(2))
    assert [s.cost for s in first] == sorted(s.cost for s in first)
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.positions, b.positions)
    for i, a in enumerate(first):
        assert all(np.abs(a.positions - b.positions).max() > 0.04 for b in first[:i])


def test_what_cannot_be_reached_is_said_with_numbers(planner: TransferPlanner) -> None:
    with pytest.raises(InverseKinematicsError, match=r"\(1\.200, 0\.000, 0\.100\).*off by .* mm") as caught:
        planner.ik.solve_all(hand_down_pose(1.2, 0.0, 0.1, 0.0), READY_POSITIONS)
    assert caught.value.x == 1.2
    assert caught.value.residual > 0.1
    assert "\n" not in str(caught.value)


def test_a_near_solution_stays_on_its_branch(planner: TransferPlanner) -> None:
    pose = hand_down_pose(0.5, 0.1, 0.1, 0.4)
    here = planner.ik.solve_all(pose, READY_POSITIONS)[0].positions
    near = planner.ik.solve_near(hand_down_pose(0.5, 0.11, 0.1, 0.4), here)
    assert near is not None
    assert np.abs(near - here).max() < 0.1
    assert planner.ik.solve_near(hand_down_pose(0.3, -0.3, 0.1, 2.5), here) is None


@pytest.mark.parametrize("yaw", np.linspace(-3.0, 3.0, 7))
def test_the_yaw_of_a_hand_is_recovered(yaw: float) -> None:
    pose = hand_down_pose(0.4, 0.2, 0.1, yaw)
    assert yaw_of_hand(pose) == pytest.approx(yaw)
    np.testing.assert_allclose(pose.rotation[:, 1], [math.cos(yaw), math.sin(yaw), 0.0], atol=1e-12)
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)


def test_leaning_keeps_the_tcp_and_moves_the_hand_inwards() -> None:
    pose = hand_down_pose(0.3, 0.2, 0.1, 0.5)
    leaning = tilted(pose, 0.3)
    np.testing.assert_array_equal(leaning.translation, pose.translation)
    assert leaning.rotation[2, 2] == pytest.approx(-math.cos(0.3))
    np.testing.assert_allclose(tilted(leaning, -0.3).rotation, pose.rotation, atol=1e-12)


def test_a_pose_may_be_reached_either_way_round(model: PandaModel) -> None:
    asked: list[float] = []

    class NoWay:
        def solve_all(self, pose: Pose, reference: np.ndarray) -> list[object]:
            asked.append(yaw_of_hand(pose))
            raise InverseKinematicsError(0.0, 0.0, 0.0, 0.0, 1.0)

    here = PlanarPose(0.45, 0.1, 0.7)
    with pytest.raises(RequestError, match=r"the pick \(0\.450, 0\.100\) m is out of reach"):
        check_reach(PickPlaceAction(here, here), NoWay(), model.arm.ready, 0.0)  # type: ignore[arg-type]
    assert asked == pytest.approx([0.7, 0.7 - math.pi])


def test_a_cost_from_nearby_is_that_of_the_same_branch_and_falls_back_to_all(planner: TransferPlanner) -> None:
    ik = planner.ik
    pose = hand_down_pose(0.5, 0.1, 0.1, 0.3)
    near, residual = ik.refine(pose, READY_POSITIONS)
    assert residual < 2e-5 and ik.near_cost(pose, READY_POSITIONS) == ik.cost(near, READY_POSITIONS)
    far = READY_POSITIONS * -1.0  # from there no descent ends at the pose
    assert ik.refine(pose, far)[1] > 1e-3
    assert ik.near_cost(pose, far) == ik.solve_all(pose, far)[0].cost
    assert ik.near_cost(hand_down_pose(1.4, 0.0, 0.1, 0.0), READY_POSITIONS) == math.inf


@pytest.mark.parametrize(("cheaper", "order"), [(0.0, [0.0, math.pi]), (math.pi, [math.pi, 0.0])])
def test_the_cheaper_way_round_is_tried_first(
    planner: TransferPlanner, monkeypatch: pytest.MonkeyPatch, cheaper: float, order: list[float]
) -> None:
    grasp = plan_grasps(cloud_of([Cube(0.45, 0.1, 0.3)]), PlanarPose(0.45, 0.1, 0.3), WorkspaceSpec())[0]
    monkeypatch.setattr(
        planner.ik,
        "near_cost",
        lambda pose, start: abs(math.remainder(yaw_of_hand(pose) - grasp.yaw - cheaper, 2 * math.pi)),
    )
    assert planner._flips(grasp, READY_POSITIONS) == order
