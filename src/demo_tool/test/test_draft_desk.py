"""The draft and what is said of it, on pictures from straight above."""

from __future__ import annotations

import re

import numpy as np
import pytest
from overhead_camera import flat, view_of

from cliport_core.action import ActionGoal, PickPlaceAction, Primitive
from cliport_core.pose import PlanarPose
from cliport_episodes.demonstration import PixelBox
from demo_tool.draft_desk import DraftDesk
from demo_tool.errors import BoxError, NotNowError
from demo_tool.live_view import LiveView
from demo_tool.station_config import BoxConfig, StationConfig

BOX, GOAL = PixelBox(30, 40, 50, 60), PixelBox(70, 80, 90, 100)


def block(rows: int = 20, height: float = 0.04, box: PixelBox = BOX) -> LiveView:
    """Return a view of a block that fills a box's first rows."""
    heights = flat()
    heights[box.top : box.top + rows, box.left : box.right] = height
    return view_of(heights)


@pytest.fixture
def desk() -> DraftDesk:
    return DraftDesk(StationConfig())


@pytest.mark.parametrize(
    ("box", "config", "words"),
    [
        (BOX, BoxConfig(), "centroid of 400 points; 40 mm high, 18 mm wide between the fingers"),
        (BOX, BoxConfig(table_z=0.01), "centroid of 400 points; 30 mm high, 18 mm wide between the fingers"),
        (
            PixelBox(5, 40, 85, 60),
            BoxConfig(),
            "centroid of 1600 points; 40 mm high, 76 mm wide between the fingers: more than the 75 mm that they go "
            "round, so try another rotation",
        ),
    ],
)
def test_a_pick_is_described(box: PixelBox, config: BoxConfig, words: str) -> None:
    desk = DraftDesk(StationConfig(box=config))
    assert desk.draw("pick", box, 0, block(box.bottom - box.top, box=box)) == (True, words)
    shown = desk.shown()["pick"]
    assert shown["words"] == words == shown["grasp"]["words"]


def test_what_is_shown_of_an_end(desk: DraftDesk) -> None:
    desk.draw("pick", BOX, 9, block())
    assert desk.shown()["place"] is None
    shown = desk.shown()["pick"]
    assert shown["box"] == [30, 40, 50, 60] and shown["rotation"] == 9
    assert len(shown["directions"]) == 36 and np.shape(shown["footprint"]) == (2, 4, 2)
    grasp = shown["grasp"]
    assert grasp["points"] == len(grasp["cloud_pixels"]) == 400 and grasp["footprint"] == shown["footprint"]
    x, y, z = grasp["centroid_base"]
    assert (x, y) == pytest.approx((0.45 + 0.96 * 0.0105, 0.96 * 0.0105), abs=0.0006) and z == 0.04
    assert grasp["centroid_base"] == [round(v, 4) for v in grasp["centroid_base"]]
    assert grasp["centroid_pixel"] == pytest.approx([39.5, 49.5], abs=0.6)


def test_an_end_without_a_target_shows_where_the_table_is(desk: DraftDesk) -> None:
    ok, words = desk.draw("pick", BOX, 0, view_of(flat()))
    shown = desk.shown()["pick"]
    assert not ok and words.startswith("nothing stands in the pick box")
    assert shown["footprint"] == [] and shown["grasp"] is None and len(shown["directions"]) == 36


def test_a_place_is_described_by_its_points_alone(desk: DraftDesk) -> None:
    assert desk.draw("place", GOAL, 0, block()) == (True, "centroid of 400 points")


@pytest.mark.parametrize(
    ("box", "ok"),
    [
        (PixelBox(80, 100, 100, 120), True),
        (PixelBox(80, 100, 101, 120), False),
        (PixelBox(80, 100, 100, 121), False),
    ],
)
def test_a_box_may_reach_to_the_edges_of_the_picture(desk: DraftDesk, box: PixelBox, ok: bool) -> None:
    found, words = desk.draw("place", box, 0, block())
    assert found is ok
    assert ok or words == "the place box is not in the picture any more: draw it again"
    assert ok or desk.shown()["place"]["words"] == words


