"""Sets, tallies, caches and encoders' tables in their smallest cases: values known beforehand."""

import json
import math
from collections import Counter
from dataclasses import astuple
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from cliport_core.action import Primitive
from cliport_core.heightmap import Heightmap
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy import dataset, reliability
from cliport_policy.color_words import read_survey
from cliport_policy.config import NetworkConfig
from cliport_policy.data import dataset_format
from cliport_policy.data.batches import Batch, Phrasebook
from cliport_policy.data.color_names import UNSEEN_STEMS
from cliport_policy.data.dataset_format import Demo, Row, SeenThing, part_path, read_part, write_part
from cliport_policy.data.demonstrations import Demonstration, DemonstrationSet, Frame, _check, _demonstration
from cliport_policy.data.encoded_rows import Place
from cliport_policy.data.from_bags import Selection, Tally, _reasons
from cliport_policy.data.named_things import NamedThings
from cliport_policy.data.primitives import check_primitive, primitive_taught
from cliport_policy.encoders.bert_modules import BertShape, _shape
from cliport_policy.encoders.frozen import CACHE_SIZE, EncoderShape, FrozenEncoders, Vision
from cliport_policy.errors import DataError
from cliport_policy.joint_config import JointConfig
from cliport_policy.networks import factory
from cliport_policy.networks.joint.color_words import ColorDensity, scaled_lab
from cliport_policy.stream_config import NetConfig, StreamsConfig

SPEC = WorkspaceSpec(x_min=0.0, x_max=0.3, y_min=0.0, y_max=0.4, z_min=-0.02, pixel_size=0.1)  # 4 x 3 pixels
PRIMITIVES = {"p": Primitive.PICK_PLACE, "s": Primitive.SWEEP}


def demo(pixel: tuple[int, int] = (1, 1), done: bool = False, **changes: Any) -> Demonstration:
    return Demonstration("put it there", done, pixel, 0.0, 1.0, (2, 2), 0.0, **changes)


def frames(*demos: Demonstration, episode: int = 0, task: str = "t") -> list[Frame]:
    return [Frame(Place(0, 0, i), (each,), task, episode, i) for i, each in enumerate(demos)]


def make_set(listed: list[Frame], **meta: Any) -> DemonstrationSet:
    return DemonstrationSet(listed, SPEC, meta, None, Path("set"))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("pixel", "good"), [((0, 0), True), ((3, 2), True), ((4, 2), False), ((3, 3), False), ((-1, 0), False)]
)
def test_an_action_lies_in_the_picture(pixel: tuple[int, int], good: bool) -> None:
    _check(frames(demo((9, 9), done=True)), SPEC, Path("set"))
    if good:
        _check(frames(demo(pixel)), SPEC, Path("set"))
        return
    with pytest.raises(DataError, match="episode 0 of set acts at the pixels"):
        _check(frames(demo(pixel)), SPEC, Path("set"))


def test_goals_are_the_next_scene_or_the_last_one() -> None:
    """Two episodes of three scenes and one of a single scene; the last episode is not finished."""
    end = demo(done=True)
    listed = frames(demo(), demo(), end) + frames(end, episode=1) + frames(demo(), demo(), episode=2)
    assert make_set(listed).goal_frames() == {0: 2, 1: 2, 2: 2, 3: 3}
    assert make_set(listed, stepwise=True).goal_frames() == {0: 1, 1: 2, 2: 2, 3: 3}
    same_number = frames(demo(), end) + frames(demo(), end, task="u")
    assert make_set(same_number).goal_frames() == {0: 1, 1: 1, 2: 3, 3: 3}


def test_only_what_is_finished_acts_not() -> None:
    assert demo().acts and not demo(done=True).acts and not demo(absent=True).acts
    flags = torch.tensor([True, False, False])
    batch = Batch(flags, [], flags, *[flags] * 6)
    assert batch.acts.tolist() == [False, True, True]
    assert batch._replace(absent=torch.tensor([False, True, False])).acts.tolist() == [False, False, True]
    moved = batch.to(torch.device("cpu"))
    assert torch.equal(moved.done, flags) and moved.goal_images is None and moved.phrases == []


