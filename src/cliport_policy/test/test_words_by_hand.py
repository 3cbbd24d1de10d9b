"""Sentences and colour words with an encoder whose tokens are words: vectors, labels and colours known beforehand."""

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from cliport_policy import color_words
from cliport_policy.color_words import Survey, _example, _examples, _target, likelihoods
from cliport_policy.data import from_bags
from cliport_policy.data.color_names import BASIC_TERMS
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.from_bags import make_data_set
from cliport_policy.encoders import clip_rn50, efficientnet, resnet50
from cliport_policy.encoders.registry import PROJECTED_DIM
from cliport_policy.language import MAX_TOKENS, TextEncoder, TokenEmbeddings, shared_encoder
from cliport_policy.named_colors import basic_tokens, color_name_reader
from cliport_policy.networks.joint.color_words import ColorDensity, scaled_lab

MISSED = 5
SURVEY = Survey(["red", "dusty purple", "purple"], torch.eye(3), [[0], [], [1, 2]])


class Words:
    """A token a word, and one at either end; a token's vector is its number in the sentence."""

    def count_tokens(self, text: str) -> int:
        return len(text.split())

    def encode(self, sentences: list[str]) -> TokenEmbeddings:
        count = len(sentences[0].split()) + 2
        return TokenEmbeddings(torch.arange(count, dtype=torch.float32)[None, :, None], torch.ones(1, count) > 0)


class Dice:
    """It falls as told, and errors are one spread large."""

    def __init__(self, share: float) -> None:
        self.share = share

    def random(self) -> float:
        return self.share

    def integers(self, n: int) -> int:
        return 0

    def normal(self, mean: float, spread: Any) -> Any:
        return mean + np.asarray(spread)


def test_a_sentences_vector_is_the_mean_of_its_tokens() -> None:
    tokens = torch.tensor([[[1.0, 2.5], [3.0, 4.5], [90.0, -9.0]]])
    vector = TokenEmbeddings(tokens, torch.tensor([[True, True, False]])).sentence_vectors()
    length = math.hypot(2.0, 3.5)
    assert vector[0].tolist() == pytest.approx([2.0 / length, 3.5 / length])


def test_tokens_of_the_shipped_encoder() -> None:
    encoder = shared_encoder()
    assert (encoder.count_tokens("put the red block"), encoder.count_tokens("")) == (4, 0)
    long = encoder.encode(["block " * 100])
    assert MAX_TOKENS == 48 and long.tokens.shape == (1, 48, 384) and long.mask.all()


@pytest.mark.parametrize(
    ("sentence", "hidden"),
    [
        ("put the red block in a gray bowl", ["red", "gray"]),
        ("put the credits in the redder bowl", []),
        ("the lightest brown block goes on the green and grey ones", ["brown", "green", "grey"]),
        ("move the cyan ring over the gray one", ["cy", "##an", "gray"]),
        ("", []),
    ],
)
def test_a_colourless_sentence_lacks_its_colours_alone(sentence: str, hidden: list[str]) -> None:
    """It has as many tokens, and the same ones where there is no colour; the names are read apart."""
    encoder = shared_encoder()
    pieces = encoder.pieces._tokenizer
    plain, (rest, names, shades, mask) = encoder.encode_one(sentence), color_name_reader().read([sentence], "open")
    assert shades.isnan().all(), "basic terms are for the head"
    named = names[0].any(-1)
    assert [pieces.id_to_token(int(number)) for number in encoder.pieces([sentence]).numbers[0][named]] == hidden
    assert rest.shape == names.shape == plain.tokens.shape and torch.equal(mask, plain.mask)
    assert torch.equal(rest, plain.tokens) == (not hidden)
    longer = color_name_reader().read([sentence, "put the green and the yellow blocks in the brown box there"], "open")
    assert torch.equal(longer.rest[0][longer.mask[0]], rest[0]) and not longer.names[0][~longer.mask[0]].any()


