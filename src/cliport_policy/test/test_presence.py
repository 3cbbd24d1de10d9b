"""What is not to be seen: kinds, questions with their answers, two nets that learn, and their place in a checkpoint."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.card import load_card
from cliport_policy.checkpoint import load_checkpoint
from cliport_policy.data.color_names import BASIC_TERMS
from cliport_policy.data.dataset_format import HEIGHT_UNIT, Demo, Row, SeenThing, part_path, write_part
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.listed_things import read_listed_things
from cliport_policy.data.mixture import Mixture, Source
from cliport_policy.errors import CheckpointError, DataError
from cliport_policy.fit_presence import main
from cliport_policy.language import shared_encoder
from cliport_policy.null_odds import absence
from cliport_policy.policy import load_policy
from cliport_policy.presence.fit import fit_sentences, scene_losses, scene_optimizer, scene_step
from cliport_policy.presence.kinds import listed_kind, named_kinds
from cliport_policy.presence.presence import Missing, Presence
from cliport_policy.presence.scene_net import STRIDE, SceneNet, evidence
from cliport_policy.presence.scenes import QUESTIONS, SceneBatch, SceneBatches
from cliport_policy.presence.sentence_net import Role, SentenceNet
from cliport_policy.presence.sentences import draw_examples
from cliport_policy.presence.vocabulary import Vocabulary, shade_of, vocabulary_of

pytestmark = pytest.mark.usefixtures("one_thread")

SPEC = WorkspaceSpec(pixel_size=0.0125)  # 64 x 32 pixels
RGB = {"red": 0xFF5759, "blue": 0x4E79A7, "green": 0x59A14F}
SENTENCES = (
    "put the red blocks in a blue bowl",
    "put the green blocks in a red bowl",
    "put the blue blocks in a green bowl",
)
COLORS = ("blue", "green", "red")
SHADES = tuple(tuple(round(float(value), 4) for value in shade_of(RGB[color])) for color in COLORS)
KNOWN = Vocabulary(("block", "bowl"), COLORS, SHADES)


def _draw(scene: Heightmap, name: str, color: str, row: int, col: int) -> SeenThing:
    """Draw a low small square for a block, a high large one for a bowl."""
    half, height = (2, 0.04) if name == "block" else (4, 0.02)
    patch = slice(row - half, row + half), slice(col - half, col + half)
    scene.color[patch] = [(RGB[color] >> shift) & 255 for shift in (16, 8, 0)]
    scene.height[patch] = height
    return SeenThing(name, color, RGB[color], row, col)


def _scene(rng: np.random.Generator, block: str, bowl: str) -> tuple[Heightmap, tuple[SeenThing, ...]]:
    rows, cols = SPEC.shape
    blank = np.full((rows, cols, 3), 200, np.uint8), np.zeros((rows, cols), np.float32), np.ones((rows, cols), np.bool_)
    scene = Heightmap(*blank, SPEC)
    at = [(int(rng.integers(8, 24)), int(rng.integers(6, 26))), (int(rng.integers(40, 56)), int(rng.integers(6, 26)))]
    if rng.random() < 0.5:
        at.reverse()
    return scene, (_draw(scene, "block", block, *at[0]), _draw(scene, "bowl", bowl, *at[1]))


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Return a folder with one data set `bowls`, of scenes with a block and a bowl, and a mixture of it."""
    rng, rows = np.random.default_rng(0), []
    for episode in range(12):
        sentence = SENTENCES[episode % len(SENTENCES)]
        scene, things = _scene(rng, sentence.split()[2], sentence.split()[-2])
        demo = Demo(sentence, False, "pick_place", 1, 1, 0.0, 3.0, 2, 2, 0.0)
        rows.append(Row("bowls", "train", episode, episode, 0, scene, (demo,), things))
    (tmp_path / "sets" / "bowls").mkdir(parents=True)
    write_part(part_path(tmp_path / "sets" / "bowls", 0), rows)
    (tmp_path / "sets" / "bowls" / "meta.json").write_text(
        json.dumps({"version": 3, "workspace": SPEC.to_dict(), "height_unit": HEIGHT_UNIT})
    )
    (tmp_path / "mixture.yaml").write_text("sources:\n  - {data: bowls}\n")
    return tmp_path / "sets"


@pytest.fixture
def batches(data: Path) -> SceneBatches:
    """Return batches of 16 scenes of that data set."""
    mixture = Mixture([Source(load_demonstrations(data / "bowls"))])
    things = [read_listed_things(source.data) for source in mixture.sources]
    assert vocabulary_of([{"block", "bowl"}], SENTENCES, RGB) == KNOWN
    return SceneBatches(mixture, things, KNOWN, 16, 0)


