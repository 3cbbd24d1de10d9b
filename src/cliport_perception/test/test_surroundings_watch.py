"""The picture around the workspace: missed when the camera has moved in ways that leave the table's plane alone."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from cliport_core import Pose, WorkspaceSpec
from cliport_perception import CameraModel
from cliport_perception.surroundings_watch import SurroundingsWatch

S = 1_000_000_000
LENS = CameraModel(480, 270, 270.0, 270.0, 240.0, 135.0)
PLACE = Pose.looking_at((0.92, 0.0, 0.87), (0.45, 0.0, 0.0))
SPOTS = np.random.default_rng(3).uniform(40, 200, (24, 24)).astype(np.float32)


def picture(place: Pose, rng: np.random.Generator, things: float = 0.0, plain: bool = False) -> np.ndarray:
    """A table with large soft spots, as a camera sees it; things: where one lies on the workspace [m along y]."""
    rays = LENS.rays().astype(np.float64) @ place.rotation.T
    x, y = np.moveaxis(rays * (-place.translation[2] / rays[..., 2])[..., None] + place.translation, -1, 0)[:2]
    if plain:
        gray = np.full(x.shape, 120.0, np.float32)
    else:
        at = [((v + 2.0) * 23 / 4.0).astype(np.float32) for v in (x, y)]
        gray = cv2.remap(SPOTS, at[0], at[1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)
    gray[(np.abs(x - 0.45) < 0.05) & (np.abs(y - things) < 0.05)] = 250.0
    noisy = gray + rng.normal(0.0, 3.0, gray.shape)
    return np.repeat(np.clip(noisy, 0, 255).astype(np.uint8)[..., None], 3, axis=-1)


class Watched:
    """A watch that has a picture a second."""

    def __init__(self) -> None:
        self.watch, self.rng, self.seconds = (
            SurroundingsWatch(LENS, PLACE, WorkspaceSpec()),
            np.random.default_rng(0),
            0,
        )

    def see(
        self,
        place: Pose = PLACE,
        count: int = 3,
        cover: int | None = None,
        gain: float = 1.0,
        dark: float = 0.0,
        **more: float,
    ) -> str | None:
        for _ in range(count):
            shown = (gain * picture(place, self.rng, **more) + dark).astype(np.uint8)
            if cover is not None:  # the arm
                shown[:200, cover : cover + 100] = np.linspace(150, 250, 100).astype(np.uint8)[:, None]
            words = self.watch.check(shown, self.seconds * S)
            self.seconds += 1
        return words


def slid(seed: int, share: float = 1.0) -> Pose:
    """The camera after a bump of 1 cm along the table and 1 degree about the vertical, or of a share of that."""
    rng = np.random.default_rng(seed)
    way, side = rng.uniform(0.0, 2.0 * math.pi), rng.choice([-1.0, 1.0])
    turn = Rotation.from_rotvec([0.0, 0.0, side * share * math.radians(1.0)]).as_matrix()
    return Pose(turn @ PLACE.rotation, PLACE.translation + 0.01 * share * np.array([math.cos(way), math.sin(way), 0.0]))


@pytest.mark.parametrize("seed", range(10))
def test_a_bump_along_the_table_and_about_the_vertical_is_noticed_at_the_second_look(seed: int) -> None:
    watched = Watched()
    assert watched.see() is None
    assert watched.see(slid(seed), 1) is None
    words = watched.see(slid(seed), 1)
    assert words is not None and words.startswith("the camera was moved: all that it sees around the workspace lies ")
    assert watched.watch.check(picture(PLACE, watched.rng), watched.seconds * S - S // 2) == words, "no look was due"
    assert watched.see() is None, "it was put back"


def test_what_lies_on_the_workspace_may_move_and_the_light_may_change() -> None:
    watched = Watched()
    assert watched.see() is None
    for y in (-0.3, 0.1, 0.35):
        assert watched.see(things=y) is None
    assert watched.see(gain=0.8) is None


def test_an_arm_before_the_camera_is_no_bump_and_is_seen_past_once_it_has_stood_there() -> None:
    watched = Watched()
    assert watched.see() is None
    assert watched.see(cover=200) is None
    assert watched.see(slid(0), cover=200) is not None
    assert watched.see(cover=200) is None
    assert watched.see() is None
    assert watched.see(slid(1)) is not None


@pytest.mark.parametrize("aside", [4, 8, 14])
def test_an_arm_that_stands_near_where_it_stood_is_no_bump_though_it_is_most_of_what_is_seen(aside: int) -> None:
    watched = Watched()
    dull = {"gain": 0.35, "dark": 30.0}
    assert watched.see(**dull) is None
    assert watched.see(cover=200, **dull) is None
    assert watched.see(cover=200 + aside, **dull) is None
    assert watched.see(slid(2), **dull) is not None


@pytest.mark.parametrize(("seed", "aside"), [(2, 2), (4, -1), (4, -2)])
def test_a_small_bump_is_noticed_though_an_arm_before_the_camera_moves_otherwise(seed: int, aside: int) -> None:
    """It is nearer than the table: less of the picture is explained than by a larger bump."""
    watched = Watched()
    dull = {"gain": 0.35, "dark": 30.0}
    assert watched.see(cover=200, **dull) is None
    assert watched.see(slid(seed, 0.5), cover=200 + aside, **dull) is not None


def test_what_no_motion_explains_is_not_searched_at_full_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """An arm on its way, at every look: a search at full size, from each view, would hold up clouds."""
    widths, search = [], cv2.findTransformECC

    def noted(before: np.ndarray, *more: object) -> object:
        widths.append(before.shape[1])
        return search(before, *more)

    watched = Watched()
    assert watched.see() is None
    monkeypatch.setattr(cv2, "findTransformECC", noted)
    for cover in (100, 200, 300):
        assert watched.see(cover=cover, count=1) is None
    assert widths and set(widths) == {80}
    assert watched.see(slid(0)) is not None and 320 in widths


def test_plain_surroundings_say_nothing() -> None:
    watched = Watched()
    assert watched.see(plain=True) is None
    assert watched.see(slid(0), plain=True) is None


def test_a_clock_that_was_set_back_stops_no_look() -> None:
    watched = Watched()
    watched.seconds = 500
    assert watched.see() is None
    watched.seconds = 3
    assert watched.see(slid(0)) is not None