def test_a_told_name_is_one_word_whose_colour_is_known() -> None:
    reader = color_name_reader()
    rest, names, shades, mask = reader.read(["put the red block in a Blue With A Hint Of Purple bowl"], "open")
    plain = shared_encoder().encode_one("put the colored block in a colored bowl")
    assert torch.equal(rest, plain.tokens) and torch.equal(mask, plain.mask)
    known = ~shades[0].isnan().any(-1)
    assert known.nonzero().flatten().tolist() == [7] and names[0].any(-1).nonzero().flatten().tolist() == [3]
    assert torch.allclose(shades[0, 7], scaled_lab(torch.tensor((83.0, 60, 198)) / 255), atol=1e-5)
    longer = reader.read(["a crimson block", "put the red block in a light grey bowl"], "open")
    assert torch.isfinite(longer.shades).all(-1).nonzero().tolist() == [[0, 2], [1, 7]], "nothing in the padding"
    cut = reader.read(["block " * 60 + "royal blue"], "open")
    assert cut.rest.shape == (1, MAX_TOKENS, 384) and cut.shades.isnan().all()


def test_the_strict_arm_knows_no_colour_that_it_was_not_told() -> None:
    reader = color_name_reader()
    one, other = reader.read(["the dusty purple block", "put it in the Dusty Purple bowl"], "strict").names
    assert torch.equal(one[one.any(-1)], other[other.any(-1)]) and int(one.any(-1).sum()) == 2
    shades = reader.read(["the dusty purple block on the dusty blue one"], "strict").shades
    assert torch.isfinite(shades).all(-1).nonzero()[:, 1].tolist() == [7]
    cut = reader.read(["block " * 45 + "dusty purple"], "strict")
    assert cut.rest.shape == (1, MAX_TOKENS, 384) and int(cut.names[0].any(-1).sum()) == 1


def test_basic_terms_are_those_that_an_arm_is_told() -> None:
    found = {arm: len(basic_tokens(arm)) for arm in ("open", "strict")}
    pieces = {term: shared_encoder().count_tokens(term) for term in BASIC_TERMS}
    assert found["open"] == sum(pieces.values())
    assert found["strict"] == found["open"] - sum(pieces[term] for term in ("white", "orange", "pink", "purple"))


def test_sentences_are_encoded_once_until_there_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []

    class Counting(TextEncoder):
        def __init__(self) -> None:
            self._cache: dict[str, TokenEmbeddings] = {}

        def encode(self, sentences: Any) -> TokenEmbeddings:
            asked.append(list(sentences))
            lengths = torch.tensor([len(text) for text in sentences])
            mask = torch.arange(int(lengths.max()))[None] < lengths[:, None]
            return TokenEmbeddings(torch.ones(*mask.shape, 2) * lengths[:, None, None], mask)

    monkeypatch.setattr("cliport_policy.language.CACHE_SIZE", 4)
    monkeypatch.setattr("cliport_policy.language._CHUNK", 2)
    encoder = Counting()
    found = encoder.encode_cached(["a", "bbb", "a", "cc"])
    assert asked == [["a", "bbb"], ["cc"]]
    assert found.mask.sum(1).tolist() == [1, 3, 1, 2] and found.tokens[:, 0, 0].tolist() == [1, 3, 1, 2]
    assert (found.tokens[~found.mask] == 0).all()
    encoder.encode_cached(["dddd", "a"])
    assert asked[2:] == [["dddd"]]
    encoder.encode_cached(["a", "e"])  # five would be too many
    assert asked[3:] == [["a", "e"]]
    assert encoder.encode_one("e").tokens.shape == (1, 1, 2) and len(asked) == 4


def test_tokens_are_labelled_with_the_name_that_they_belong_to() -> None:
    template = "put the {} blocks in a {} bowl"
    example = _example(template, [0, 1], SURVEY, Words())  # type: ignore[arg-type]
    assert example.name.tolist() == [-1, -1, -1, 0, -1, -1, -1, 1, 1, -1, -1]
    assert example.tokens.shape == (11, 1)
    alone = _example("{}", [2], SURVEY, Words())  # type: ignore[arg-type]
    assert alone.name.tolist() == [-1, 2, -1]


def test_names_of_one_word_are_said_more_often() -> None:
    """Each name twice, those of one word twice more, and ten times where more than five shades have it."""
    survey = Survey(["red", "dusty purple", "purple"], torch.eye(3), [[0], [], [1] * 6])
    examples = _examples(survey, Words(), np.random.default_rng(0))  # type: ignore[arg-type]
    assert len(examples) == 2 * 3 + 2 * 2 + 10


