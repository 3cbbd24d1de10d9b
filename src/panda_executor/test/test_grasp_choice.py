"""Which holds become grasps, the better first, and every number of a grasp, on cells that were drawn by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from height_grids import CELL, MIDDLE, ground, mask

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from panda_executor import grasp as module
from panda_executor.errors import GraspError
from panda_executor.grasp import Grasp, GraspConfig, _grasp, _grasps_of, _holds, plan_grasps
from panda_executor.ground_cells import BoolArray, GroundCells
from panda_executor.jaws import Hold
from panda_executor.seen_object import SeenObject, find_object
from panda_model import load_preset

HAND = load_preset().hand
CONFIG = GraspConfig()
EMPTY = mask(0, -1, 0, -1)


def hold(middle: float, width: float, across: float = 0.0) -> Hold:
    return Hold(middle, across, width, 0.07, 0.01, 0.004)


class Told:
    """Jaws that find what they were told to, and note what they were asked."""

    def __init__(self, whole: Hold | str, feature: Hold | str | None, length: float = 0.05) -> None:
        self.whole, self.feature = whole, feature
        self.across = np.array([[-length / 4.0, 0.75 * length, 1.0]])
        self.asked: list[tuple[Any, ...]] = []

    def on_object(self, *asked: Any) -> Hold:
        self.asked.append(asked)
        if isinstance(self.whole, str):
            raise GraspError(self.whole)
        return self.whole

    def on_feature(self, *asked: Any) -> Hold | None:
        self.asked.append(asked)
        if isinstance(self.feature, str):
            raise GraspError(self.feature)
        return self.feature


SEEN = SeenObject(np.array([[True, False, False]]), np.array([[True, True, False]]), 0.05, 0.0)


def found(told: Told, config: GraspConfig = CONFIG) -> tuple[list[Hold], str]:
    jaws: Any = told
    return _holds(jaws, SEEN, 0.03, config, "here")


def order(whole: Hold, feature: Hold, length: float = 0.05) -> str:
    """Return the initials of the holds in their order."""
    holds, _ = found(Told(whole, feature, length))
    return "".join("w" if one is whole else "f" for one in holds)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("whole", "feature", "first"),
    [
        ((0.0, 0.04), (0.0049, 0.0499), "w"),  # the same sides
        ((0.0, 0.04), (0.0051, 0.04), "wf"),
        ((0.0, 0.04), (-0.0049, 0.0301), "w"),
        ((0.0, 0.04), (0.0, 0.0299), "wf"),
        ((0.0, 0.03), (0.0, 0.0401), "wf"),
        ((0.0, 0.04), (0.0, 0.0201), "wf"),  # half as wide is what is meant
        ((0.0, 0.04), (0.0, 0.0199), "fw"),
        ((0.0, 0.06), (0.02, 0.0301), "wf"),
        ((0.0119, 0.04), (-0.006, 0.04), "wf"),  # so much nearer to the pick
        ((0.0121, 0.04), (-0.006, 0.04), "fw"),
        ((-0.0061, 0.06), (0.0, 0.04), "fw"),
        ((-0.0059, 0.06), (0.0, 0.04), "wf"),
        ((0.0, 0.04), (0.0399, 0.04), "wf"),
        ((0.0, 0.04), (0.0401, 0.04), "w"),  # too far from the pick
        ((0.0401, 0.04), (0.0, 0.04), "f"),
        ((0.04, 0.04), (0.0, 0.04), "fw"),
    ],
)
def test_the_whole_comes_first_unless_the_pick_means_the_feature(
    whole: tuple[float, float], feature: tuple[float, float], first: str, sign: float
) -> None:
    assert order(hold(sign * whole[0], whole[1]), hold(sign * feature[0], feature[1])) == first


@pytest.mark.parametrize(
    ("across", "length", "first"),
    [(0.0199, 0.05, "w"), (0.0201, 0.05, "fw"), (-0.0201, 0.05, "fw"), (0.0, 0.1199, "w"), (0.0, 0.1201, "fw")],
)
def test_a_long_thing_is_held_at_the_pick(across: float, length: float, first: str) -> None:
    """As is one whose middle is far across the jaws: there the whole's sides are not those at the pick."""
    assert order(hold(0.0, 0.04, across), hold(0.0, 0.04), length) == first


@pytest.mark.parametrize(("middle", "across", "kept"), [(0.0239, -0.0319, True), (-0.0241, 0.0321, False)])
def test_a_hold_is_no_farther_from_the_pick_than_is_allowed(middle: float, across: float, kept: bool) -> None:
    one = hold(middle, 0.04, across)
    holds, problem = found(Told(one, None))
    assert holds == ([one] if kept else [])
    assert problem == "the middle of the object is more than 40 mm from here"


def test_the_reason_is_that_of_the_whole_where_it_has_one() -> None:
    one = hold(0.0, 0.02)
    assert found(Told("wide", "narrow")) == ([], "wide")
    assert found(Told("wide", one)) == ([one], "wide")
    assert found(Told(one, "narrow")) == ([one], "narrow")
    assert found(Told("wide", None)) == ([], "wide")


