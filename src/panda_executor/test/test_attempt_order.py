"""One grasp's attempts: which motions are asked for, in which scenes and order, and which words a failure ends in."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import transfer_attempts
from panda_executor.approaches import Approach, Target, usual_approaches
from panda_executor.config import ExecutorConfig
from panda_executor.errors import BudgetSpentError, InverseKinematicsError, PlanningError, TrajectoryError
from panda_executor.grasp import Grasp
from panda_executor.hand_geometry import HandShape
from panda_executor.ik import hand_down_pose, tilted
from panda_executor.motions import MotionBuilder
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.placement import Placement
from panda_executor.transfer_attempts import PickPlacePlan, TransferAttempts
from panda_model import load_preset

HAND = load_preset().hand
START = np.arange(7.0)
ACTION = PickPlaceAction(PlanarPose(0.41, 0.12, 0.3), PlanarPose(0.52, -0.2, 0.8))
CELLS = np.array([[0.0, 0.0], [0.01, 0.0]])
GRASP = Grasp(
    np.array([0.4, 0.1, 0.05]), 0.04, 0.2, 0.07, 0.03, 0.05, 0.0, 0.06, 0.06, CELLS, CELLS, 0.0025, 0.006, HAND, CELLS
)
PLACEMENT = Placement(0.5, -0.2, 0.05, 1.1, 0.06, 0.01)
REST = np.zeros((1, 3), dtype=np.float32)
ALL, LEFT = cast(ObstacleGrid, "all columns"), cast(ObstacleGrid, "columns without the object")


class Builder:
    """Motions that always succeed but for those that a test makes fail; everything asked for is kept."""

    def __init__(self, clear: Callable[[HandShape, float], bool] = lambda hand, z: True) -> None:
        self.config = ExecutorConfig(lean=(0.0, 0.3), approach_height=0.1, clearance=0.013)
        self.model = SimpleNamespace(arm=SimpleNamespace(ready=np.full(7, 9.0)))
        self.asked: list[tuple[Any, ...]] = []
        self.fails: dict[Phase, list[Exception | None]] = {}
        self.budget = SimpleNamespace(check=lambda: self.asked.append(("budget",)))
        self.ik = SimpleNamespace(solve_all=self._solutions)
        self.found: Callable[[Any], list[float]] = lambda pose: [1.0, 2.0]
        self.valid: Callable[[float], bool] = lambda branch: True
        self._clear = clear

    def scene(self, grid: object, hand: HandShape) -> Any:
        def hand_is_clear(rotation: np.ndarray, translation: np.ndarray) -> bool:
            np.testing.assert_allclose(rotation, hand_down_pose(0.0, 0.0, 0.0, 1.1).rotation)
            assert translation[:2].tolist() == [0.5, -0.2]
            return self._clear(hand, float(translation[2]))

        def is_valid(positions: np.ndarray) -> bool:
            return self.valid(float(positions[0]))

        return SimpleNamespace(grid=grid, hand=hand, is_valid=is_valid, hand_is_clear=hand_is_clear)

    def _solutions(self, pose: Any, reference: np.ndarray) -> list[Any]:
        self.asked.append(("ik", pose, reference))
        return [SimpleNamespace(positions=np.full(7, branch)) for branch in self.found(pose)]

    def _made(self, kind: str, phase: Phase, *details: Any) -> Any:
        self.asked.append((kind, phase, *details))
        ends = self.fails.get(phase, [])
        error = ends.pop(0) if ends else None
        if error is not None:
            raise error
        return SimpleNamespace(kind=kind, phase=phase, details=details)

    def travel(self, phase: Phase, start: np.ndarray, goal: np.ndarray, scene: Any) -> Any:
        return self._made("travel", phase, start, goal, scene)

    def reversed(self, phase: Phase, motion: Any, scene: Any) -> Any:
        return self._made("reversed", phase, motion, scene)

    def straight(self, phase: Phase, start: np.ndarray, goal: Any, scene: Any) -> Any:
        try:
            return self._made("straight", phase, start, goal, scene)
        except PlanningError:
            return None


def noted(asked: list[Any], given: Any, answer: Any = None) -> Any:
    """Write down what was asked and answer it."""
    asked.append(given)
    return answer


@pytest.fixture
def builder() -> Builder:
    return Builder()


@pytest.fixture(autouse=True)
def placed(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """What was asked of the placement."""
    calls: list[tuple[Any, ...]] = []
    monkeypatch.setattr(transfer_attempts, "plan_placement", lambda *given: noted(calls, given, PLACEMENT))
    return calls


def attempts(builder: Builder, action: PickPlaceAction = ACTION) -> TransferAttempts:
    return TransferAttempts(cast(MotionBuilder, builder), action, WorkspaceSpec(), ALL, START)


def plan(builder: Builder, flip: float = 0.0) -> PickPlacePlan:
    return attempts(builder).plan(GRASP, flip, REST, LEFT)


def kinds(builder: Builder) -> list[Any]:
    return [asked[1] for asked in builder.asked if asked[0] in ("travel", "reversed", "straight")]


def test_a_plan_has_each_motion_in_its_scene(builder: Builder) -> None:
    made = cast(Any, plan(builder, math.pi))
    assert kinds(builder) == [
        Phase.DESCEND, Phase.LOWER, Phase.RAISE, Phase.RETREAT, Phase.GO_ABOVE_PICK, Phase.CARRY, Phase.RETREAT
    ], "what may need a search is asked for last"  # fmt: skip
    first = np.full(7, 1.0)
    scenes = [motion.details[-1] for motion in made.motions]
    assert [scene.grid for scene in scenes] == [ALL] + [LEFT] * 6
    shapes = [(s.hand.width, s.hand.held is not None, s.hand.margin) for s in scenes]
    assert shapes == [
        (None, False, 0.013), (0.07, False, 0.0), (0.03, True, 0.0), (0.03, True, 0.013),
        (0.03, True, 0.0), (0.06, False, 0.0), (None, False, 0.013),
    ]  # fmt: skip
    for scene in scenes[2:5]:
        np.testing.assert_array_equal(scene.hand.held.cells, GRASP.held(math.pi).cells)
    ways = [(m.details[0], m.details[1]) for m in (made.go_above, made.carry, made.retreat)]
    np.testing.assert_array_equal(ways, [(START, first), (first, first), (first, np.full(7, 9.0))])
    assert made.raise_up.details[0] is made.descend and made.leave.details[0] is made.lower
    down, lower = made.descend.details[1], made.lower.details[1]
    assert down.is_close(hand_down_pose(0.4, 0.1, 0.04, 0.2 + math.pi))
    assert lower.is_close(hand_down_pose(0.5, -0.2, 0.05, 1.1))


def test_both_ways_down_begin_above_the_higher_of_grasp_and_release(builder: Builder) -> None:
    for tcp_z, above in ((0.04, 0.15), (0.3, 0.4)):
        builder.asked.clear()
        attempts(builder).plan(replace(GRASP, tcp_z=tcp_z), 0.0, REST, LEFT)
        pick, place = (asked for asked in builder.asked if asked[0] == "ik")
        assert pick[1].is_close(hand_down_pose(0.4, 0.1, above, 0.2))
        assert place[1].is_close(hand_down_pose(0.5, -0.2, above, 1.1))
        np.testing.assert_array_equal(pick[2], START)
        np.testing.assert_array_equal(place[2], np.full(7, 1.0))


def test_the_object_is_put_down_turned_from_pick_to_place(builder: Builder, placed: list[tuple[Any, ...]]) -> None:
    plan(builder, math.pi)
    ((cloud, at, yaw, grasp, workspace, table_z, config),) = placed
    assert cloud is REST and grasp is GRASP and workspace == WorkspaceSpec()
    assert (at, table_z, config) == (ACTION.place, 0.0, builder.config.placement)
    assert yaw == pytest.approx(0.2 + math.pi + 0.8 - 0.3)


def test_what_was_grasped_off_the_pick_is_put_down_as_far_off_if_so_set(
    builder: Builder, placed: list[tuple[Any, ...]]
) -> None:
    builder.config = replace(builder.config, centre_grasp=False)
    plan(builder)
    turn, off = 0.8 - 0.3, (0.4 - 0.41, 0.1 - 0.12)
    x = 0.52 + off[0] * math.cos(turn) - off[1] * math.sin(turn)
    y = -0.2 + off[0] * math.sin(turn) + off[1] * math.cos(turn)
    at = placed[0][1]
    assert (at.x, at.y, at.yaw) == pytest.approx((x, y, 0.8))


@pytest.mark.parametrize(
    ("fall", "spare", "raised"), [(0.0021, 0.006, 0.0021), (0.01, 0.006, 0.006), (0.002, 0.006, 0.0), (0.01, 0.0, 0.0)]
)
def test_a_release_that_would_fall_is_held_nearer_to_its_top(
    builder: Builder, monkeypatch: pytest.MonkeyPatch, fall: float, spare: float, raised: float
) -> None:
    asked: list[float] = []

    def placement(cloud: object, at: object, yaw: float, grasp: Grasp, *rest: object) -> Placement:
        asked.append(grasp.tcp_z)
        return replace(PLACEMENT, fall=fall, tcp_z=0.2 + 0.1 * len(asked))

    monkeypatch.setattr(transfer_attempts, "plan_placement", placement)
    made = attempts(builder).plan(replace(GRASP, spare=spare), 0.0, REST, LEFT)
    assert asked == pytest.approx([0.04, 0.04 + raised] if raised else [0.04])
    assert made.grasp.tcp_z == pytest.approx(0.04 + raised)
    assert made.placement.tcp_z == pytest.approx(0.2 + 0.1 * len(asked))


@pytest.mark.parametrize(("needed", "steps"), [(0.0, 0), (0.0049, 1), (0.012, 3), (0.05, 10)])
@pytest.mark.parametrize("opened", [True, False])
def test_the_release_is_raised_in_steps_until_load_and_opened_fingers_are_free(
    needed: float, steps: int, opened: bool
) -> None:
    tried: list[float] = []

    def clear(hand: HandShape, z: float) -> bool:
        matters = (hand.held is None and hand.width == 0.06) is opened
        tried.append(z)
        return not matters or z >= 0.05 + needed - 1e-9

    made = plan(Builder(clear))
    assert made.placement.tcp_z == pytest.approx(0.05 + 0.005 * steps)
    assert replace(made.placement, tcp_z=PLACEMENT.tcp_z) == PLACEMENT
    assert sorted({round(z, 4) for z in tried}) == pytest.approx([0.05 + 0.005 * i for i in range(steps + 1)])


def test_a_release_is_raised_five_centimetres_at_most() -> None:
    tried: list[float] = []
    with pytest.raises(PlanningError) as caught:
        plan(Builder(lambda hand, z: bool(noted(tried, z))))
    words = "no room for hand and object at the place (0.500, -0.200) m, even 5 cm higher"
    assert str(caught.value) == words and max(tried) == pytest.approx(0.1)


def approaches(builder: Builder) -> list[Approach]:
    scene = builder.scene(LEFT, HandShape(HAND))
    motions = cast(MotionBuilder, builder)
    return list(usual_approaches(motions, Phase.LOWER, Target(0.3, 0.1, 0.02, 0.2, 0.4), scene, START))


def test_four_free_branches_are_tried_upright_and_those_that_lead_down_given(builder: Builder) -> None:
    builder.found = lambda pose: [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    builder.valid = lambda branch: branch != 2.0
    builder.fails[Phase.LOWER] = [PlanningError("no line"), None]
    found = approaches(builder)
    assert [float(approach.above[0]) for approach in found] == [3.0, 4.0, 5.0]
    downs = [asked for asked in builder.asked if asked[0] == "straight"]
    assert [float(down[2][0]) for down in downs] == [1.0, 3.0, 4.0, 5.0], "an invalid branch is none of the four"
    assert all(down[3].is_close(hand_down_pose(0.3, 0.1, 0.02, 0.4)) for down in downs)
    assert cast(Any, found[0].down).details[0] is found[0].above
    assert [asked[0] for asked in builder.asked].count("ik") == 1, "the hand leans although upright is free"


def test_the_hand_leans_where_upright_has_no_branch_or_no_free_one(builder: Builder) -> None:
    upright = hand_down_pose(0.3, 0.1, 0.2, 0.4)

    def leaning(pose: Any) -> list[float]:
        if pose.is_close(upright):
            raise InverseKinematicsError(0.3, 0.1, 0.2, 0.4, 0.01)
        return [6.0]

    for found, branches in ((leaning, [6.0]), (lambda pose: [1.0] if pose.is_close(upright) else [6.0], [6.0])):
        builder.asked.clear()
        builder.found, builder.valid = found, lambda branch: branch == 6.0
        assert [float(approach.above[0]) for approach in approaches(builder)] == branches
        poses = [asked[1] for asked in builder.asked if asked[0] == "ik"]
        assert len(poses) == 2 and poses[1].is_close(tilted(upright, 0.3))
        assert [asked[0] for asked in builder.asked].count("budget") == 2, "time and stop are looked at for each"


@pytest.mark.parametrize("phase", [Phase.GO_ABOVE_PICK, Phase.RAISE, Phase.CARRY, Phase.RETREAT])
def test_where_a_motion_fails_the_next_branch_is_tried(builder: Builder, phase: Phase) -> None:
    builder.fails[phase] = [TrajectoryError("touches")]
    made = cast(Any, plan(builder))
    changed = made.lower if phase in (Phase.CARRY, Phase.RETREAT) else made.carry
    assert float(changed.details[0][0]) == 2.0
    builder.fails[phase] = [*(TrajectoryError("first") for _ in range(9))]
    with pytest.raises(PlanningError, match=r"^first$"):
        plan(builder)
    spent = len(builder.asked)
    builder.fails[phase] = [BudgetSpentError("too long")]
    with pytest.raises(BudgetSpentError, match="too long"):
        plan(builder)
    assert len(builder.asked) - spent < 12


def test_no_way_is_looked_for_twice(builder: Builder) -> None:
    builder.fails = {Phase.CARRY: [PlanningError("no way across")] * 4}
    own = attempts(builder)
    with pytest.raises(PlanningError, match=r"^no way across$"):
        own.plan(GRASP, 0.0, REST, LEFT)
    asked = kinds(builder)
    assert (asked.count(Phase.GO_ABOVE_PICK), asked.count(Phase.CARRY)) == (2, 4)
    assert len(own.begun) == 1 and own.begun[0].grasp is GRASP
    builder.asked.clear()
    builder.fails = {Phase.RAISE: [TrajectoryError("touches")] * 2}
    with pytest.raises(PlanningError, match=r"^touches$"):
        plan(builder)
    assert kinds(builder).count(Phase.RAISE) == 2, "with the object in it the hand does not pass, wherever it goes then"


def test_each_approach_has_a_way_back_of_its_own_that_begins_where_it_ends(builder: Builder) -> None:
    own = attempts(builder)
    own.plan(GRASP, 0.0, REST, LEFT)
    (begun,) = own.begun
    both = [Approach(START, cast(Any, name)) for name in ("one way down", "another from there")]
    backs = [cast(Any, own._back(begun, Phase.RAISE, one, begun.scenes.carried)) for one in both * 2]
    assert [back.details[0] for back in backs[:2]] == [one.down for one in both]
    assert backs[2:] == backs[:2], "no way back is looked for twice"


def test_what_was_begun_is_tried_from_every_height_the_lowest_pairs_first(
    builder: Builder, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = attempts(builder)
    own.plan(GRASP, 0.0, REST, LEFT)
    (begun,) = own.begun
    joined: list[tuple[float, float]] = []
    looked: list[tuple[Phase, float]] = []
    from_pose = [Approach(np.full(7, height), cast(Any, "a way down")) for height in (1.0, 2.0, 3.0)]

    def more(motions: Any, phase: Phase, target: Target, scene: Any, reference: np.ndarray) -> Iterator[Approach]:
        wanted = {
            Phase.DESCEND: (begun.pick_at, begun.scenes.opened),
            Phase.LOWER: (begun.place_at, begun.scenes.carried),
        }
        at, among = wanted[phase]
        assert target is at and scene is among and reference is START
        for approach in from_pose if phase is Phase.DESCEND else from_pose[:2]:
            looked.append((phase, float(approach.above[0])))
            yield approach

    def join(attempt: Any, pick: Approach, place: Approach) -> Any:
        joined.append((float(pick.above[0]), float(place.above[0])))
        if len(joined) == 1:
            assert looked == [(Phase.DESCEND, 1.0), (Phase.LOWER, 1.0)], "no more is looked for than is needed"
        raise PlanningError(f"no way {len(joined)}")

    monkeypatch.setattr(transfer_attempts, "more_approaches", more)
    monkeypatch.setattr(own, "_joined", join)
    with pytest.raises(PlanningError, match=r"^no way 6$"):
        own.plan_from_anywhere(begun)
    assert joined == [(1.0, 1.0), (1.0, 2.0), (2.0, 1.0), (2.0, 2.0), (3.0, 1.0), (3.0, 2.0)]


def test_a_failure_is_named_by_its_last_reason(builder: Builder) -> None:
    builder.fails = {
        Phase.GO_ABOVE_PICK: [PlanningError("no way there"), None],
        Phase.CARRY: [PlanningError("no way across"), PlanningError("nor so")],
    }
    with pytest.raises(PlanningError, match=r"^nor so$"):
        plan(builder)
    builder.fails = {Phase.DESCEND: [PlanningError("no line")] * 4}
    with pytest.raises(PlanningError, match=r"^no approach to the object is free$"):
        plan(builder)
    builder.fails = {Phase.LOWER: [PlanningError("no line")] * 8}
    with pytest.raises(PlanningError, match=r"^no way down at the place$"):
        plan(builder)