@pytest.mark.parametrize(
    ("kinds", "taught"),
    [("ppp", Primitive.PICK_PLACE), ("s", Primitive.SWEEP), ("", Primitive.PICK_PLACE), ("ps", None)],
)
def test_the_primitive_of_all_demonstrations(kinds: str, taught: Primitive | None) -> None:
    end = demo(done=True)  # of pick_place, and no action
    data = make_set([*frames(*(demo(primitive=PRIMITIVES[kind]) for kind in kinds)), *frames(end)])
    if taught is not None:
        assert primitive_taught([data]) is taught
        check_primitive([data], taught, "mine")
        return
    with pytest.raises(DataError, match=r"have 2 \(set holds 1 demonstrations of pick_place and 1 of sweep\)"):
        primitive_taught([data])
    with pytest.raises(DataError, match=r"and 1 of sweep, and the checkpoint mine acts with sweep only"):
        check_primitive([data], Primitive.SWEEP, "mine")


def test_a_demonstration_from_its_columns() -> None:
    columns = {"instruction": "x", "done": False, "pick_row": 1, "pick_col": 2, "pick_yaw": 0.5, "pick_yaw_period": 3.0,
               "place_row": 3, "place_col": 4, "place_yaw": -0.5}  # fmt: skip
    expected = Demonstration("x", False, (1, 2), 0.5, 3.0, (3, 4), -0.5)
    assert _demonstration(columns) == expected and expected.primitive is Primitive.PICK_PLACE
    assert _demonstration({**columns, "primitive": "sweep"}).primitive is Primitive.SWEEP
    for name in ("pick_yaw", "pick_yaw_period", "place_yaw"):
        with pytest.raises(ValueError, match="a yaw is not a number"):
            _demonstration({**columns, name: math.inf})


def test_a_part_gives_back_its_rows(tmp_path: Path) -> None:
    """Heights to a quarter of a millimetre, colours without their lowest bit, nothing where nothing was seen."""
    color = np.arange(36, dtype=np.uint8).reshape(4, 3, 3)
    height = np.linspace(-0.02, 0.2013, 12, dtype=np.float32).reshape(4, 3)
    valid = np.arange(12).reshape(4, 3) != 5
    pick, place = PlanarPose(0.15, 0.05, 0.5), PlanarPose(0.25, 0.35, -1.0)
    label = Demo.of_action("put it", Primitive.SWEEP, pick, 2.0, place, SPEC)
    assert astuple(label) == ("put it", False, "sweep", 0, 1, 0.5, 2.0, 3, 2, -1.0)
    done = Demo("done", True, "fold")
    assert astuple(done) == ("done", True, "fold", -1, -1, 0.0, 0.0, -1, -1, 0.0)
    thing = SeenThing("block", "red", 0xFF5759, 1, -1)
    row = Row("t", "val", 5, 6, 7, Heightmap(color, height, valid, SPEC), (label, done), (thing,))
    path = part_path(tmp_path, 12)
    write_part(path, [row])
    (back,) = read_part(path, SPEC)
    assert path.name == "part-00012.parquet" and list(tmp_path.iterdir()) == [path]
    assert (back.task, back.split, back.seed, back.episode, back.step) == ("t", "val", 5, 6, 7)
    assert (back.demos, back.things) == ((label, done), (thing,))
    np.testing.assert_array_equal(back.heightmap.color, color & 0xFE)
    np.testing.assert_array_equal(back.heightmap.valid, valid)
    np.testing.assert_allclose(back.heightmap.height, np.where(valid, height, 0), atol=2.51e-4)
    assert np.abs(back.heightmap.height - height)[valid].max() > 1e-5  # steps of half a millimetre
    assert (dataset_format.HEIGHT_UNIT, dataset_format.FORMAT_VERSION) == (5e-4, 3)