@pytest.mark.parametrize(("name", "share", "color"), [(0, 0.0, [1, 0, 0]), (2, 0.5, [0, 0, 1]), (2, 0.499, [0, 1, 0])])
def test_a_name_means_its_colour_or_that_of_a_shade(name: int, share: float, color: list[int]) -> None:
    target = _target(SURVEY, name, Dice(share))  # type: ignore[arg-type]
    assert (target - torch.tensor(color)).tolist() == pytest.approx([0.12, 0.04, 0.04], abs=1e-6)


def test_a_word_is_judged_by_its_own_tokens() -> None:
    """Of "put the dusty purple block here": the third and the fourth."""
    seen: list[list[float]] = []

    def head(tokens: Tensor) -> ColorDensity:
        seen.append(tokens[:, 0].tolist())
        zeros = torch.zeros(len(tokens), 1, 3)
        return ColorDensity(torch.zeros(len(tokens)), torch.zeros(len(tokens), 1), zeros, zeros)

    found = likelihoods(head, ["dusty purple", "red"], torch.zeros(1, 3), Words())  # type: ignore[arg-type]
    assert seen == [[3.0, 4.0], [3.0]]
    assert found.tolist() == [[pytest.approx(-1.5 * math.log(2 * math.pi))]] * 2  # black is 0, 0, 0


def test_the_head_is_fitted_with_a_falling_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gradients are of one step each: they would grow otherwise."""
    made: list[float] = []
    monkeypatch.setattr(color_words, "read_survey", lambda arm: SURVEY)
    monkeypatch.setattr(color_words, "_examples", lambda *_: [SimpleNamespace()])

    def loss(head: Any, chosen: list[Any], survey: Survey, rng: Any) -> Tensor:
        assert len(chosen) == 96
        made.append(float(head.out.bias[0].detach()))
        return head.out.bias[0] * (10.0 if len(made) == 1 else 1e-9)

    monkeypatch.setattr(color_words, "_loss", loss)
    head, mean = color_words.fit("open", 3, 0, Words())  # type: ignore[arg-type]
    moves = np.diff([*made, float(head.out.bias[0])])
    assert moves[0] == pytest.approx(-2e-3, rel=0.05) and abs(moves[2]) < abs(moves[1]) < 2e-3
    assert not any(p.requires_grad for p in head.parameters()) and math.isfinite(mean)


def test_pictures_are_normalised_as_encoders_were_trained() -> None:
    """OpenAI's constants, also for ResNet50 as in the published baseline, and TensorFlow's."""
    assert clip_rn50.MEAN == (0.48145466, 0.4578275, 0.40821073)
    assert clip_rn50.STD == (0.26862954, 0.26130258, 0.27577711)
    assert (resnet50.MEAN, resnet50.STD) == (clip_rn50.MEAN, clip_rn50.STD)
    assert efficientnet.MEAN == (127 / 255,) * 3 and efficientnet.STD == (128 / 255,) * 3
    assert resnet50.TAP_WIDTHS == (256, 512, 1024, 2048) and PROJECTED_DIM == 1024


def test_a_part_holds_so_many_episodes(
    make_episode: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The second of three teaches nothing: it opens no part, and the third has its number."""
    monkeypatch.setattr(from_bags, "EPISODES_PER_PART", 1)
    for name, outcomes in (("a", (0,)), ("b", (MISSED,)), ("c", (0,)), ("d", (MISSED,))):
        make_episode(tmp_path / "set", name, outcomes=outcomes)
    told: list[tuple[int, int]] = []
    paths = sorted((tmp_path / "set" / "episodes").iterdir())
    tally = make_data_set(paths, tmp_path / "out", on_episode=lambda done, now: told.append((done, now.steps)))
    assert told == [(1, 1), (2, 1), (3, 2), (4, 2)]
    assert (tally.episodes, tally.steps, tally.finished) == (2, 2, 2)
    assert tally.steps_left_out == {"grasp missed": 2} and tally.episodes_left_out == {"no step to learn from": 2}
    parts = sorted(path.name for path in (tmp_path / "out").glob("part*"))
    assert parts == ["part-00000.parquet", "part-00001.parquet"]
    data = load_demonstrations(tmp_path / "out")
    assert [(frame.episode, frame.step) for frame in data.frames] == [(0, 0), (0, 1), (1, 0), (1, 1)]
    assert data.meta["episodes"] == ["a", "c"] and data.meta["height_unit"] == 5e-4