def test_squares_are_zones_where_piles_and_ropes_lie_and_shapes_elsewhere() -> None:
    assert listed_kind("square", {"square", "small block"}) == listed_kind("square", {"square", "bead"}) == "zone"
    assert listed_kind("square", {"square", "star", "brown box"}) == "square"
    named = named_kinds("push the pile of red blocks into the blue square")
    assert named == ("small block", "zone") == named_kinds("push the pile of red blocks into the red square")
    assert named_kinds("pack the square in the brown box") == ("square", "brown box")
    assert named_kinds("sing a song") is None


def test_questions_about_a_scene_are_answered_as_it_was_drawn(batches: SceneBatches) -> None:
    seen = batches.batch(0)
    assert all(torch.equal(a, b) for a, b in zip(seen, batches.batch(0), strict=True) if not a.isnan().any())
    assert seen.images.shape == (16, 5, *SPEC.shape) and seen.kinds.shape == (16, QUESTIONS)
    there = (seen.asked & seen.present).nonzero().tolist()
    assert len(there) > 30
    for scene, question in there:
        row, col = (STRIDE * int(cell) for cell in seen.cells[scene, question])
        at = slice(max(row - STRIDE, 0), row + 2 * STRIDE), slice(max(col - STRIDE, 0), col + 2 * STRIDE)
        patch = seen.images[scene][(slice(None), *at)]
        height = float(patch[3].max()) * 0.04  # m: a block is 0.04 high, a bowl 0.02, the table 0
        named = KNOWN.kinds[int(seen.kinds[scene, question])]
        assert (height > 0.03) == (named == "block") and height > 0.01, "what was asked for lies where it is said to"
    vain = seen.asked & ~seen.present
    assert int(vain.sum()) > 30
    named = (seen.terms >= 0) | ~seen.shades.isnan().any(-1)
    assert bool(named[vain].all()), "both kinds lie in each scene, so only colours can be missing"
    assert bool(seen.gray[~seen.shades.isnan().any(-1).all(1)].all()), "colours that are no names are asked for in grey"
    assert set(seen.colors.unique().tolist()) == {0, 1, 2, 3}


def test_sentences_say_what_their_words_belong_to() -> None:
    known = Vocabulary(("block", "bowl", "brown box", "star", "star hole", "toy car", "zone"), (), ())
    sentences = [list(SENTENCES), ["put the red star in the left star hole"], ["pack the toy car in the brown box"]]
    found = draw_examples(sentences, known, 400, np.random.default_rng(0))
    bowls = [one for one in found if one.place == known.kind("bowl")]
    assert len(bowls) > 80 and all(one.pick == known.kind("block") for one in bowls)
    for one in bowls:
        assert {Role.PICK, Role.PLACE} == {role for _, role in one.roles} - {Role.NEITHER}
    spoken = {
        one.sentence[slice(*span)].lower() for one in bowls for span, role in one.roles if role is not Role.NEITHER
    }
    assert len(spoken - set(BASIC_TERMS)) > 20, "some colours go by other names than basic ones"
    stars = [one for one in found if "star" in one.sentence]
    assert stars and all((one.pick, one.place) == (known.kind("star"), known.kind("star hole")) for one in stars)
    strange = [one for one in found if one.pick == known.unknown and "box" in one.sentence]
    assert strange and not any("toy car" in one.sentence for one in strange)


def test_a_net_of_scenes_learns_what_is_there_and_what_is_not(batches: SceneBatches) -> None:
    torch.manual_seed(0)
    net = SceneNet(len(KNOWN.kinds), len(KNOWN.colors))
    optimizer = scene_optimizer(net)
    first = scene_step(net, optimizer, batches.batch(0), 0, 1000)
    for number in range(1, 40):
        scene_step(net, optimizer, batches.batch(number), number, 1000)
    last = {name: loss.item() for name, loss in scene_losses(net.train(), batches.batch(40)).items()}
    assert last["there"] < 0.5 * first["there"] and last["kinds"] < 0.5 * first["kinds"]
    assert all(loss.item() == 0 for loss in scene_losses(net.train(), _without_things(batches.batch(0))).values())


def _without_things(batch: SceneBatch) -> SceneBatch:
    nothing = torch.zeros_like(batch.asked)
    return batch._replace(asked=nothing, present=nothing, marks=batch.marks[:0])


