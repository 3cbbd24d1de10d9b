"""A box on the picture becomes a pose on the table."""

import numpy as np
import pytest
from station_fakes import BLOCKS, Block, FakeTable

from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.demonstration import PixelBox
from demo_tool.box_target import box_around, closing_directions, find_target, finger_outlines, to_pixels
from demo_tool.errors import BoxError
from demo_tool.station_config import BoxConfig

TABLE = FakeTable(width=960, height=540)
VIEW = TABLE.live_view(0)
SPEC, CONFIG = WorkspaceSpec(), BoxConfig()


def target(box: list[int], table: FakeTable = TABLE, yaw: float = 0.0, stands: bool = True):
    return find_target(table.live_view(0), PixelBox(*box), yaw, SPEC, CONFIG, "pick", stands)


@pytest.mark.parametrize("block", BLOCKS)
def test_a_box_around_a_block_gives_its_centre(block: Block) -> None:
    found = target(TABLE.box_around(block))
    # the camera sees one side of it, within the finger height
    assert np.hypot(found.centroid[0] - block.x, found.centroid[1] - block.y) < 0.005
    assert found.top == pytest.approx(0.04, abs=0.002)
    assert 0.04 - CONFIG.finger_height <= found.centroid[2] <= 0.04
    assert found.width == pytest.approx(0.04, abs=0.004)


def test_the_box_may_be_much_larger_than_the_object() -> None:
    tight, wide = (target(TABLE.box_around(BLOCKS[0], margin)) for margin in (0, 25))
    assert np.linalg.norm(tight.centroid - wide.centroid) < 0.003


def test_only_what_the_fingers_reach_counts() -> None:
    tower = Block(0.45, 0.0, size=(0.04, 0.04, 0.15))
    found = target(TABLE.box_around(tower), FakeTable(blocks=[tower], width=960, height=540))
    heights = np.array(found.pixels)
    assert found.centroid[2] > 0.15 - CONFIG.finger_height and len(heights) == len(found.pixels)


def test_the_cloud_is_drawn_with_few_pixels_and_within_the_box() -> None:
    box = TABLE.box_around(BLOCKS[0])
    shown = np.array(target(box).shown_pixels())
    assert 50 < len(shown) <= 400
    assert (shown >= box[:2]).all() and (shown < box[2:]).all()


def test_a_place_needs_nothing_standing() -> None:
    found = target(TABLE.box_at(0.5, -0.28), stands=False)
    assert found.centroid == pytest.approx([0.5, -0.28, 0.0], abs=0.003)


def test_an_empty_table_holes_and_the_outside_are_said() -> None:
    with pytest.raises(BoxError, match=r"nothing stands in the pick box.* 0 mm above the table"):
        target(TABLE.box_at(0.5, -0.28))
    box = TABLE.box_around(BLOCKS[0])
    with pytest.raises(BoxError, match="knows the depth of 0 of the"):
        target(box, FakeTable(width=960, height=540, holes=[tuple(box)]))
    with pytest.raises(BoxError, match="outside the workspace"):
        target(TABLE.box_at(0.75, 0.0), stands=False)


def test_the_fingers_are_drawn_along_the_closing_direction() -> None:
    pose = PlanarPose(0.45, 0.0, np.pi / 2)
    outlines = np.array(finger_outlines(VIEW, pose, 0.03, CONFIG.hand))
    assert outlines.shape == (2, 4, 2)
    between = outlines[1].mean(axis=0) - outlines[0].mean(axis=0)
    direction = np.array(closing_directions(VIEW, 0.45, 0.0, 0.03, 36)[9])  # 90 degrees
    assert between / np.linalg.norm(between) == pytest.approx(direction, abs=0.02)
    middle = to_pixels(VIEW, np.array([[0.45, 0.0, 0.03]]))[0]
    assert outlines.mean(axis=(0, 1)) == pytest.approx(middle, abs=1.0)


def test_the_policys_crop_is_a_box_around_its_pose() -> None:
    box = box_around(VIEW, PlanarPose(0.42, -0.12, 0.3), 0.08, 0.0)
    assert box is not None
    inside = TABLE.box_around(BLOCKS[0], 0)
    assert box.top < inside[0] + 12 and box.bottom > inside[2] - 5 and box.left < inside[1] and box.right > inside[3]
    assert box_around(VIEW, PlanarPose(0.45, 5.0, 0.0), 0.08, 0.0) is None


def test_a_box_reaches_to_the_pictures_edges_and_no_further() -> None:
    camera = VIEW.camera
    box = box_around(VIEW, PlanarPose(0.45, 0.0, 0.0), 1.6, 0.0)
    assert box is not None
    assert box == PixelBox(box.top, 0, camera.height, camera.width)
