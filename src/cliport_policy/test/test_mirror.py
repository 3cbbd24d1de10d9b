"""A scene in a mirror: picture, poses and words stay true to each other."""

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_policy.config import NetworkConfig, TrainConfig
from cliport_policy.data.batches import Phrasebook, Sample, make_sample
from cliport_policy.data.demonstrations import Demonstration, load_demonstrations
from cliport_policy.data.mirror import MIRRORS, Mirror, draw_mirror, mirrored_sentences
from cliport_policy.data.mixture import Drawn, Source, SourceSettings
from cliport_policy.language import shared_encoder
from cliport_policy.training.trainer import Trainer

LEFT_TO_RIGHT, TOP_TO_BOTTOM, BOTH = MIRRORS
PLAIN = TrainConfig(jitter=False, augment_probability=0.0)


@pytest.mark.parametrize(
    ("mirror", "before", "after"),
    [
        (LEFT_TO_RIGHT, "put the red ring in the left ring hole", "put the red ring in the right ring hole"),
        (LEFT_TO_RIGHT, "put the red ring in the top ring hole", "put the red ring in the top ring hole"),
        (TOP_TO_BOTTOM, "put the red ring in the bottom ring hole", "put the red ring in the top ring hole"),
        (TOP_TO_BOTTOM, "put the red ring in the right ring hole", "put the red ring in the right ring hole"),
        (BOTH, "the left one at the top", "the right one at the bottom"),
        (BOTH, "near, far, front, back, stop, brighter", "far, near, back, front, stop, brighter"),
    ],
)
def test_words_for_sides_are_exchanged(mirror: Mirror, before: str, after: str) -> None:
    assert mirror.sentence(before) == after and mirror.sentence(after) == before


def test_all_that_a_sentence_may_become_is_known() -> None:
    sentence = "put the red ring in the left ring hole"
    assert mirrored_sentences(sentence) == {sentence, "put the red ring in the right ring hole"}
    drawn = [draw_mirror(np.random.default_rng(seed)) for seed in range(30)]
    assert set(drawn) == set(MIRRORS)


@pytest.mark.parametrize(("mirror", "yaw"), [(LEFT_TO_RIGHT, -0.7), (TOP_TO_BOTTOM, math.pi - 0.7), (BOTH, 0.7)])
def test_pixels_and_yaws_move_as_the_picture_does(mirror: Mirror, yaw: float) -> None:
    demo = Demonstration("it", False, (40, 30), 0.7, math.pi, (100, 110), -0.2)
    seen = mirror.demonstration(demo, (320, 160))
    assert seen.pick_pixel == (279 if mirror.rows else 40, 129 if mirror.columns else 30)
    assert math.remainder(seen.pick_yaw - yaw, math.pi) == pytest.approx(0)
    assert mirror.demonstration(seen, (320, 160)).place_pixel == demo.place_pixel
    ahead = (demo.pick_pixel[0] + round(20 * math.sin(0.7)), demo.pick_pixel[1] + round(20 * math.cos(0.7)))
    there = mirror.demonstration(replace(demo, pick_pixel=ahead), (320, 160)).pick_pixel
    way = math.atan2(there[0] - seen.pick_pixel[0], there[1] - seen.pick_pixel[1])
    assert math.remainder(way - seen.pick_yaw, 2 * math.pi) == pytest.approx(0, abs=0.05)
    done = replace(demo, done=True, pick_pixel=(-1, -1))
    assert mirror.demonstration(done, (320, 160)) == done


def test_a_training_knows_repainted_sentences_in_a_mirror_too(
    make_flat_set: Callable[..., Path], tmp_path: Path
) -> None:
    folder = make_flat_set(tmp_path / "data", 3, actions=1, sentence="put the red blocks in the left blue bowl")
    config = replace(PLAIN, batch_size=16, recolor="demonstrated", recolor_probability=0.5, mirror_probability=0.7)
    source = Source(load_demonstrations(folder), settings=SourceSettings(paraphrase=False))
    trainer = Trainer([source], tmp_path / "run", NetworkConfig(widths=(16, 16, 16, 16)), config, shared_encoder(), {})
    phrases = {phrase for number in range(3) for phrase in trainer.loader.step(number).parts[0].phrases}
    pairs = itertools.product((("red", "blue"), ("blue", "red")), ("left", "right"))
    expected = {f"put the {block} blocks in the {side} {bowl} bowl" for (block, bowl), side in pairs}
    assert phrases == expected


def test_a_sample_is_mirrored_whole(make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    data = load_demonstrations(make_flat_set(tmp_path / "data", 1))
    demo = replace(data.frames[0].demos[0], instruction="take the left one", pick_yaw=0.7, place_yaw=-0.4)
    drawn = Drawn(data, data.frames[0], demo, data.frames[0])
    book = Phrasebook(dict.fromkeys(mirrored_sentences(demo.instruction), 0), np.random.default_rng(0))

    def sample(probability: float, seed: int) -> Sample:
        config = replace(PLAIN, mirror_probability=probability)
        return make_sample(drawn, book, None, config, np.random.default_rng(seed))

    plain, phrases = sample(0.0, 0), set()
    for seed in range(12):
        seen = sample(1.0, seed)
        phrases.add(seen.phrase)
        assert not np.array_equal(seen.image, plain.image)
        for before, after in ((plain.pick, seen.pick), (plain.place, seen.place)):
            here, there = (tuple(map(round, pixel)) for pixel in (before, after))
            assert seen.image[there] == pytest.approx(plain.image[here])
        assert seen.goal_image is not None and np.array_equal(seen.goal_image, seen.image)
        assert abs(seen.rotation) == pytest.approx(1.1) and seen.pick_yaw_period == plain.pick_yaw_period
        assert (seen.rotation < 0) == ((seen.pick[0] == plain.pick[0]) == (seen.pick[1] == plain.pick[1]))
    assert phrases == {"take the left one", "take the right one"}


@pytest.mark.parametrize(
    ("side", "in_one"),
    [
        ("front left tip to back left corner", "front right tip to back right corner"),
        ("front right tip to back right corner", "front left tip to back left corner"),
        ("front left tip to front right tip", "front left tip to front right tip"),
        ("back right corner to back left corner", "back right corner to back left corner"),
    ],
)
def test_the_ropes_square_keeps_its_front_in_a_mirror_and_its_left_is_right(side: str, in_one: str) -> None:
    sentence = f"align the rope from {side}"
    for mirror in MIRRORS:
        turned = mirror.rows and mirror.columns  # half a turn turns the square with it
        assert mirror.sentence(sentence) == (sentence if turned else f"align the rope from {in_one}")
