"""Pictures are kept once and decoded only for those who look; changes are counted."""

import json
import threading

import numpy as np
import pytest

from demo_tool.bulletin import Bulletin
from demo_tool.errors import StationError
from demo_tool.picture_feed import Picture, PictureFeed

RGB = np.zeros((2, 3, 3), np.uint8)


def test_only_the_newest_is_kept_and_only_what_is_asked_for_is_decoded() -> None:
    decoded: list[int] = []
    feed = PictureFeed()
    assert feed.get(0, 0.0) is None
    for stamp in range(5):
        feed.put(stamp, lambda stamp=stamp: decoded.append(stamp) or RGB)
    assert decoded == []
    for _ in range(3):
        picture = feed.get(0, 0.0)
        assert picture is not None and picture[:2] == (5, 4)
    assert decoded == [4]
    assert feed.get(5, 0.0) is None
    assert feed.get(99, 0.0) is not None  # of a station that was there before this one


def test_a_wait_ends_with_the_next_picture() -> None:
    feed = PictureFeed()
    got: list[Picture | None] = []
    waiting = threading.Thread(target=lambda: got.append(feed.get(0, 3600.0)), daemon=True)
    waiting.start()
    threading.Timer(0.05, lambda: feed.put(7, lambda: RGB)).start()
    waiting.join(60.0)
    assert got and got[0] is not None and got[0].stamp_ns == 7


def test_changes_are_counted_and_waited_for() -> None:
    bulletin = Bulletin()
    before = bulletin.changed
    assert bulletin.wait(before, 0.0) == before
    threading.Timer(0.05, bulletin.touch).start()
    assert bulletin.wait(before, 5.0) == before + 1


def test_the_station_serves_its_streams(bench) -> None:
    bench.see()
    color = bench.station.picture("color", 0, 0.0)
    assert color is not None and color.pixels.shape == (270, 480, 3)
    bench.station.on_heightmap(5, lambda: RGB)
    bench.station.on_affordance("pick", 6, lambda: RGB)
    assert bench.station.picture("heightmap", 0, 0.0).stamp_ns == 5
    assert bench.station.picture("pick_affordance", 0, 0.0).stamp_ns == 6
    assert bench.station.picture("place_affordance", 0, 0.0) is None


def test_a_picture_that_cannot_be_decoded_is_said(bench) -> None:
    def broken() -> np.ndarray:
        raise OSError("not an image")

    bench.station.on_heightmap(5, broken)
    with pytest.raises(StationError, match="not an image"):
        bench.station.picture("heightmap", 0, 0.0)


def test_the_view_is_plain_values_and_says_how_fresh_the_picture_is(bench) -> None:
    for _ in range(11):
        bench.see()
        bench.now += 0.15
    bench.station.tick(bench.now_ns)
    assert bench.view["camera"] == {"width": 480, "height": 270, "age_ms": 150, "fps": 6.7}
    bench.do("open_data_set", name="blocks")
    bench.draw()
    view = bench.station.view("me")
    json.dumps(view, allow_nan=False)
    assert view["holder"] == "me" and view["n_rotations"] == 36 and view["data_sets"] == ["blocks"]
    pick = view["draft"]["pick"]
    assert len(pick["directions"]) == 36 and len(pick["footprint"]) == 2
    assert pick["grasp"]["points"] > 50 and len(pick["grasp"]["cloud_pixels"]) <= 400


def test_the_draft_follows_the_picture(bench) -> None:
    bench.begin()
    bench.draw()
    assert bench.view["draft"]["pick"]["grasp"] is not None
    bench.table.blocks = []
    bench.now += 1.1
    bench.see()
    assert bench.view["draft"]["pick"]["grasp"] is None
    assert "nothing stands" in bench.view["draft"]["pick"]["words"]
