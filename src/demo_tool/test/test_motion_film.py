"""The film of a motion: begun when the arm moves, kept beside the step, and never a reason to lose one."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from station_fakes import FakeArm

from cliport_core.action import ActionGoal
from cliport_core.errors import ImageError
from cliport_core.image_files import decode_color_file, encode_jpeg
from cliport_core.outcome import ActionResult, Outcome
from cliport_episodes.errors import DiskError
from cliport_episodes.motion_video import read_frames, video_path
from demo_tool import motion_film, recording
from demo_tool.motion_film import MotionFilm
from demo_tool.picture_feed import PictureFeed

DONE = ActionResult(Outcome.SUCCEEDED, "done", (0.42, -0.12, 0.03), 0.04)


class FilmedArm(FakeArm):
    """Moves for as long as a test lets it."""

    def send(self, goal: ActionGoal, on_phase, on_end) -> None:
        self.goals.append(goal)
        self.on_phase, self.on_end = on_phase, on_end
        on_phase("ACCEPTED", 0.0)

    def move(self) -> None:
        self.on_phase("DESCEND", 0.5)


def picture(shade: int, size: tuple[int, int] = (640, 360)) -> np.ndarray:
    return np.full((size[1], size[0], 3), shade, np.uint8)


def films() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name == "film"]


def until(holds) -> None:
    end = time.monotonic() + 20.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.005)


@pytest.fixture
def moving(make_bench):
    """A bench whose arm has a goal; `film` is that of its station."""
    bench = make_bench(FilmedArm())
    bench.begin()
    bench.draw()
    bench.do("execute")
    bench.film = bench.station._work._hooks.film
    return bench


def frames_of(bench) -> tuple:
    step = bench.episode().steps[-1]
    return read_frames(video_path(step.path.parent, step.record.stamp_ns))[0]


def test_a_motion_is_filmed_and_found_at_its_step(moving) -> None:
    assert not films(), "nothing moves yet"
    moving.arm.move()
    until(lambda: len(moving.film._frames) == 1)
    moving.see()
    until(lambda: len(moving.film._frames) == 2)
    moving.arm.on_end(DONE)
    assert len(frames_of(moving)) == 2 and not films()
    name = moving.view["episode"]["name"]
    (step,) = moving.do("episode", name=name)["steps"]
    assert step["frames"] == 2
    assert decode_color_file(moving.station.motion_picture(name, 0, 1)).shape == (180, 320, 3)
    with pytest.raises(Exception, match="2 frames"):
        moving.station.motion_picture(name, 0, 2)


def test_a_plan_is_not_filmed(moving) -> None:
    moving.arm.on_phase("GRASP_PLANNING", 0.1)
    moving.arm.on_end(ActionResult(Outcome.PLANNING_FAILED, "no way"))
    moving.rest()
    moving.do("preview")
    moving.arm.on_phase("DESCEND", 0.5)
    assert not films()


@pytest.mark.parametrize("where", ["disk", "pictures"])
def test_a_step_is_recorded_without_its_film(moving, monkeypatch, where) -> None:
    def refuse(*_: object) -> None:
        raise DiskError(moving.root, "no room", "") if where == "disk" else ImageError("no such encoding")

    monkeypatch.setattr(*((recording, "write_video") if where == "disk" else (motion_film, "encode_jpeg")), refuse)
    moving.arm.move()
    until(lambda: moving.film._frames or not films())
    moving.arm.on_end(DONE)
    assert len(moving.steps) == 1 and moving.state == "stale" and not moving.view["unsaved"]
    assert (
        frames_of(moving) == () and moving.do("episode", name=moving.view["episode"]["name"])["steps"][0]["frames"] == 0
    )


def test_a_step_that_is_saved_again_has_its_film(moving, monkeypatch) -> None:
    moving.arm.move()
    until(lambda: moving.film._frames)
    add = moving.station._recorder.add_step

    def refuse(*_: object) -> None:
        raise DiskError(moving.root, "no room", "")

    monkeypatch.setattr(moving.station._recorder, "add_step", refuse)
    moving.arm.on_end(DONE)
    assert moving.view["unsaved"]
    monkeypatch.setattr(moving.station._recorder, "add_step", add)
    moving.do("save_again")
    assert len(frames_of(moving)) == 1


def test_a_damaged_film_does_not_hide_the_step(moving) -> None:
    moving.arm.move()
    until(lambda: moving.film._frames)
    moving.arm.on_end(DONE)
    step = moving.episode().steps[0]
    video_path(step.path.parent, step.record.stamp_ns).write_bytes(b"RIFF")
    (shown,) = moving.do("episode", name=moving.view["episode"]["name"])["steps"]
    assert shown["frames"] == 0 and shown["outcome"] == "succeeded"


def test_a_step_that_did_not_move_shows_no_other_ones_film(make_bench) -> None:
    bench = make_bench(FilmedArm())
    bench.begin()
    bench.draw()
    bench.do("record")
    bench.do("pick", box=bench.table.box_around(bench.table.blocks[0]), rotation=0)
    bench.do("place", box=bench.table.box_at(0.5, -0.28), rotation=0)
    bench.do("execute")
    bench.arm.move()
    until(lambda: bench.station._work._hooks.film._frames)
    bench.arm.on_end(DONE)
    steps = bench.do("episode", name=bench.view["episode"]["name"])["steps"]
    assert [step["frames"] for step in steps] == [0, 1]


def test_a_long_film_is_thinned_to_its_bound_and_keeps_its_length(monkeypatch) -> None:
    taken = list[np.ndarray]()

    def encoded(pixels: np.ndarray, quality: int) -> bytes:
        taken.append(pixels)
        return encode_jpeg(pixels, quality)

    monkeypatch.setattr(motion_film, "encode_jpeg", encoded)
    monkeypatch.setattr(motion_film, "MOST_FRAMES", 8)
    monkeypatch.setattr(motion_film, "PERIOD", 0.0)
    feed = PictureFeed()
    film = MotionFilm(feed)
    film.begin()
    for number in range(40):
        feed.put(number * 100_000_000, lambda shade=5 * number: picture(shade))
        until(lambda count=number + 1: len(taken) == count)
    video = film.taken()
    assert video is not None and 4 <= len(video.frames) < 8 and (video.width, video.height) == (320, 180)
    shades = [int(decode_color_file(frame)[0, 0, 0]) for frame in video.frames]
    assert shades[0] < 3 and shades[-1] > 150 and sorted(shades) == shades
    assert video.period == pytest.approx(0.1 * (shades[-1] - shades[0]) / 5 / (len(shades) - 1), rel=0.1)


def test_frames_of_another_size_are_left_out(monkeypatch) -> None:
    monkeypatch.setattr(motion_film, "PERIOD", 0.0)
    feed = PictureFeed()
    film = MotionFilm(feed)
    feed.put(1, lambda: picture(10, (100, 60)))
    film.begin()
    until(lambda: film._frames)
    feed.put(2, lambda: picture(10, (100, 70)))
    time.sleep(0.1)
    video = film.taken()
    assert video is not None and len(video.frames) == 1 and (video.width, video.height) == (100, 60)


def test_no_picture_no_film() -> None:
    film = MotionFilm(PictureFeed())
    assert film.taken() is None
    film.begin()
    film.end()
    assert film.taken() is None and not films()
