"""A plan's markers, number by number, and what is published of a plan under its id."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rclpy")

from rclpy.qos import DurabilityPolicy
from std_msgs.msg import ColorRGBA

from cliport_core.messages import stamp_from_msg
from cliport_core.workspace import WorkspaceSpec
from panda_executor import node_preview
from panda_executor.hand_geometry import HandShape
from panda_executor.node_preview import PlanPreviews, preview_markers
from panda_executor.obstacle_grid import ObstacleGrid
from panda_executor.phase import Phase
from panda_executor.plan_preview import PreviewPath
from panda_executor.trajectory import JointTrajectory
from panda_model import load_preset

HAND = HandShape(load_preset().hand)
QUARTER = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # about z
COLORS = {Phase.CARRY: (1.0, 0.6, 0.1), Phase.DESCEND: (0.2, 0.8, 1.0), Phase.LOWER: (0.2, 0.8, 1.0)}
GREY = (0.6, 0.6, 0.6)


def way(phase: Phase, *positions: tuple[float, float, float]) -> PreviewPath:
    """A way whose hand is turned by a quarter from its second pose on."""
    rotations = np.stack([np.eye(3), *[QUARTER] * (len(positions) - 1)])
    return PreviewPath(phase, rotations, np.array(positions), HAND)


WAYS = [way(phase, (0.1, 0.2, 0.3), (0.1, 0.25, 0.3), (0.15, 0.25, 0.4)) for phase in (
    Phase.GO_ABOVE_PICK, Phase.DESCEND, Phase.CARRY, Phase.LOWER, Phase.RETREAT
)]  # fmt: skip


def rgba(color: ColorRGBA) -> tuple[float, ...]:
    return tuple(round(part, 5) for part in (color.r, color.g, color.b, color.a))


def test_a_line_for_each_motion_in_its_colour() -> None:
    markers = preview_markers("1", WAYS, "base").markers
    lines = [marker for marker in markers if marker.ns == "path"]
    assert [line.id for line in lines] == list(range(5))
    for line, each in zip(lines, WAYS, strict=True):
        assert line.type == line.LINE_STRIP and line.action == line.ADD
        assert (line.scale.x, line.scale.y, line.scale.z) == (0.004, 0.0, 0.0)
        assert rgba(line.color) == (*COLORS.get(each.phase, GREY), 1.0)
        np.testing.assert_array_equal([[p.x, p.y, p.z] for p in line.points], each.positions)


def test_a_hand_where_it_acts_and_hands_along_the_way() -> None:
    markers = preview_markers("1", WAYS, "base").markers
    for each in WAYS:
        acts = each.phase in (Phase.DESCEND, Phase.LOWER)
        number = WAYS.index(each)
        begin = next(i for i, marker in enumerate(markers) if marker.ns == "path" and marker.id == number)
        shown = markers[begin + 1 : begin + 1 + len(each.hands()) + acts]
        assert [marker.ns for marker in shown] == ["swept"] * len(each.hands()) + ["grasp"] * acts
        assert [marker.id for marker in shown] == list(range(begin + 1, begin + 1 + len(shown)))
        color = COLORS.get(each.phase, GREY)
        opacities = [0.12] * len(each.hands()) + [0.8] * acts
        assert [rgba(marker.color) for marker in shown] == [(*color, opacity) for opacity in opacities]
        for marker, index in zip(shown, [*each.hands(), 2], strict=False):
            assert marker.type == marker.CUBE
            lower, upper = HAND.points.min(axis=0), HAND.points.max(axis=0)
            size = (marker.scale.x, marker.scale.y, marker.scale.z)
            assert size == pytest.approx(tuple(upper - lower)) and len({round(side, 3) for side in size}) == 3
            middle = (lower + upper) / 2.0
            x, y, z = middle if index == 0 else (-middle[1], middle[0], middle[2])
            at = marker.pose.position
            assert (at.x, at.y, at.z) == pytest.approx(tuple(each.positions[index] + (x, y, z)))
            turn = marker.pose.orientation
            angle = 0.0 if index == 0 else np.pi / 4.0
            assert (abs(turn.z), abs(turn.w)) == pytest.approx((np.sin(angle), np.cos(angle)))


def test_what_was_shown_before_goes_first_and_the_id_comes_last() -> None:
    first, *_, label = preview_markers("12ab", WAYS, "base").markers
    assert (first.action, first.header.frame_id) == (first.DELETEALL, "base")
    assert (label.ns, label.text, label.type) == ("plan", "plan 12ab", label.TEXT_VIEW_FACING)
    assert (label.scale.z, rgba(label.color)) == (0.03, (1.0, 1.0, 1.0, 1.0))
    at = label.pose.position
    assert (at.x, at.y, at.z) == pytest.approx((0.15, 0.25, 0.55))


def test_each_plan_is_published_whole_under_its_id(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: dict[str, list[Any]] = {}

    def create_publisher(kind: Any, topic: str, qos: Any) -> SimpleNamespace:
        assert qos.depth == 1 and qos.durability == DurabilityPolicy.TRANSIENT_LOCAL, "for whoever comes later"
        return SimpleNamespace(publish=sent.setdefault(topic.removeprefix("/panda_executor/preview/"), []).append)

    clock = SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=7_000_000_003))
    node: Any = SimpleNamespace(create_publisher=create_publisher, get_clock=lambda: clock)
    model: Any = "model"

    def paths(given: Any, motions: Any) -> list[PreviewPath]:
        assert given == "model" and motions == [motion]
        return WAYS

    monkeypatch.setattr(node_preview, "paths", paths)
    still = np.zeros((2, 7))
    trajectory = JointTrajectory(load_preset().arm_joints, np.array([0.0, 2.0]), still, still, still)
    grid = ObstacleGrid.empty(WorkspaceSpec())
    motion: Any = SimpleNamespace(trajectory=trajectory, scene=SimpleNamespace(grid=grid))
    PlanPreviews(node, model, "base").show("12ab", [motion])
    [way_sent], [markers], [picture] = sent["trajectory"], sent["markers"], sent["picture"]
    assert list(way_sent.joint_names) == list(load_preset().arm_joints) and len(way_sent.points) == 2
    assert way_sent.header.frame_id == picture.header.frame_id == "plan 12ab"
    assert markers.markers[-1].text == "plan 12ab"
    headers = [way_sent.header, picture.header, *(marker.header for marker in markers.markers)]
    assert {stamp_from_msg(header.stamp) for header in headers} == {7_000_000_003}
    assert {marker.header.frame_id for marker in markers.markers} == {"base"}
    assert picture.encoding == "rgb8"
    assert (picture.height, picture.width) == tuple(4 * side for side in grid.heights.shape)