def test_a_presence_network_reads_a_sentence_and_asks_for_what_it_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cliport_policy.presence.fit._SENTENCE_BATCH", 16)
    torch.manual_seed(0)
    known = KNOWN
    net = SentenceNet(len(known.kinds))
    examples = draw_examples([list(SENTENCES)], known, 120, np.random.default_rng(1))
    assert fit_sentences(net, examples, 150, 0, shared_encoder()) < 0.5
    presence = Presence(known, shared_encoder(), SceneNet(2, 3), net)
    pick, place = presence.meant("put the green blocks in a red bowl")
    assert (pick.kinds[0], place.kinds[0]) == (0, 1) and pick.shares[0] > 0.9 < place.shares[0]
    assert (pick.colors, place.colors) == (("green",), ("red",))
    image = torch.zeros(1, 5, *SPEC.shape)
    for sentence in (SENTENCES[0], "put the barney purple blocks in a grey bowl", "put it there"):
        assert 0.0 <= presence.look(image, sentence).missing.probability <= 1.0


def test_a_checkpoint_keeps_its_policy_and_gets_a_presence_network(
    tiny_checkpoint: Callable[..., Path], make_flat_set: Callable[..., Path], tmp_path: Path,
    give_presence: Callable[[Path, bool], None],
) -> None:  # fmt: skip
    path = tiny_checkpoint("compact")
    before, _ = load_checkpoint(path)
    scene = load_demonstrations(make_flat_set(tmp_path / "flat", 1, pixel_size=0.0125))
    observation = scene.observation(scene.frames[0])
    alone = load_policy(path).infer(observation, SENTENCES[0])
    for sees, expected in ((True, 0.0), (False, 1.0)):
        give_presence(path, sees)
        heard = load_policy(path).infer(observation, SENTENCES[0])
        assert heard.missing.endswith("block") == (not sees), "what is there is not missing"
        assert heard.absent_probability == pytest.approx(expected, abs=0.05) and heard.action == alone.action
    after, card = load_checkpoint(path)
    assert all(torch.equal(before[name], after[name]) for name in before)
    assert (card.presence["kinds"], card.presence["colors"]) == (["block", "bowl"], ["blue", "green", "red"])
    assert card.presence["made_by"] == {"command": "by hand"} and len(card.presence["shades"]) == 3
    card_path = path.with_suffix(".json")
    values = json.loads(card_path.read_text())
    card_path.write_text(json.dumps({**values, "presence": {**card.presence, "kinds": ["block"]}}))
    with pytest.raises(CheckpointError, match=r"the presence network of checkpoint .* does not fit its card"):
        load_policy(path)


