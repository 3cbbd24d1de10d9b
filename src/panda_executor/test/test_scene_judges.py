"""What a scene calls free: the boundary of each of its checks, with stand-ins for the arm's kinematics."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from panda_executor.hand_geometry import HandShape, HeldObject
from panda_executor.ik import hand_down_pose
from panda_executor.model import PandaModel
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.scene import Scene, SceneConfig, UnseenRule, add_table, place_camera
from panda_model import FloatArray, load_preset

PANDA = load_preset()
TIPS = PANDA.hand.fingertip_below_tcp
NEAR = 1e-6  # just inside or outside of a bound [m]
TABLE = 0.05
NO_SPHERES = np.zeros((0, 3))


@dataclass
class Cover:
    """Spheres that stay where they are put."""

    centres: FloatArray = field(default_factory=lambda: NO_SPHERES)
    radii: FloatArray = field(default_factory=lambda: np.zeros(0))
    joints: Any = None
    parts: Any = None
    part_of: Any = None

    def __post_init__(self) -> None:
        if self.joints is None:
            self.joints = np.full(len(self.radii), 3)

    def placed(self, data: object, which: Any = slice(None)) -> FloatArray:
        return self.centres[which]


class Arm:
    """An arm whose hand and links are where a test wants them, whatever the joints."""

    def __init__(self) -> None:
        self.limits, self.data = PANDA.limits, None
        self.pair: str | None = None
        pose = hand_down_pose(0.45, 0.1, 0.4, 0.0)
        self.pose = np.asarray(pose.rotation), np.asarray(pose.translation)
        self.reaching, self.standing = Cover(), Cover()
        self.fixed_boxes: dict[str, tuple[FloatArray, FloatArray]] = {}

    def in_collision(self, positions: FloatArray) -> bool:
        return self.pair is not None

    def colliding_pair(self, positions: FloatArray) -> str | None:
        return self.pair

    def tcp_arrays_now(self) -> tuple[FloatArray, FloatArray]:
        return self.pose

    def tcp_arrays(self, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.pose

    def hand_at(self, x: float, y: float, z: float) -> None:
        self.pose = self.pose[0], np.array([x, y, z])


def block(height: float = 0.2) -> ObstacleGrid:
    """A block with x in 0.3..0.4, y in -0.2..-0.1; cells of 1 cm."""
    heights = np.full((80, 80), -1.0)
    heights[20:30, 10:20] = height
    return ObstacleGrid(heights, 0.2, -0.4, 0.01)


def scene_of(arm: Arm, grid: ObstacleGrid | None = None, held: HeldObject | None = None) -> Scene:
    config = SceneConfig(table_z=TABLE, floor=0.02, arm_clearance=0.015, load_clearance=0.025)
    hand = HandShape(PANDA.hand, 0.04, held)
    empty = ObstacleGrid(np.full((80, 80), -1.0), 0.2, -0.4, 0.01)
    return Scene(cast(PandaModel, arm), grid or empty, hand, TABLE, config)


def judged(scene: Scene) -> str | None:
    """Return why the ready pose is not valid; `is_valid` has to agree."""
    problem = scene.problem(PANDA.ready)
    assert scene.is_valid(PANDA.ready) is (problem is None)
    return problem


def test_the_table_is_a_box_whose_top_is_the_table() -> None:
    boxes: list[tuple[Any, ...]] = []
    model = SimpleNamespace(link="panda_{}".format, put_fixed_box=lambda *box: boxes.append(box))
    add_table(cast(PandaModel, model), SceneConfig(table_z=0.1))
    ((name, size, centre, links, clearance),) = boxes
    assert (name, size.tolist(), clearance) == ("table", [3.0, 3.0, 0.5], 0.0)
    assert centre.tolist() == pytest.approx([0.5, 0.0, -0.15])
    assert set(links) == {f"panda_{n}" for n in (*(f"link{i}" for i in range(3, 8)), "hand", "leftfinger")} | {
        "panda_rightfinger"
    }


@pytest.mark.parametrize(
    ("position", "foot", "height"),
    [
        ((0.6, 0.8, 0.9), (0.66, 0.88), 0.8),
        ((-0.06, 0.08, 0.3), (-0.12, 0.16), 0.2),
        ((0.6, -0.8, 0.15), (0.66, -0.88), 0.1),
        ((0.0, 0.0, 0.9), (0.0, 0.0), 0.8),
    ],
)
def test_the_post_stands_behind_the_camera_from_the_table_up(
    position: tuple[float, ...], foot: tuple[float, float], height: float
) -> None:
    boxes: list[tuple[Any, ...]] = []
    model = SimpleNamespace(link="panda_{}".format, put_fixed_box=lambda *box: boxes.append(box))
    config = SceneConfig(table_z=0.1, camera_size=0.2, post_size=0.04, post_behind=0.1, fixed_clearance=0.03)
    place_camera(cast(PandaModel, model), config, np.array(position))
    camera, post = boxes
    assert (camera[0], camera[1].tolist(), camera[2].tolist()) == ("camera", [0.2] * 3, list(position))
    assert (post[0], post[1].tolist()) == ("camera post", pytest.approx([0.04, 0.04, height]))
    assert post[2].tolist() == pytest.approx([*foot, 0.1 + height / 2.0])
    assert camera[3] == post[3] and camera[4] == post[4] == 0.03
    assert {"panda_link2", "panda_link3", "panda_hand", "panda_rightfinger"} <= set(camera[3])
    assert not {"panda_link0", "panda_link1"} & set(camera[3])


def test_a_second_camera_has_a_post_of_its_own() -> None:
    boxes: list[str] = []
    model = SimpleNamespace(link="panda_{}".format, put_fixed_box=lambda name, *box: boxes.append(name))
    for number in (1, 2):
        place_camera(cast(PandaModel, model), SceneConfig(), np.array([0.4, 0.9, 0.8]), number)
    assert boxes == ["camera", "camera post", "camera 2", "camera 2 post"]


def test_nothing_in_the_way_is_valid() -> None:
    assert judged(scene_of(Arm(), block())) is None


@pytest.mark.parametrize(("beyond", "free"), [(5e-7, True), (2e-6, False)])
def test_a_joint_may_pass_its_limit_by_a_millionth_of_a_radian(beyond: float, free: bool) -> None:
    scene, positions = scene_of(Arm()), PANDA.ready.copy()
    positions[4] = PANDA.limits.lower[4] - beyond
    assert scene.is_valid(positions) is free
    assert scene.problem(positions) == (None if free else "a joint limit is exceeded")


def test_links_that_collide_are_named() -> None:
    arm = Arm()
    arm.pair = "link1 and link5"
    assert judged(scene_of(arm)) == "link1 and link5 would collide"


@pytest.mark.parametrize("over", [True, False])
def test_fingertips_may_be_on_the_table_but_not_in_it(over: bool) -> None:
    arm = Arm()
    arm.hand_at(0.5, 0.2, TABLE + TIPS + (NEAR if over else -NEAR))
    scene = scene_of(arm)
    assert judged(scene) == (None if over else "the hand would touch what stands near (0.500, 0.200, 0.059) m")
    assert scene.hand_is_clear(*arm.pose) is over


@pytest.mark.parametrize(
    ("x", "y", "z", "free"),
    [
        (0.35, -0.15, 0.2 + TIPS + NEAR, True),
        (0.35, -0.15, 0.2 + TIPS - NEAR, False),
        (0.35, 0.3, 0.2, True),
        (0.6, -0.15, 0.2, True),
    ],
)
def test_the_hand_may_be_over_a_column_or_beside_it_but_not_in_it(x: float, y: float, z: float, free: bool) -> None:
    arm = Arm()
    arm.hand_at(x, y, z)
    problem = f"the hand would touch what stands near ({x:.3f}, {y:.3f}, {z:.3f}) m"
    assert judged(scene_of(arm, block())) == (None if free else problem)


@pytest.mark.parametrize("over", [True, False])
def test_a_link_keeps_its_clearance_over_a_column(over: bool) -> None:
    arm = Arm()
    z = 0.2 + 0.05 + 0.015 + (NEAR if over else -NEAR)
    arm.reaching = Cover(np.array([[0.7, 0.3, 0.1], [0.34, -0.16, z]]), np.array([0.07, 0.05]))
    scene = scene_of(arm, block())
    assert judged(scene) == (None if over else "the arm would touch what stands near (0.340, -0.160, 0.265) m")
    touching = scene._touching(arm.reaching.centres)
    assert (touching is None) is over
    if touching is not None:
        np.testing.assert_allclose(touching[0], [[0.34, -0.16, z]])
        np.testing.assert_allclose(touching[1], [0.065])


@pytest.mark.parametrize("touches", [0, 1, 2])
def test_a_sphere_that_touches_is_looked_at_in_its_parts_and_no_other(touches: int) -> None:
    """One of two large spheres touches: what counts is whether those of the small ones do that are parts of it."""
    arm, under = Arm(), 0.2 + 0.02 + 0.015
    at = np.array([[0.34, -0.16, 0.22], [0.36, -0.14, 0.5], [0.34, -0.16, 0.22], [0.35, -0.15, 0.22]])
    at[2:, 2] = under + NEAR
    at[2 : 2 + touches, 2] = under - NEAR
    low = [0.36, -0.14, 0.1]  # touches, but is part of what does not
    parts = Cover(np.array([low, *at[2:].tolist()]), np.array([0.03, 0.02, 0.02]), part_of=np.array([1, 0, 0]))
    arm.reaching = Cover(at[:2], np.array([0.05, 0.05]), parts=parts)
    scene = scene_of(arm, block())
    found = scene._touching(arm.reaching.centres)
    assert (found is None) is (touches == 0) is (judged(scene) is None)
    if found is not None:
        np.testing.assert_array_equal(found[0], at[2 : 2 + touches])
        np.testing.assert_allclose(found[1], 0.035)


@pytest.mark.parametrize(("height", "free"), [(TABLE + 0.02, True), (TABLE + 0.02 + NEAR, False)])
def test_what_rises_less_than_the_floor_is_no_obstacle_for_a_link(height: float, free: bool) -> None:
    arm = Arm()
    arm.reaching = Cover(np.array([[0.35, -0.15, 0.1]]), np.array([0.05]))
    assert (judged(scene_of(arm, block(height))) is None) is free


@pytest.mark.parametrize(("rule", "free"), [(UnseenRule.FREE, True), (UnseenRule.SHADOW, False)])
def test_a_link_in_a_shadow_is_judged_by_the_rule(rule: UnseenRule, free: bool) -> None:
    """Seen from x = 1.3, 0.6 m up, a block of 0.2 m hides 0.17 m and less at 7 cm behind it."""
    arm = Arm()
    arm.reaching = Cover(np.array([[0.23, -0.15, 0.15]]), np.array([0.02]))
    seen = replace(block(), seen=block().heights > 0, cameras=(np.array([1.3, -0.15, 0.6]),))
    scene = scene_of(arm, seen)
    assert (judged(replace(scene, config=replace(scene.config, unseen=rule))) is None) is free


@pytest.mark.parametrize(
    ("lowest", "sinks"),
    [(0.1, 0.0005), (0.0, 0.0005), (-0.002, 0.0025), (-0.0044, 0.0049), (-0.0046, 0.005), (-0.02, 0.005)],
)
def test_a_motion_may_begin_a_little_in_the_table_but_no_deeper(lowest: float, sinks: float) -> None:
    """In a column over the table, on the table, and pressed into it: half a millimetre lower than it was measured."""
    arm = Arm()
    arm.hand_at(0.35, -0.15, TABLE + TIPS + lowest)
    scene = scene_of(arm, block())
    leaving = scene.leaving(PANDA.ready)
    assert leaving.table_z == pytest.approx(TABLE - sinks)
    assert (judged(leaving) is None) is (lowest > -0.005)
    points = scene.hand.points @ arm.pose[0].T + arm.pose[1]
    np.testing.assert_array_equal(leaving.grid.heights, scene.grid.without(points).heights)


def test_what_the_hand_does_not_touch_stays() -> None:
    arm = Arm()
    scene = scene_of(arm, block())
    assert scene.leaving(PANDA.ready) is scene
    arm.hand_at(0.48, -0.15, 0.15)  # its palm is in the block's last columns
    left = scene.leaving(PANDA.ready).grid.heights
    assert (left[20:30, 10:17] == 0.2).all() and 0 < (left > 0).sum() < 100


@pytest.mark.parametrize("deep", [0.004, 0.03])
def test_a_link_that_touches_is_freed_of_the_columns_round_it_and_of_no_more(deep: float) -> None:
    arm = Arm()
    at = np.array([[0.3, -0.2, 0.2 + 0.045 - deep], [0.7, 0.3, 0.02]])
    arm.reaching = Cover(at, np.array([0.03, 0.02]))
    fine: FloatArray = np.kron(block().heights, np.ones((4, 4))).astype(np.float64)
    scene = scene_of(arm, ObstacleGrid(fine, 0.2, -0.4, 0.0025))
    assert "the arm would touch" in str(judged(scene))
    free, expected = scene.escaping(PANDA.ready), scene.grid
    for spare in (0.01, 0.02, 0.03):
        if replace(scene, grid=expected)._touching(at) is not None:
            expected, last = expected.without_near(at[:1], np.array([0.03 + 0.015 + spare])), spare
    np.testing.assert_array_equal(free.grid.heights, expected.heights)
    assert judged(free) is None and last == 0.02 and (free.grid.heights > 0).sum() > 1000


STICK = HeldObject(np.zeros((1, 2)), below=0.02, above=0.02)  # two points, 2 cm below and above the tcp
AT = np.array([0.5, 0.1, 0.4])


def load_hits(arm: Arm) -> str | None:
    scene = scene_of(arm, held=STICK)
    assert sorted(scene.hand.load[:, 2]) == [-0.02, 0.02]
    return scene._load_hits(np.eye(3), AT, arm.reaching.placed(None))


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("off", "hits"), [(-NEAR, True), (NEAR, False)])
def test_a_load_is_in_a_box_up_to_each_of_its_faces(axis: int, side: float, off: float, hits: bool) -> None:
    half = np.array([0.05, 0.07, 0.09])
    shift = np.zeros(3)
    shift[axis] = side * (half[axis] + off + (0.02 if axis == 2 else 0.0))
    arm = Arm()
    arm.fixed_boxes = {"table": (AT, half), "lamp": (AT + 1.0, half), "camera": (AT + shift, half)}
    assert load_hits(arm) == ("the camera" if hits else None)


@pytest.mark.parametrize("cover", ["standing", "reaching"])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize(("off", "joint", "hits"), [(-NEAR, 4, True), (-NEAR, 5, False), (NEAR, 4, False)])
def test_a_load_keeps_its_clearance_to_the_links_but_the_hands_neighbours(
    cover: str, axis: int, side: float, off: float, joint: int, hits: bool
) -> None:
    arm, shift = Arm(), np.zeros(3)
    shift[axis] = side * (0.06 + 0.025 + off)
    shift[2] += side * 0.02  # beside the upper or lower point
    spheres = Cover(np.array([[0.0, 0.0, 0.0], AT + shift]), np.array([0.1, 0.06]), np.array([1, joint]))
    setattr(arm, cover, spheres)
    assert load_hits(arm) == ("the arm" if hits else None)
    if hits:
        arm.pose = np.eye(3), AT
        loaded = scene_of(arm, held=STICK)
        assert judged(loaded) == "what is held would touch the arm"
        assert judged(loaded.with_hand(HandShape(PANDA.hand, 0.04))) is None