def test_the_jaws_are_asked_for_the_upper_part_and_for_the_feature_of_all() -> None:
    told = Told(hold(0.0, 0.04), None)
    found(told, GraspConfig(feature_reach=0.007))
    assert told.asked[0][0] is SEEN.upper and told.asked[0][1:] == (0.03, "here")
    assert told.asked[1][0] is SEEN.whole and told.asked[1][1:] == (0.007, 0.03, "here")


def made(
    whole: BoolArray, yaw: float, middle: float, across: float, pick: tuple[float, float] = (0.01, -0.02)
) -> Grasp:
    seen = SeenObject(whole, whole, 0.06, 0.013)
    one = Hold(middle, across, 0.03, 0.07, 0.02, 0.004)
    return _grasp(ground(), seen, one, PlanarPose(*pick, 9.0), yaw, 0.041, HAND)


@pytest.mark.parametrize("yaw", [0.0, 0.6, 2.0, -1.1])
def test_a_grasp_is_where_its_hold_is(yaw: float) -> None:
    grasp = made(mask(-6, 8, -3, 5), yaw, 0.005, 0.003)
    at = complex(0.01, -0.02) + complex(0.005, 0.003) * complex(math.cos(yaw), math.sin(yaw))
    np.testing.assert_allclose(grasp.centroid, [at.real, at.imag, 0.041], atol=1e-12)
    assert grasp.tcp_z == pytest.approx(0.02 + HAND.fingertip_below_tcp)
    assert (grasp.yaw, grasp.opening, grasp.width, grasp.spare) == (yaw, 0.07, 0.03, 0.004)
    assert (grasp.top_z, grasp.support_z, grasp.cell, grasp.hand) == (0.06, 0.013, CELL, HAND)
    cells = [complex(x, y) * CELL - at for y in range(-3, 6) for x in range(-6, 9)]
    np.testing.assert_allclose(grasp.footprint, [[cell.real, cell.imag] for cell in cells], atol=1e-12)


def test_thin_parts_keep_their_cells_and_all_else_loses_its_edge() -> None:
    whole = mask(-6, 2, -4, 3) | mask(3, 14, 0, 0) | mask(-2, -2, 4, 12)
    grasp = made(whole, 0.0, 0.0, 0.0, (0.0, 0.0))
    cells = {(x - MIDDLE, y - MIDDLE) for y, x in np.argwhere(whole).tolist()}
    core = {(x, y) for x, y in cells if {(x - 1, y), (x + 1, y), (x, y - 1), (x, y + 1)} <= cells}
    thin = {(x, y) for x, y in cells if all(max(abs(x - i), abs(y - j)) > 2 for i, j in core)}
    assert len(core) == 7 * 6 + 2 and len(thin) > 10  # each bar's root counts as inside
    assert {(round(x / CELL), round(y / CELL)) for x, y in grasp.inner.tolist()} == core | thin
    assert len(grasp.inner) == len(core | thin)


@pytest.mark.parametrize(
    ("yaw", "pick", "cells"),
    [
        (0.0, (0.0, 0.0), 99.0),
        (0.0, (0.0, CELL / 4), 99.5),  # twice as far as all but 2 % of the cells reach from the middle, and a cell
        (math.pi / 2, (0.0, 0.0), 1.0),
        (math.pi / 2, (2.0 * CELL, 0.0), 5.0),
    ],
)
def test_the_length_is_that_across_the_jaws(yaw: float, pick: tuple[float, float], cells: float) -> None:
    assert made(mask(0, 0, -50, 50), yaw, 0.0, 0.0, pick).length == pytest.approx(cells * CELL)


BLOCK = (-6, 8, -3, 5, 0.06)


def both(cells: GroundCells, part: BoolArray, yaw: float = 0.0) -> tuple[list[Grasp], str]:
    seen = SeenObject(part, part, 0.06, 0.0)
    return _grasps_of(cells, seen, PlanarPose(CELL, CELL, yaw), 0.03, 0.0, CONFIG)


def test_a_block_is_grasped_at_the_picks_yaw_and_then_across() -> None:
    grasps, _ = both(ground(BLOCK), mask(-6, 8, -3, 5))
    assert [grasp.yaw for grasp in grasps] == [0.0, math.pi / 2]
    assert [grasp.width for grasp in grasps] == pytest.approx([14 * CELL, 8 * CELL])
    assert [grasp.length for grasp in grasps] == pytest.approx([9 * CELL, 15 * CELL])
    for grasp in grasps:
        np.testing.assert_allclose(grasp.centroid, [CELL, CELL, 0.03], atol=1e-12)
        assert grasp.tcp_z == pytest.approx(0.03)


def test_the_first_yaws_reason_is_given_also_where_the_other_has_a_grasp() -> None:
    grasps, problem = both(ground((-20, 22, -3, 5, 0.06)), mask(-20, 22, -3, 5))
    assert [grasp.yaw for grasp in grasps] == [math.pi / 2]
    assert problem.startswith("the object at the pick (0.003, 0.003) m is 105 mm wide between the fingers")