def test_the_command_stops_goes_on_and_writes_into_the_checkpoint(
    tiny_checkpoint: Callable[..., Path], data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    received: list[int] = []
    monkeypatch.setattr("cliport_policy.fit_presence.stop_on_signals", lambda: received)
    monkeypatch.setattr("cliport_policy.fit_presence._SENTENCES", 40)
    monkeypatch.setattr("cliport_policy.fit_presence._SENTENCE_STEPS", 2)
    path = tiny_checkpoint("compact")
    words = ["--checkpoint", str(path), "--data", str(data), "--mixture", str(tmp_path / "mixture.yaml"),
             "--n-demos", "12", "--steps", "4", "--batch", "2", "--out", str(tmp_path / "out")]  # fmt: skip
    steps: list[int] = []

    def noted(net: SceneNet, optimizer: Any, batch: SceneBatch, step: int, of: int) -> dict[str, float]:
        steps.append(step)
        received.extend([15] if len(steps) == 2 else [])  # as a signal in the middle of a step does
        return scene_step(net, optimizer, batch, step, of)

    monkeypatch.setattr("cliport_policy.fit_presence.scene_step", noted)
    assert main(words) == 130 and "the same command goes on" in capsys.readouterr().out
    received.clear()
    assert not load_card(path).presence
    assert main(words) == 0 and steps == [0, 1, 2, 3], "what was begun is ended, and nothing is done twice"
    assert load_card(path).presence["kinds"] == ["block", "bowl"] and "2 kinds of things" in capsys.readouterr().out
    assert main([*words, "--steps", "5"]) == 1 and "can't be resumed" in capsys.readouterr().err
    received.append(2)
    assert main([*words, "--out", str(tmp_path / "other")]) == 130, "stopped among the sentences"


def test_an_image_that_is_damaged_is_named_in_one_line(
    tiny_checkpoint: Callable[..., Path], data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """The process that makes batches meets it, and what it raises comes as it is."""
    monkeypatch.setattr("cliport_policy.fit_presence.stop_on_signals", list)
    monkeypatch.setattr("cliport_policy.fit_presence._SENTENCE_STEPS", 1)
    monkeypatch.setattr("cliport_policy.fit_presence._SENTENCES", 8)
    part = part_path(data / "bowls", 0)
    table = pq.read_table(part).drop_columns(["color_png"])
    pq.write_table(table.append_column("color_png", pa.array([b"no picture"] * 12)), part)
    words = ["--checkpoint", str(tiny_checkpoint("compact")), "--data", str(data), "--mixture",
             str(tmp_path / "mixture.yaml"), "--n-demos", "12", "--out", str(tmp_path / "out")]  # fmt: skip
    assert main(words) == 1
    error = capsys.readouterr().err
    assert "can't be decoded" in error and error.count("\n") == 1 and "Traceback" not in error


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        (("--steps", "0"), "--steps is 0: give 1 or more"), (("--n-demos", "99"), "99 were asked for"),
        (("--checkpoint", "nowhere"), "no checkpoint at 'nowhere'"), (("--mixture", "tenn"), "no mixture 'tenn'"),
        (("--data", "nowhere"), "no data set at nowhere/bowls"),
    ],
)  # fmt: skip
def test_one_line_says_what_is_wrong(
    changes: tuple[str, str], complaint: str, data: Path, tiny_checkpoint: Callable[..., Path], tmp_path: Path,
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr("cliport_policy.fit_presence.stop_on_signals", list)
    words = ["--checkpoint", str(tiny_checkpoint("compact")), "--data", str(data), "--mixture",
             str(tmp_path / "mixture.yaml"), "--n-demos", "12", "--out", str(tmp_path / "out")]  # fmt: skip
    assert main([*words, *changes]) == 1
    error = capsys.readouterr().err
    assert complaint in error and error.count("\n") == 1 and not (tmp_path / "out").exists()


def test_a_checkpoint_of_another_workspace_is_refused(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its cells would be of another size than those that things were learned in."""
    monkeypatch.setattr("cliport_policy.fit_presence.stop_on_signals", list)
    words = ["--data", str(data), "--mixture", str(tmp_path / "mixture.yaml"), "--n-demos", "12"]
    assert main(["--checkpoint", "default", *words, "--out", str(tmp_path / "out")]) == 1
    error = capsys.readouterr().err
    assert "has the workspace" in error and error.count("\n") == 1


@pytest.mark.parametrize("shape", [(64, 32), (60, 38)])
def test_any_even_picture_can_be_asked_about(shape: tuple[int, int]) -> None:
    net = SceneNet(2, 3).eval()
    rows, cols = shape
    features = net.features(torch.rand(1, 5, rows, cols))
    seen = evidence(torch.rand(1, 2, rows // 2, cols // 2), torch.tensor([[True, False]]))
    assert seen.shape[-2:] == features.shape[-2:]
    kinds = torch.tensor([[0, 1]])
    assert net.score(features, seen, kinds, torch.zeros_like(kinds)).shape[:2] == (1, 2)


@pytest.mark.parametrize(
    ("own", "missing", "expected"),
    [
        (0.9, None, (0.9, "")),
        (0.9, Missing(0.05, "red bowl", 1.0), (0.017, "")),  # found, and all that is named is known
        (0.9, Missing(0.05, "red bowl", 0.5), (0.9, "")),  # something named is not known
        (0.9, Missing(0.3, "red bowl", 1.0), (0.9, "")),
        (0.1, Missing(0.76, "red bowl", 1.0), (0.514, "red bowl")),
        (0.1, Missing(0.74, "red bowl", 1.0), (0.487, "red bowl")),
        (0.9, Missing(0.2, "letter K", 1.0, is_outline=True), (0.061, "")),  # its name means nothing to the policy
        (0.9, Missing(0.2, "letter K", 0.5, is_outline=True), (0.9, "")),
        (0.1, Missing(0.9, "letter K", 1.0, is_outline=True), (0.6, "letter K")),  # a fifth may be hidden at its place
    ],
)
def test_a_presence_network_has_its_word_in_what_is_absent(
    own: float, missing: Missing | None, expected: tuple[float, str]
) -> None:
    probability, name = absence(own, missing, done=0.2)
    assert (probability, name) == (pytest.approx(expected[0], abs=2e-3), expected[1])


def test_data_that_lists_nothing_is_refused(flat_set: Path) -> None:
    with pytest.raises(DataError, match="does not list the things on the table"):
        read_listed_things(load_demonstrations(flat_set))
