"""A click on a thing: its box, and fingers across its narrow side."""

from __future__ import annotations

import math

import pytest
from station_fakes import Block, FakeTable

from demo_tool.errors import BoxError
from demo_tool.pointed_object import spot_at, thing_at
from demo_tool.station_config import BoxConfig

NS = 1_000_000_000
LONG_X = Block(0.45, 0.05, size=(0.10, 0.03, 0.04))
LONG_Y = Block(0.45, 0.05, size=(0.03, 0.10, 0.04))


def pixel_of(table: FakeTable, x: float, y: float, z: float) -> tuple[int, int]:
    row, col = table.camera.project(table.camera_in_base.inverse().apply([[x, y, z]]))[0]
    return int(row), int(col)


@pytest.mark.parametrize(("block", "yaw"), [(LONG_X, math.pi / 2), (LONG_Y, 0.0)])
def test_a_box_goes_around_the_thing_and_the_fingers_across_it(block: Block, yaw: float) -> None:
    table = FakeTable(blocks=[block, Block(0.45, -0.15)])
    view = table.live_view(NS)
    thing = thing_at(view, *pixel_of(table, block.x, block.y, 0.04), BoxConfig())
    assert thing is not None
    top, left, bottom, right = table.box_around(block, margin=0)
    box = thing.box
    assert max(abs(box.top - top), abs(box.left - left), abs(box.right - right)) <= 4
    assert abs(box.bottom - bottom) <= 4
    assert min(abs(thing.yaw - yaw), math.pi - abs(thing.yaw - yaw)) < math.radians(6)


def test_things_a_step_apart_are_two() -> None:
    near, far = Block(0.50, 0.0), Block(0.44, 0.0)  # the nearer hides the farther one's foot
    table = FakeTable(blocks=[near, far])
    view = table.live_view(NS)
    for block in (near, far):
        thing = thing_at(view, *pixel_of(table, block.x, block.y, 0.04), BoxConfig())
        assert thing is not None
        _, left, _, right = table.box_around(block, margin=0)
        assert abs(thing.box.left - left) <= 4 and abs(thing.box.right - right) <= 4
        assert thing.box.bottom - thing.box.top < 40


def test_a_click_may_miss_by_a_little_and_not_by_more() -> None:
    table = FakeTable(blocks=[LONG_X])
    view = table.live_view(NS)
    top, left, bottom, _ = table.box_around(LONG_X, margin=0)
    row = (top + bottom) // 2
    assert thing_at(view, row, left - 2, BoxConfig()) is not None
    assert thing_at(view, row, left - 12, BoxConfig()) is None
    assert thing_at(FakeTable(blocks=[]).live_view(NS), row, left, BoxConfig()) is None
    specks = FakeTable(blocks=[Block(0.45, 0.05, size=(0.002, 0.002, 0.04))])
    assert thing_at(specks.live_view(NS), *pixel_of(specks, 0.45, 0.05, 0.04), BoxConfig()) is None


def test_a_spot_of_the_table_has_a_box_of_five_centimetres() -> None:
    table = FakeTable(blocks=[])
    view = table.live_view(NS)
    row, col = pixel_of(table, 0.45, 0.1, 0.0)
    box = spot_at(view, row, col, 0.0)
    assert box.top <= row <= box.bottom and box.left <= col <= box.right
    assert pixel_of(table, 0.475, 0.075, 0.0)[0] == pytest.approx(box.bottom, abs=2)
    with pytest.raises(BoxError, match="the table is not to be seen there"):
        spot_at(view, 0, 0, 5.0)


def test_the_page_draws_what_is_clicked(bench) -> None:
    bench.begin()
    bench.do("instruction", text="put the red block beside the green one")
    block = bench.table.blocks[0]
    pixel = list(pixel_of(bench.table, block.x, block.y, 0.04))
    assert bench.do("point", end="pick", pixel=pixel, rotation=0)["ok"] is True
    spot = list(pixel_of(bench.table, 0.5, -0.25, 0.0))
    assert "nothing stands there" in bench.refused("point", end="pick", pixel=spot, rotation=0)
    assert bench.do("point", end="place", pixel=spot, rotation=7)["ok"] is True
    draft = bench.view["draft"]
    assert draft["place"]["rotation"] == 7
    bench.do("record")
    pick = bench.episode().steps[-1].record.action.pick
    assert math.hypot(pick.x - block.x, pick.y - block.y) < 0.01


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"end": "both", "pixel": [1, 1], "rotation": 0}, "'end' must be pick or place, got 'both'"),
        ({"end": "pick", "pixel": [1], "rotation": 0}, "'pixel' must be [row, col]"),
        ({"end": "pick", "pixel": [float("nan"), 1], "rotation": 0}, "'pixel' must be [row, col]"),
        ({"end": "pick", "pixel": [270, 1], "rotation": 0}, "is not in the picture of 270 rows and 480 columns"),
        ({"end": "place", "pixel": [1, 1], "rotation": 36}, "rotation"),
    ],
)
def test_a_click_that_cannot_be_is_refused(bench, arguments, words: str) -> None:
    bench.begin()
    assert words in bench.refused("point", **arguments)
