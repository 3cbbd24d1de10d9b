"""How the wordings that a training remembers are shared out among its data sets."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from cliport_policy.config import TrainConfig
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.mixture import Mixture, Source, SourceSettings
from cliport_policy.data.recolor import Recoloring
from cliport_policy.data.wordings import SentenceGroup, sentence_groups, share_wordings


def _group(name: str, size: int, wanted: int) -> SentenceGroup:
    return SentenceGroup({f"{name}{i}" for i in range(size)}, wanted)


def test_a_data_set_of_many_sentences_eats_no_other_ones_wordings() -> None:
    found = share_wordings([_group("kit", 900, 200), _group("bowl", 10, 200), _group("rope", 4, 200)], 3_914)
    assert {found[f"rope{i}"] for i in range(4)} == {200}
    assert {found[f"bowl{i}"] for i in range(10)} == {110}
    assert {found[f"kit{i}"] for i in range(900)} == {1}


def test_no_more_than_all_that_fit() -> None:
    groups = [_group("a", 7, 50), _group("b", 3, 0), _group("c", 0, 9)]
    assert share_wordings(groups, 1_000) == {**{f"a{i}": 50 for i in range(7)}, "b0": 0, "b1": 0, "b2": 0}
    found = share_wordings(groups, 20)
    assert {found[f"a{i}"] for i in range(7)} == {1} and len(found) + sum(found.values()) <= 20
    assert set(share_wordings(groups, 5).values()) == {0}


def test_a_sentence_of_two_data_sets_has_the_larger_number() -> None:
    shared = {"take it"}
    assert share_wordings([SentenceGroup(shared, 0), SentenceGroup(shared, 30)], 100) == {"take it": 30}


def test_only_what_may_be_repainted_is(make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    data = load_demonstrations(make_flat_set(tmp_path / "data", 2))
    mixture = Mixture([Source(data, 1.0, SourceSettings(recolor=False))])
    (sentence,) = mixture.instructions()
    assert Recoloring(mixture, True, np.random.default_rng(0)).sentences_of(sentence) == set()


def test_each_data_sets_sentences_are_those_that_its_settings_allow(
    make_flat_set: Callable[..., Path], tmp_path: Path
) -> None:
    data = load_demonstrations(make_flat_set(tmp_path / "data", 2))
    still = SourceSettings(recolor=False, paraphrase=False)
    mixture = Mixture([Source(data, 1.0, still), Source(data)])
    (sentence,) = mixture.instructions()
    config = TrainConfig(phrases_per_goal=7, mirror_probability=0.5)
    recoloring = Recoloring(mixture, True, np.random.default_rng(0))
    first, second = sentence_groups(mixture, recoloring, config)
    assert first == SentenceGroup({sentence}, 0)
    assert second.wanted == 7 and second.sentences == {sentence} | recoloring.sentences_of(sentence)
    assert len(second.sentences) > 100
    assert sentence_groups(mixture, None, config)[1] == SentenceGroup({sentence}, 7)
