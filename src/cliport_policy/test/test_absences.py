"""Sentences about what is not there: they name what a scene lacks, and only then are they drawn."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.data.absences import Absences
from cliport_policy.data.dataset_format import Demo, Row, SeenThing, part_path, write_part
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.mixture import Mixture, Source, SourceSettings
from cliport_policy.data.mixture_file import mixture_names, read_mixture
from cliport_policy.data.named_things import named_things
from cliport_policy.errors import ConfigError

SPEC = WorkspaceSpec(pixel_size=0.0125)
SCENES = {
    "put the red blocks in a blue bowl": [("red", "block"), ("blue", "bowl"), ("green", "block")],
    "put the green blocks in a gray bowl": [("green", "block"), ("gray", "bowl")],
    "move the red ring to the lighter brown side": [("red", "ring"), ("", "stand")],
}
SCENES_OF_BOWLS = tuple(sentence for sentence in SCENES if "bowl" in sentence)


def _write(folder: Path, listed: bool = True) -> Path:
    rows, cols = SPEC.shape
    scene = Heightmap(
        np.zeros((rows, cols, 3), np.uint8), np.zeros((rows, cols), np.float32), np.ones((rows, cols), bool), SPEC
    )
    folder.mkdir()
    made = []
    for episode, (sentence, things) in enumerate(SCENES.items()):
        demo = Demo(sentence, False, "pick_place", 1, 1, 0.0, 3.0, 2, 2, 0.0)
        seen = tuple(SeenThing(name, color, 0, 1, 1) for color, name in things) if listed else ()
        made.append(Row("mixed", "train", episode, episode, 0, scene, (demo,), seen))
    write_part(part_path(folder, 0), made)
    (folder / "meta.json").write_text(json.dumps({"version": 3, "workspace": SPEC.to_dict()}))
    return folder


def test_what_is_drawn_is_never_in_the_scene(tmp_path: Path) -> None:
    mixture = Mixture([Source(load_demonstrations(_write(tmp_path / "set")))])
    absences, rng, said = Absences(mixture), np.random.default_rng(0), set()
    for _ in range(60):
        for number in range(len(mixture)):
            drawn = absences.draw(mixture[number], rng)
            assert drawn.demo.absent and not drawn.demo.acts
            assert drawn.demo.instruction != mixture[number].demo.instruction
            said.add((drawn.frame.episode, drawn.demo.instruction))
    assert len(said) == 6  # two foreign sentences for each of three scenes


def test_half_of_what_is_drawn_names_colours_that_other_things_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    more = {
        "put the blue blocks in a red bowl": [("blue", "block"), ("red", "bowl")],  # the first scene has both colours
        **{f"put the {color} blocks in a {color} bowl": [(color, "block"), (color, "bowl")] for color in "abcdefgh"},
    }
    monkeypatch.setitem(globals(), "SCENES", {**SCENES, **more})
    mixture = Mixture([Source(load_demonstrations(_write(tmp_path / "set")))])
    absences, rng = Absences(mixture), np.random.default_rng(0)
    first = next(mixture[i] for i in range(len(mixture)) if mixture[i].frame.episode == 0)
    said = [absences.draw(first, rng).demo.instruction for _ in range(400)]
    hard = ("put the blue blocks in a red bowl", "move the red ring to the lighter brown side")
    assert 0.45 < sum(sentence in hard for sentence in said) / len(said) < 0.65  # 2 of 12 sentences if drawn alike


def test_other_tasks_are_drawn_alike_however_few_their_sentences(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = load_demonstrations(_write(tmp_path / "own"))
    many = {f"move the {name} ring to the lighter brown side": [(name, "ring")] for name in "abcdefghijklmnop"}
    monkeypatch.setitem(globals(), "SCENES", many)
    rings = load_demonstrations(_write(tmp_path / "rings"))
    rope = "align the rope from front left tip to front right tip"
    monkeypatch.setitem(globals(), "SCENES", {rope: [("red", "bead"), ("", "square")]})
    mixture = Mixture([Source(own), Source(rings), Source(load_demonstrations(_write(tmp_path / "rope")))])
    absences, rng = Absences(mixture), np.random.default_rng(0)
    first = next(mixture[i] for i in range(len(mixture)) if mixture[i].demo.instruction in SCENES_OF_BOWLS)
    said = [absences.draw(first, rng).demo.instruction for _ in range(600)]
    ropes, ringed = said.count(rope), sum(sentence in many for sentence in said)
    assert 0.5 < ropes / ringed < 4.0, (ropes, ringed)  # 1 to 16 by their numbers


def test_a_set_that_does_not_list_its_things_is_refused(tmp_path: Path) -> None:
    mixture = Mixture([Source(load_demonstrations(_write(tmp_path / "set", listed=False)))])
    with pytest.raises(ConfigError, match="does not list the things on the table"):
        Absences(mixture)


@pytest.mark.parametrize(
    ("sentence", "things", "there"),
    [
        ("put the red blocks in a blue bowl", {("red", "block"), ("blue", "bowl")}, True),
        ("put the red blocks in a blue bowl", {("red", "bowl"), ("blue", "block")}, False),
        ("put the red star in the top star hole", {("red", "star"), ("", "star hole")}, True),
        ("put the red star in the star hole", {("blue", "star"), ("", "star hole")}, False),
        ("pack all the red and blue blocks into the brown box", {("blue", "box"), ("", "brown box")}, True),
        ("pack all the red and blue blocks into the brown box", {("gray", "box"), ("", "brown box")}, False),
        ("pack all the toy train objects in the brown box", {("", "toy train"), ("", "brown box")}, True),
        ("pack the toy train in the brown box", {("", "yo-yo"), ("", "brown box")}, False),
        ("put the red block on the lightest brown block", {("red", "block"), ("", "stand")}, True),
        ("push the pile of red blocks into the blue square", {("red", "small block"), ("blue", "square")}, True),
        ("push the pile of red blocks into the blue square", {("red", "small block"), ("gray", "square")}, False),
        ("align the rope from front left tip to front right tip", {("red", "bead"), ("", "square")}, True),
    ],
)
def test_canonical_sentences_are_read(sentence: str, things: set[tuple[str, str]], there: bool) -> None:
    named = named_things(sentence)
    assert named is not None and named.are_among(things) is there


def test_a_sentence_of_another_kind_names_nothing() -> None:
    assert named_things("fold the towel") is None


def test_the_shipped_mixture_and_its_switches(tmp_path: Path) -> None:
    groups = ["attr_bowls_hanoi", "attr_boxes_kits", "attr_pyramid_piles"]
    assert mixture_names() == [*groups, "demo_conditioned", "presence", "ten"]
    entries = read_mixture("ten", tmp_path)
    assert len(entries) == 10 and all(entry.folder.parent == tmp_path for entry in entries)
    rope = next(entry for entry in entries if entry.folder.name == "align-rope")
    assert rope.settings == SourceSettings(recolor=False, rearrange=False)
    demo_conditioned = read_mixture("demo_conditioned", tmp_path)
    assert len(demo_conditioned) == 10 and not any(entry.settings.recolor for entry in demo_conditioned)


@pytest.mark.parametrize(
    ("name", "group"),
    [
        ("attr_bowls_hanoi", ("put-blocks-in-bowls", "towers-of-hanoi-seq")),
        ("attr_pyramid_piles", ("stack-block-pyramid-seq", "separating-piles")),
        ("attr_boxes_kits", ("packing-box-pairs", "assembling-kits-seq")),
    ],
)
def test_a_group_held_out_is_the_ten_with_its_seen_colours_alone(
    name: str, group: tuple[str, ...], tmp_path: Path
) -> None:
    expected = []
    for entry in read_mixture("ten", tmp_path):
        task, settings = entry.folder.name.removesuffix("-seen-colors"), entry.settings
        if task in group:
            settings = replace(settings, recolor=False)  # other tasks show the unseen colours
        folder = entry.folder if task in group or task == entry.folder.name else entry.folder.with_name(f"{task}-full")
        expected.append(entry._replace(folder=folder, settings=settings))
    assert read_mixture(name, tmp_path) == tuple(expected)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("sources: []", "must hold a list `sources`"),
        ("sources: [{data: a, recolour: true}]", "did you mean 'recolor'"),
        ("sources: [{data: a, recolor: 1}]", "give true or false"),
        ("sources: [{data: a, weight: -1}]", "give a positive number"),
        ("source: []", "must hold a list"),
        ("{", "is no YAML"),
    ],
)
def test_a_wrong_mixture_is_one_clear_line(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "mixture.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=message) as caught:
        read_mixture(str(path), tmp_path)
    assert "\n" not in str(caught.value)
