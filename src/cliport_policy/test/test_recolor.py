"""In other colours a demonstration still shows what its sentence says."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from cliport_policy.config import TrainConfig
from cliport_policy.data.batches import Phrasebook
from cliport_policy.data.color_names import BASIC_TERMS, distance, lab, rename, rgb, surveyed_shades, terms_in
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.loader import Loader
from cliport_policy.data.mixture import Drawn, Mixture, Source
from cliport_policy.data.recolor import Recoloring, named_colors

MakeSet = Callable[..., Path]


def _mixture(make: MakeSet, folder: Path, sentence: str = "put the red blocks in a blue bowl") -> Mixture:
    return Mixture([Source(load_demonstrations(make(folder / "set", 3, actions=1, sentence=sentence)))])


def _at(image: np.ndarray, pixel: tuple[int, int]) -> np.ndarray:
    return lab(image[pixel[0], pixel[1]][None])


def _acting(mixture: Mixture) -> Drawn:
    return next(mixture[i] for i in range(len(mixture)) if not mixture[i].demo.done)


def test_the_survey_calls_the_pure_colours_by_their_names() -> None:
    pure = {"red": (255, 0, 0), "green": (0, 200, 0), "blue": (0, 0, 255), "yellow": (255, 255, 0), "gray": (128,) * 3}
    for term, color in pure.items():
        apart = {name: distance(lab(np.float32([color])), shades)[0] for name, shades in surveyed_shades().items()}
        assert min(apart, key=lambda name: float(apart[name])) == term
    assert set(surveyed_shades()) == set(BASIC_TERMS) and all(len(s) > 0 for s in surveyed_shades().values())


def test_cielab_and_back() -> None:
    colors = np.random.default_rng(0).integers(0, 256, (50, 3)).astype(np.uint8)
    assert np.abs(rgb(lab(colors)).astype(int) - colors).max() <= 1


@pytest.mark.parametrize(
    ("sentence", "terms", "renamed"),
    [
        ("put the red blocks in a blue bowl", ["red", "blue"], "put the blue blocks in a red bowl"),
        ("Red, and red again: bluer is not blue", ["red", "blue"], "blue, and blue again: bluer is not red"),
        ("the grey block", ["gray"], "the grey block"),
        ("pack the hexagon", [], "pack the hexagon"),
    ],
)
def test_colours_of_a_sentence_are_found_and_exchanged(sentence: str, terms: list[str], renamed: str) -> None:
    assert terms_in(sentence) == terms
    assert rename(sentence, {"red": "blue", "blue": "red"}) == renamed


def test_what_was_red_is_what_the_sentence_names_now(make_flat_set: MakeSet, tmp_path: Path) -> None:
    mixture = _mixture(make_flat_set, tmp_path)
    drawn = _acting(mixture)
    scene = drawn.data.observation(drawn.frame)
    for surveyed in (False, True):
        recoloring = Recoloring(mixture, surveyed, np.random.default_rng(0))
        rng = np.random.default_rng(1)
        for _ in range(20):
            paints = recoloring.draw(drawn, rng)
            assert paints is not None and set(paints.terms) == {"red", "blue"}
            image = paints.image(scene)
            for old, pixel in (("red", drawn.demo.pick_pixel), ("blue", drawn.demo.place_pixel)):
                new = paints.terms[old]
                known = {"red": (255, 87, 89), "blue": (78, 121, 167)}
                shades = lab(np.float32([known[new]])) if new in known else surveyed_shades()[new]
                assert distance(_at(image, pixel), shades) < 4
            table = scene.height < 0.01
            assert (image[table] == scene.color[table]).all()
            assert paints.sentence(drawn.demo.instruction) in recoloring.sentences_of(drawn.demo.instruction)


def test_only_demonstrated_colours_are_exchanged_unless_the_survey_is_asked(
    make_flat_set: MakeSet, tmp_path: Path
) -> None:
    mixture = _mixture(make_flat_set, tmp_path)
    (sentence,) = mixture.instructions()
    few, many = (
        Recoloring(mixture, surveyed, np.random.default_rng(0)).sentences_of(sentence) for surveyed in (False, True)
    )
    assert few == {"put the blue blocks in a red bowl"}
    assert len(many) == 12 * 11 - 1 and "put the cyan blocks in a purple bowl" in many


def test_a_thing_of_the_new_colour_gets_the_old_one(make_flat_set: MakeSet, tmp_path: Path) -> None:
    """Else two things would be what the sentence names."""
    mixture = _mixture(make_flat_set, tmp_path)
    drawn = _acting(mixture)
    scene = drawn.data.observation(drawn.frame)
    scene.color[150:160, 70:80], scene.height[150:160, 70:80] = (20, 200, 20), 0.04
    recoloring = Recoloring(mixture, True, np.random.default_rng(0))
    rng = np.random.default_rng(2)
    drawings = (recoloring.draw(drawn, rng) for _ in range(2000))
    paints = next(p for p in drawings if p is not None and p.terms["red"] == "green" and p.terms["blue"] == "yellow")
    there = _at(paints.image(scene), (155, 75))
    assert distance(there, lab(np.float32([(255, 87, 89), (78, 121, 167)]))) < 4


def test_shadows_stay_darker(make_flat_set: MakeSet, tmp_path: Path) -> None:
    mixture = _mixture(make_flat_set, tmp_path)
    drawn = _acting(mixture)
    scene = drawn.data.observation(drawn.frame)
    row, col = drawn.demo.pick_pixel
    scene.color[row + 4 : row + 8, col - 8 : col + 8] = (178, 61, 62)
    paints = Recoloring(mixture, False, np.random.default_rng(0)).draw(drawn, np.random.default_rng(0))
    assert paints is not None
    image = paints.image(scene)
    assert 0.5 < image[row + 5, col].sum() / image[row, col].sum() < 0.9


@pytest.mark.parametrize(
    "sentence",
    [
        "put the block in the bowl",
        "put the green blocks in a blue bowl",
        "put red, blue, green, yellow, brown, gray, cyan, pink and white blocks in a bowl",
    ],
)
def test_what_is_not_recognised_stays_as_it_is(sentence: str, make_flat_set: MakeSet, tmp_path: Path) -> None:
    """The block is red: a sentence that calls it green is not understood, nor one that names many colours."""
    mixture = _mixture(make_flat_set, tmp_path, sentence)
    drawn = _acting(mixture)
    assert named_colors(drawn.demo, drawn.data.observation(drawn.frame)) == {}
    assert Recoloring(mixture, True, np.random.default_rng(0)).draw(drawn, np.random.default_rng(0)) is None


def test_a_finished_scene_is_painted_as_its_episode_was(make_flat_set: MakeSet, tmp_path: Path) -> None:
    mixture = _mixture(make_flat_set, tmp_path)
    done = next(mixture[i] for i in range(len(mixture)) if mixture[i].demo.done)
    paints = Recoloring(mixture, False, np.random.default_rng(0)).draw(done, np.random.default_rng(0))
    assert paints is not None and paints.terms == {"red": "blue", "blue": "red"}


def test_steps_in_other_colours_are_always_the_same(make_flat_set: MakeSet, tmp_path: Path) -> None:
    mixture = _mixture(make_flat_set, tmp_path)
    config = TrainConfig(batch_size=4, recolor="demonstrated", recolor_probability=1.0)

    def make() -> Loader:
        recoloring = Recoloring(mixture, False, np.random.default_rng(0))
        own = set(mixture.instructions())
        sentences = own.union(*map(recoloring.sentences_of, own))
        book = Phrasebook(dict.fromkeys(sentences, 3), np.random.default_rng(0))
        return Loader(mixture, book, config, recoloring)

    first, again = make().step(3).parts[0], make().step(3).parts[0]
    assert (first.images == again.images).all() and first.phrases == again.phrases
    assert all(terms_in(phrase) in (["red", "blue"], ["blue", "red"]) for phrase in first.phrases)