def cloud(blocks: list[tuple[int, int, int, int, float]], table: float = 0.0) -> np.ndarray:
    """Return a point on the middle of each of 96 x 96 cells about (0.45, 0.1), blocks as in `ground`."""
    top = np.full((96, 96), table)
    for left, right, low, high, height in blocks:
        top[48 + low : 49 + high, 48 + left : 49 + right] = height
    at = (np.arange(96) - 47.5) * CELL
    y, x = np.meshgrid(0.1 + at, 0.45 + at, indexing="ij")
    return np.stack([x, y, top], axis=-1).reshape(-1, 3).astype(np.float32)


PICK = PlanarPose(0.45, 0.1, 0.0)


@pytest.mark.parametrize(
    ("side", "table", "mean"),
    [
        (0.0317, 0.0, 0.04085),  # a finger's pad, 18.5 mm, below the top: what is seen there counts
        (0.0313, 0.0, 0.05),
        (0.0317, 0.012, 0.04085),
    ],
)
def test_the_height_is_that_of_what_the_pads_touch(
    workspace: WorkspaceSpec, side: float, table: float, mean: float
) -> None:
    block = cloud([(-6, 5, -4, 3, 0.05)], table)
    lower = block[block[:, 2] > 0.04] - np.array([0.0, 0.0, 0.05 - side], np.float32)
    grasp = plan_grasps(np.concatenate([block, lower]), PICK, workspace, table)[0]
    assert grasp.centroid[2] == pytest.approx(mean, abs=1e-6)
    assert grasp.top_z == pytest.approx(0.05, abs=1e-6) and grasp.support_z == table


@pytest.mark.parametrize(("side", "table", "mean"), [(0.0041, 0.0, 0.00905), (0.0039, 0.0, 0.014)])
def test_what_hardly_rises_above_the_table_is_not_touched(
    workspace: WorkspaceSpec, side: float, table: float, mean: float
) -> None:
    block = cloud([(-6, 5, -4, 3, 0.014)], table)
    lower = block[block[:, 2] > 0.01] - np.array([0.0, 0.0, 0.014 - side], np.float32)
    grasp = plan_grasps(np.concatenate([block, lower]), PICK, workspace, table)[0]
    assert grasp.centroid[2] == pytest.approx(mean, abs=1e-6)


@pytest.mark.parametrize(
    ("point", "seen"),
    [
        ((0.03875, 0.00125, 0.0), True),  # within 40 mm of the pick
        ((0.04125, 0.00125, 0.0), False),
        ((0.00125, -0.03875, 0.0), True),
        ((0.00125, -0.04125, 0.0), False),
        ((0.0, 0.0, -0.0299), True),  # no more than 30 mm below the table
        ((0.0, 0.0, -0.0301), False),
        ((0.0, 0.0, 0.2799), True),  # the workspace's upper end
        ((0.0, 0.0, 0.2801), False),
    ],
)
def test_depth_must_be_seen_near_the_pick(
    workspace: WorkspaceSpec, point: tuple[float, float, float], seen: bool
) -> None:
    one = np.array([point], dtype=np.float32) + np.array([0.45, 0.1, 0.0], np.float32)
    with pytest.raises(GraspError, match="nothing rises" if seen else "no depth was seen around the pick"):
        plan_grasps(one, PICK, workspace)


@pytest.mark.parametrize(("first", "in_the_way"), [(40, True), (42, False)])
def test_what_stands_where_the_palm_will_be_is_seen(workspace: WorkspaceSpec, first: int, in_the_way: bool) -> None:
    """The palm reaches 103 mm to either side of the fingers: a tower there, either way, leaves no grasp."""
    last = min(first + 4, 47)
    towers = [(first, last, -4, 3, 0.15), (-4, 3, first, last, 0.15)]
    block = cloud([(-6, 5, -4, 3, 0.04), *towers])
    if in_the_way:
        with pytest.raises(GraspError, match=r"within 103 mm of the object .* 110 mm higher than it"):
            plan_grasps(block, PICK, workspace)
    else:
        assert len(plan_grasps(block, PICK, workspace)) == 2


def test_what_touches_is_taken_along_only_where_a_part_gives_no_grasp(
    workspace: WorkspaceSpec, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[Any, ...]] = []

    def note(cells: GroundCells, *others: Any) -> SeenObject:
        asked.append(others)
        return find_object(cells, *others)

    monkeypatch.setattr(module, "find_object", note)
    block = cloud([(-6, 5, -4, 3, 0.04)])
    config = GraspConfig(min_height=0.007, seed_reach=0.019)
    plan_grasps(block, PICK, workspace, 0.001, config)
    expected = (PICK, 0.001, HAND.pad_length, 0.007, 0.019)
    assert asked == [(*expected, True)]
    with pytest.raises(GraspError, match="is 98 mm wide between the fingers"):
        plan_grasps(cloud([(-20, 19, -20, 19, 0.04)]), PICK, workspace, 0.001, config)
    assert asked[1:] == [(*expected, True), (*expected, False)]
