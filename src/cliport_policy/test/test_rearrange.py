"""In another arrangement a demonstration still shows what its sentence says."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.config import TrainConfig
from cliport_policy.data.batches import Phrasebook, make_sample
from cliport_policy.data.demonstrations import Demonstration, load_demonstrations
from cliport_policy.data.mixture import Mixture, Source
from cliport_policy.data.rearrange import rearranged
from cliport_policy.data.things import find_things
from cliport_policy.errors import ConfigError

RED, BLUE, GREEN, TABLE = (200, 30, 30), (30, 30, 200), (30, 200, 30), (90, 90, 90)
BAR, PAD, DISC = (slice(40, 48), slice(30, 60)), (slice(100, 130), slice(40, 70)), (slice(200, 220), slice(90, 110))
DEMO = Demonstration("put the red bar on the blue pad", False, (44, 45), 0.0, math.pi, (115, 55), 0.5)


def _scene(*things: tuple[tuple[slice, slice], tuple[int, int, int]]) -> Heightmap:
    workspace = WorkspaceSpec()
    color = np.full((*workspace.shape, 3), TABLE, np.uint8)
    height = np.full(workspace.shape, 0.001, np.float32)
    for (rows, cols), shade in things:
        color[rows, cols], height[rows, cols] = shade, 0.03
    return Heightmap(color, height, np.ones(workspace.shape, np.bool_), workspace)


def _usual() -> Heightmap:
    return _scene((BAR, RED), (PAD, BLUE), (DISC, GREEN))


def _is(scene: Heightmap, color: tuple[int, int, int]) -> NDArray[np.bool_]:
    return (scene.color == color).all(2)


def _yaw(mask: NDArray[np.bool_]) -> float:
    """Along which a mask is longest: rad from columns towards rows, modulo half a turn."""
    rows, cols = np.nonzero(mask)
    values, vectors = np.linalg.eigh(np.cov(np.stack((cols, rows)).astype(float)))
    col, row = vectors[:, values.argmax()]
    return math.atan2(row, col)


def test_poses_go_with_their_things() -> None:
    scene, places = _usual(), set()
    for seed in range(30):
        moved, demo = rearranged(scene, DEMO, np.random.default_rng(seed))
        places.add(demo.pick_pixel)
        for color, pixel in ((RED, demo.pick_pixel), (BLUE, demo.place_pixel)):
            rows, cols = np.nonzero(_is(moved, color))
            assert len(rows) == pytest.approx(_is(scene, color).sum(), rel=0.1)
            assert math.dist(pixel, (rows.mean(), cols.mean())) < 1.5
            assert (moved.height[rows, cols] == np.float32(0.03)).all()
        turned = math.remainder(_yaw(_is(moved, RED)) - demo.pick_yaw, math.pi)
        assert abs(turned) < math.radians(3)
        assert ((moved.height > 0.02) == ~_is(moved, TABLE)).all()  # nothing is left where the things were
    assert len(places) > 25
    assert (scene.color == _usual().color).all() and (scene.height == _usual().height).all()


def test_the_pads_turn_is_the_places() -> None:
    """A pad that is a bar shows how it was turned."""
    scene = _scene((BAR, RED), ((slice(100, 106), slice(40, 70)), BLUE))
    for seed in range(10):
        moved, demo = rearranged(scene, replace(DEMO, place_pixel=(102, 55)), np.random.default_rng(seed))
        assert abs(math.remainder(_yaw(_is(moved, BLUE)) - (demo.place_yaw - 0.5), math.pi)) < math.radians(3)


def test_a_place_on_the_table_stays_and_stays_free() -> None:
    for seed in range(30):
        moved, demo = rearranged(_usual(), replace(DEMO, place_pixel=(160, 80)), np.random.default_rng(seed))
        assert demo.place_pixel == (160, 80) and demo.place_yaw == 0.5
        assert demo.pick_pixel != DEMO.pick_pixel and _is(moved, TABLE)[153:168, 73:88].all()


def test_a_finished_scene_is_rearranged_without_poses() -> None:
    done = replace(DEMO, done=True)
    moved, demo = rearranged(_usual(), done, np.random.default_rng(0))
    assert demo == done and (moved.color != _usual().color).any()


def test_what_a_thing_hides_goes_with_it() -> None:
    scene = _usual()
    scene.valid[48:54, 30:60] = False
    scene.color[48:54, 30:60] = 0
    moved, _ = rearranged(scene, DEMO, np.random.default_rng(1))
    assert (~moved.valid).sum() == pytest.approx((~scene.valid).sum(), rel=0.1)
    assert moved.valid[48:54, 30:60].all() and (_is(moved, (0, 0, 0)) == ~moved.valid).all()


def test_what_leaves_the_picture_stays() -> None:
    scene = _scene((BAR, RED), (PAD, BLUE), ((slice(200, 220), slice(140, 160)), GREEN))
    assert [thing.movable for thing in find_things(scene)].count(False) == 1
    for seed in range(5):
        moved, _ = rearranged(scene, DEMO, np.random.default_rng(seed))
        assert (_is(moved, GREEN) == _is(scene, GREEN)).all()


@pytest.mark.parametrize(
    ("scene", "demo"),
    [
        (_usual(), replace(DEMO, instruction="put the bar left of the blue pad")),
        (_usual(), replace(DEMO, pick_pixel=(10, 10))),
        (_scene((BAR, RED), ((slice(70, 300), slice(5, 155)), BLUE), ((slice(20, 35), slice(5, 155)), GREEN)), DEMO),
        (_scene(((slice(None), slice(None)), RED)), DEMO),
        (_scene(), DEMO),
    ],
    ids=["a direction", "nothing at the pick", "no room", "no table", "nothing at all"],
)
def test_what_cannot_be_rearranged_is_left_alone(scene: Heightmap, demo: Demonstration) -> None:
    for seed in range(3):
        same, also = rearranged(scene, demo, np.random.default_rng(seed))
        assert same is scene and also is demo


def test_samples_are_rearranged_when_asked(flat_set: Path) -> None:
    mixture = Mixture([Source(load_demonstrations(flat_set))])
    drawn = next(mixture[i] for i in range(len(mixture)) if not mixture[i].demo.done)
    picks = []
    for probability in (0.0, 1.0):
        config = TrainConfig(rearrange_probability=probability, augment_probability=0.0, jitter=False)
        book = Phrasebook(dict.fromkeys(mixture.instructions(), 1), np.random.default_rng(0))
        sample = make_sample(drawn, book, None, config, np.random.default_rng(0))
        picks.append(sample.pick)
    assert picks[0] == drawn.demo.pick_pixel != picks[1]
    with pytest.raises(ConfigError, match="rearrange_probability=2"):
        TrainConfig(rearrange_probability=2.0)