def test_a_selection_and_its_tally(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = [
        [selection.refusal(success) for success in (True, False, None)]
        for selection in (Selection(), Selection(unmarked=False), Selection(failed=True))
    ]
    failed, unmarked = "marked as a failure", "not marked as a success"
    assert found == [["", failed, ""], ["", failed, unmarked], ["", "", ""]]
    tally = Tally(2, 5, 1, Counter({failed: 1}), Counter({"missed": 2, "dropped": 1}), ["torn"])
    dataset._report(tally, Path("out"))
    assert capsys.readouterr().out.splitlines() == [
        "note: torn",
        f"left out: 1 episode, {failed}",
        "left out: 1 step, dropped",
        "left out: 2 steps, missed",
        "2 episodes, 5 steps and 1 finished scenes in out",
    ]
    assert json.loads(json.dumps(tally.to_dict())) == {
        "episodes": 2, "steps": 5, "finished_scenes": 1, "episodes_left_out": {failed: 1},
        "steps_left_out": {"dropped": 1, "missed": 2},
    }  # fmt: skip
    assert _reasons(tally) == f"1 dropped, 1 {failed}, 2 missed" and _reasons(Tally()) == "there is none"


def test_progress_is_told_once_a_second(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    now = iter([100.0, 100.5, 101.0, 101.5, 104.0])
    monkeypatch.setattr(dataset, "time", SimpleNamespace(monotonic=lambda: next(now)))
    progress = dataset._Progress(10)
    for done in (1, 2, 3, 4):
        progress(done, Tally(steps=7))
    assert capsys.readouterr().err == "2 of 10 episodes, 7 steps, 4 s left\n4 of 10 episodes, 7 steps, 6 s left\n"


def test_an_interruption_is_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(dataset, "find_episodes", interrupt)
    assert dataset.main(["--from-bags", "a", "--out", "b"]) == 130
    assert capsys.readouterr().err == "error: interrupted; nothing was written\n"


@pytest.mark.parametrize(
    ("things", "there"),
    [({("red", "block"), ("", "box")}, True), ({("blue", "block"), ("", "box")}, True), ({("red", "block")}, False),
     ({("", "box")}, False), ({("green", "block"), ("", "box")}, False), ({("red", "ball"), ("", "box")}, False)],
)  # fmt: skip
def test_a_sentence_needs_one_pick_and_all_places(things: set[tuple[str, str]], there: bool) -> None:
    named = NamedThings((("red", "block"), ("blue", "block")), ((None, "box"),))
    assert named.are_among(things) is there


def test_a_phrasebook_keeps_what_may_not_change() -> None:
    sentence = "put the red blocks in a blue bowl"
    book = Phrasebook({sentence: 30, "fold it": 0}, np.random.default_rng(0))
    phrases = book.all_phrases()
    assert len(phrases) > 10 and sentence in phrases and phrases == sorted(phrases)
    assert {book.draw("fold it", np.random.default_rng(i)) for i in range(9)} == {"fold it"}
    assert Phrasebook({sentence: 0}, np.random.default_rng(0)).all_phrases() == [sentence]


def test_sentences_are_forgotten_when_there_are_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []

    def encode(sentences: list[str]) -> Tensor:
        asked.append(sentences)
        return torch.ones(len(sentences), 2)

    monkeypatch.setattr("cliport_policy.encoders.frozen.CACHE_SIZE", 3)
    vision = Vision([nn.Conv2d(3, 3, 1)], (0.0,) * 3, (1.0,) * 3)
    encoders = FrozenEncoders("fake", EncoderShape((), 2), vision, nn.Linear(1, 1), encode)
    for sentences in (["a", "b", "c"], ["a"], ["c", "d"], ["a", "d"]):
        assert encoders.encode_sentences(sentences).shape == (len(sentences), 2)
    assert asked == [["a", "b", "c"], ["d"], ["a"]] and CACHE_SIZE == 20_000
    assert encoders.cast(torch.float64, text=False).modules[0].stages[0].weight.dtype == torch.float64  # type: ignore[union-attr]
    assert encoders.modules[1].weight.dtype == torch.float32
    assert encoders.cast(torch.float32, text=True).modules[1].weight.dtype == torch.float32


@pytest.mark.parametrize(
    ("precision", "fast", "dtype"),
    [("auto", False, torch.float32), ("auto", True, torch.bfloat16), ("bfloat16", False, torch.bfloat16),
     ("float32", True, torch.float32)],
)  # fmt: skip
def test_the_precision_of_networks(
    precision: str, fast: bool, dtype: torch.dtype, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(factory, "has_fast_bfloat16", lambda: fast)
    plain = NetConfig(spatial="plain")
    config = StreamsConfig(plain, plain, plain, width=0.02)
    assert factory._network_without_weights(config, precision)[1] is dtype
    joint, weights = factory._network_without_weights(JointConfig(widths=(8, 16), context_layers=0), precision)
    assert weights is torch.float32 and joint.acts_in_bfloat16 == (dtype is torch.bfloat16)
    compact, weights = factory._network_without_weights(NetworkConfig(), precision)
    assert weights is torch.float32 and not compact.acts_in_bfloat16


def test_sizes_of_published_berts() -> None:
    """As of distilbert-base-uncased; the fields of BERT's own file have other names."""
    assert astuple(BertShape()) == (30_522, 512, 768, 3072, 6, 12)
    bert = {"vocab_size": 1, "max_position_embeddings": 2, "hidden_size": 3, "intermediate_size": 4,
            "num_hidden_layers": 5, "num_attention_heads": 6}  # fmt: skip
    distilled = {"model_type": "distilbert", "vocab_size": 1, "max_position_embeddings": 2, "dim": 3, "hidden_dim": 4,
                 "n_layers": 5, "n_heads": 6}  # fmt: skip
    assert astuple(_shape(bert)) == astuple(_shape(distilled)) == (1, 2, 3, 4, 5, 6)


def test_lab_of_dark_and_light_colours() -> None:
    """CIE 15: below a lightness of 8 it is proportional to the light."""
    gray = torch.tensor([0.04, 0.05, 0.2, 0.5, 1.0])
    linear = [0.04 / 12.92, *(((value + 0.055) / 1.055) ** 2.4 for value in (0.05, 0.2, 0.5, 1.0))]
    expected = [24389 / 27 * y if y <= 216 / 24389 else 116 * y ** (1 / 3) - 16 for y in linear]
    found = 50 * scaled_lab(gray[:, None].expand(-1, 3))
    assert found[:, 0].tolist() == pytest.approx(expected, abs=2e-3) and float(found[:, 1:].abs().max()) < 0.02


def test_densities_by_hand() -> None:
    """One component of spread 0.5 about the origin, and one a tenth as likely that is far away."""
    log_sigma = torch.full((1, 1, 2, 3), math.log(0.5))
    mean = torch.tensor([[[[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]]])
    density = ColorDensity(torch.zeros(1, 1), torch.tensor([[[0.0, math.log(0.1)]]]), mean, log_sigma)
    peak = -1.5 * math.log(2 * math.pi) - 3 * math.log(0.5)
    single = ColorDensity(*(value[0] for value in density))
    found = single.log_likelihood(torch.tensor([[0.0, 0.5, 0.0]]))
    assert float(found) == pytest.approx(peak - 0.5, abs=1e-4)
    colors = torch.tensor([[[0.0, 0.0, 0.0], [0.0, 0.5, 0.0], [100.0, 0.0, 0.0]]])
    suits = density.membership(colors)[0, 0].tolist()
    assert suits == pytest.approx([1.0, math.exp(-1 / 10), 0.1 ** (1 / 5)], rel=1e-3)


def test_the_survey_has_shades_and_a_strict_part() -> None:
    opened, strict = read_survey("open"), read_survey("strict")
    assert set(strict.names) == {name for name in opened.names if not any(stem in name for stem in UNSEEN_STEMS)}
    red = opened.names.index("red")
    shades = {opened.names[i] for i in opened.shades[red]}
    assert {"red", "dark red", "brick red"} <= shades and not {"reddish", "red orange"} & shades
    assert torch.allclose(opened.colors[red], scaled_lab(torch.tensor([0xE5, 0, 0]) / 255), atol=1e-3)


def test_a_picture_that_cannot_be_written_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise OSError(13, "Permission denied")

    none = np.zeros(0)
    found = reliability.Reliability(none, none, none, none.astype(bool))
    known = SimpleNamespace(meta={"task": "t"})
    for name, value in (("load_demonstrations", known), ("resolve_checkpoint", Path("mine")), ("measure", found)):
        monkeypatch.setattr(reliability, name, lambda *_, value=value: value)
    monkeypatch.setattr(reliability, "load_policy", lambda _: None)
    monkeypatch.setattr(reliability, "plot_reliability", refuse)
    assert reliability.main(["--data", "d", "--out", str(tmp_path / "p.png")]) == 1
    assert "p.png (Permission denied): give another --out" in capsys.readouterr().err
    assert json.loads((tmp_path / "p.json").read_text())["checkpoint"] == "mine"
