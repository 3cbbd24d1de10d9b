"""Held-out wordings of every language task: they fit its sentences, and none of them is trained with."""

import re
from pathlib import Path

import numpy as np
import pytest

import cliport_benchmark
from cliport_benchmark.wording import Wording, load_patterns
from cliport_policy.data.paraphrase import paraphrase
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import make_task
from sim_bridge.world import SimWorld

FOLDER = Path(cliport_benchmark.__file__).parent / "phrasings"
TASKS = {
    "packing-unseen-shapes": "packing-shapes",
    "packing-unseen-google-objects-seq": "packing-shapes",
    "packing-unseen-google-objects-group": "packing-google-objects-group",
    "packing-box-pairs-seen-colors": "packing-box-pairs",
    "stack-block-pyramid-seq-seen-colors": "stack-block-pyramid-seq",
    "assembling-kits-seq-seen-colors": "assembling-kits-seq",
    "separating-piles-seen-colors": "separating-piles",
    "towers-of-hanoi-seq-seen-colors": "towers-of-hanoi-seq",
    "align-rope": "align-rope",
}


@pytest.mark.parametrize("task", TASKS)
def test_fifteen_held_out_wordings_have_the_slots_and_are_not_trained_with(task: str) -> None:
    own = make_task(task, "test").sentence_pattern
    patterns = load_patterns(FOLDER / f"{TASKS[task]}.txt", own)
    assert len(patterns) >= 15
    words = {"color": "red", "first": "red", "second": "blue", "zone": "blue"}
    slots = {slot: words.get(slot, "star") for slot in re.findall(r"\{(\w+)\}", own)}
    sentence = own.format(**slots)
    rng = np.random.default_rng(0)
    trained = {_plain(paraphrase(sentence, rng)) for _ in range(3000)}
    assert not {_plain(pattern.format(**slots)) for pattern in patterns} & trained


@pytest.mark.parametrize("task", ["packing-unseen-shapes", "assembling-kits-seq-seen-colors"])
def test_a_scenes_sentence_is_said_in_other_words(task: str) -> None:
    world = SimWorld()
    try:
        scene = reset_scene(world, task, "test", 0)
        slots, own, instruction = scene.sentence_slots, scene.sentence_pattern, scene.instruction
    finally:
        world.close()
    assert slots and own.format(**slots) == instruction
    marks = [f"{{{slot}}}" for slot in slots]
    said = Wording((" X ".join(marks),)).sentence(own, slots, 0)
    assert said == " X ".join(slots.values())


def _plain(sentence: str) -> str:
    return " ".join(re.findall(r"[a-z]+", sentence.lower()))
