"""Held-out wordings of every language task: they fit its sentences, and none of them is trained with."""

import re

import numpy as np
import pytest

from cliport_benchmark.wording import Wording, held_out_patterns
from cliport_policy.data.paraphrase import paraphrase
from sim_bridge.scene import reset_scene
from sim_bridge.tasks import LANGUAGE_SPLITS, make_task
from sim_bridge.world import SimWorld


@pytest.mark.parametrize("task", LANGUAGE_SPLITS)
def test_fifteen_held_out_wordings_have_the_slots_and_are_not_trained_with(task: str) -> None:
    own = make_task(task, "test").sentence_pattern
    patterns = held_out_patterns(make_task(task, "test"))
    assert len(patterns) >= 15
    words = {"color": "red", "first": "red", "second": "blue", "zone": "blue", "block": "red", "bowl": "blue"}
    slots = {slot: words.get(slot, "star") for slot in re.findall(r"\{(\w+)\}", own)}
    sentence = own.format(**slots)
    rng = np.random.default_rng(0)
    trained = {_plain(paraphrase(sentence, rng)) for _ in range(3000)}
    assert len(trained) > 15
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