@pytest.mark.parametrize(
    ("drawn", "words"),
    [
        ((), "draw the pick and the place box first"),
        (("pick",), "draw the place box first"),
        (("place",), "draw the pick box first"),
    ],
)
def test_what_is_missing_is_named(desk: DraftDesk, drawn: tuple[str, ...], words: str) -> None:
    for which in drawn:
        desk.draw(which, BOX, 0, block())
    with pytest.raises(NotNowError, match=f"^{words}$"):
        desk.drawn_action(block())


def test_an_action_is_of_the_picture_on_which_it_is_asked_for(desk: DraftDesk) -> None:
    for which, box in (("pick", BOX), ("place", GOAL)):
        desk.draw(which, box, 18, block())
    later = block(rows=10)
    drawn = desk.drawn_action(later)
    assert drawn.view is later and drawn.draft is desk.draft
    assert drawn.action.pick.x == pytest.approx(0.45 + 0.96 * 0.0155, abs=0.0006)
    assert drawn.action.pick.yaw == pytest.approx(np.pi) and drawn.action.primitive is Primitive.PICK_PLACE
    with pytest.raises(BoxError, match="nothing stands in the pick box"):
        desk.drawn_action(view_of(flat()))


def test_the_primitive_may_be_chosen_before_a_picture_comes(desk: DraftDesk) -> None:
    desk.choose_primitive(Primitive.SWEEP, None)
    assert desk.primitive is Primitive.SWEEP
    desk.draw("pick", BOX, 0, view_of(flat()))
    assert desk.shown()["pick"]["grasp"] is not None, "a sweep begins anywhere"
    desk.choose_primitive(Primitive.PICK_PLACE, view_of(flat()))
    assert desk.shown()["pick"]["grasp"] is None


def test_the_policys_position_needs_no_depth_at_the_place(desk: DraftDesk) -> None:
    proposal = ActionGoal(PickPlaceAction(PlanarPose(0.46, 0.01, 0.0), PlanarPose(0.44, -0.01, np.pi / 2)))
    heights = flat(0.04)
    desk.take(proposal, view_of(heights))
    assert desk.shown()["pick"]["box"] == [0, 10, 80, 90]  # 32 cells of 2.5 mm around the pose
    heights[:, 60:] = np.nan
    heights[60:] = np.nan
    desk.judge(view_of(heights))
    assert desk.shown()["place"]["words"] == "the policy's position" and desk.shown()["place"]["rotation"] == 9
    assert desk.shown()["place"]["footprint"] and desk.shown()["place"]["grasp"] is None
    assert desk.shown()["pick"]["words"].startswith("the policy's position; 40 mm high, ")
    desk.judge(view_of(flat(np.nan)))
    assert desk.shown()["pick"]["footprint"] == [], "a grasp needs something that is seen"
    with pytest.raises(BoxError, match=re.escape("the policy's place (0.440, 0.500) m is not in the picture")):
        desk.take(ActionGoal(PickPlaceAction(PlanarPose(0.46, 0.01, 0.0), PlanarPose(0.44, 0.5, 0.0))), view_of(flat()))


def test_a_draft_is_matched_end_by_end(desk: DraftDesk) -> None:
    nothing = {"primitive": "pick_place", "pick": None, "place": None}
    assert desk.matches(nothing) and desk.matches({"primitive": "pick_place"})
    desk.draw("pick", BOX, 3, block())
    end = {"box": [30, 40, 50, 60], "rotation": 3}
    assert desk.matches({**nothing, "pick": end})
    for other in (nothing, {**nothing, "pick": end, "place": end}, {**nothing, "pick": {**end, "rotation": 4}}):
        assert not desk.matches(other)
    desk.clear()
    assert desk.matches(nothing) and desk.shown() == {"pick": None, "place": None}
