"""Named shapes: what sentences call them, outlines of things, the network that tells them, and picks led by it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.card import resolve_checkpoint
from cliport_policy.checkpoint import load_checkpoint
from cliport_policy.data.phrasings import reword
from cliport_policy.errors import CheckpointError
from cliport_policy.fit_shapes import main
from cliport_policy.inference import NullAction
from cliport_policy.joint_config import JointConfig
from cliport_policy.language import shared_encoder
from cliport_policy.leading import led_picks
from cliport_policy.policy import Policy
from cliport_policy.presence.stored import load_presence
from cliport_policy.shapes import drawings
from cliport_policy.shapes.fit import DrawnBatches, share_right
from cliport_policy.shapes.names import SHAPES, shape_to_pick
from cliport_policy.shapes.outline_net import OutlineNet, load_outline_net, save_outline_net
from cliport_policy.shapes.reader import Outlined
from cliport_policy.shapes.silhouettes import SIDE, picture_of, silhouettes

pytestmark = pytest.mark.usefixtures("one_thread")

SPEC = WorkspaceSpec()
RGB = ((225, 87, 89), (78, 121, 167), (89, 161, 79), (237, 201, 72))


@pytest.mark.parametrize(
    ("sentence", "name"),
    [
        ("pack the letter M shape in the brown box", "letter M"), ("put the capital k away", "letter K"),
        ("put the red L-shaped piece in the L-shaped hole", "letter L"), ("put the E shape in the box", "letter E"),
        ("put a shape in the box", None), ("pack the letter opener in the brown box", None),
        ("pack the number seven shape in the brown box", "number 7"), ("pack the digit 4", "number 4"),
        ("put the gray heart in the left heart hole", "heart"), ("pack the hexagons", "hexagon"),
        ("put the rhombus in the diamond hole", "diamond"), ("put the half moon in the box", "crescent"),
        ("pack the flower pot in the brown box", None), ("pack the cross-head screwdriver", None),
        ("pack the star-shaped cookie", "star"), ("the heart, please", "heart"), ("pack the ring binder", None),
        ("put the star on the square", "star"), ("put the mug on the star", None), ("put it in the star hole", None),
        ("push the pile of red blocks into the green square", None), ("the star and the heart go into the box", None),
        ("cover the left heart hole with the pink heart", "heart"), ("we have to put the heart away", "heart"),
        ("pack the starfish in the brown box", None),
        ("put the red blocks in a green bowl", None), ("pack the number eleven", None), ("", None),
    ],
)  # fmt: skip
def test_a_sentence_names_a_shape(sentence: str, name: str | None) -> None:
    found = shape_to_pick(sentence)
    assert (found and found.name) == name and (name is None or name in SHAPES)


def test_a_shape_is_named_where_its_words_begin() -> None:
    sentence = "put the red letter K shape in the letter K hole"
    assert shape_to_pick(sentence) == ("letter K", (sentence.index("letter"),))


@pytest.mark.parametrize(
    ("sentence", "name"),
    [
        ("put the red letter M shape in the left letter M shape hole", "letter M"),
        ("put the red heart in the heart hole", "heart"), ("pack the hexagon in the brown box", "hexagon"),
    ],
)  # fmt: skip
def test_every_wording_of_a_sentence_names_the_shape_to_pick(sentence: str, name: str) -> None:
    rng = np.random.default_rng(0)
    wordings = {wording for _ in range(300) if name in (wording := reword(sentence, rng) or "")}
    assert len(wordings) > 20, "some leave the shape out"
    unheard = [wording for wording in wordings if (shape_to_pick(wording) or ("", ()))[0] != name]
    assert not unheard


def _cells(name: str, pixels: int = 20) -> np.ndarray:
    """Return a shape as a heightmap's cells (pixels, pixels) show it, its first font's or usual form."""
    mask = drawings._drawn(SHAPES.index(name), np.random.default_rng(3))
    rows, cols = np.nonzero(mask > 127)
    crop = mask[rows.min() : rows.max() + 1, cols.min() : cols.max() + 1] > 127
    index = [(np.arange(pixels) + 0.5) * size / pixels for size in crop.shape]
    return crop[np.ix_(index[0].astype(int), index[1].astype(int))]


def _table(names: Sequence[str]) -> tuple[Heightmap, list[np.ndarray]]:
    """Return a table with shapes of 6 cm by 2 cm in a column and a brown box, and the cells of each."""
    rows, cols = SPEC.shape
    color, height = np.full((rows, cols, 3), 190, np.uint8), np.zeros((rows, cols), np.float32)
    box = np.zeros((rows, cols), np.bool_)
    box[20:68, 100:148] = True
    box[22:66, 102:146] = False
    color[20:68, 100:148], height[box] = (156, 117, 95), 0.05
    where = []
    for number, name in enumerate(names):
        cells = np.zeros((rows, cols), np.bool_)
        top, left = 90 + 50 * number, 30 + 25 * (number % 3)
        cells[top : top + 20, left : left + 20] = _cells(name)
        color[cells], height[cells] = RGB[number % len(RGB)], 0.02
        where.append(cells)
    return Heightmap(color, height, np.ones((rows, cols), np.bool_), SPEC), where


def test_things_that_stand_out_are_found_each_by_itself() -> None:
    scene, where = _table(["letter K", "heart", "square"])
    found = silhouettes(scene.height, scene.valid, SPEC.pixel_size)
    assert len(found) == 3, "the box is too large to hold"
    for thing, cells in zip(sorted(found, key=lambda one: np.nonzero(one.cells)[0].min()), where, strict=True):
        assert np.array_equal(thing.cells, cells) and thing.picture.shape == (SIDE, SIDE)
        assert thing.picture.min() >= 0.0 and thing.picture.max() <= 1.0
    scene.valid[:] = False
    assert not silhouettes(scene.height, scene.valid, SPEC.pixel_size)


def test_a_picture_is_of_one_size() -> None:
    square = np.zeros((40, 60), np.bool_)
    square[5:15, 40:50] = True
    large = square.repeat(3, 0).repeat(3, 1)
    assert np.abs(picture_of(square) - picture_of(large)).mean() < 0.03
    assert picture_of(square).sum() == pytest.approx(SIDE * SIDE / 2, rel=0.1), "its corners are at the border"


def test_the_shipped_network_names_outlines_that_it_never_saw() -> None:
    net, batches = load_outline_net(), DrawnBatches(128, seed=77)
    assert np.mean([share_right(net, batches.batch(number)) for number in range(4)]) > 0.86


def test_picks_are_led_to_what_has_the_outline() -> None:
    picks = torch.randn(8, 8, generator=torch.Generator().manual_seed(0))
    picks[1, 1], picks[6, 6], picks[5, 6] = 6.0, 1.0, 2.0
    cells = torch.zeros(3, 16, 16, dtype=torch.bool)
    cells[0, 2:4, 2:4] = cells[1, 10:14, 12:14] = cells[2, :2, 12:] = True
    led = led_picks(picks, Outlined(cells, torch.tensor([0.02, 0.9, 0.02])).leads())
    assert divmod(int(led.argmax()), 8) == (5, 6), "the policy's own best place on the thing that is meant"
    assert led.flatten().logsumexp(0) == pytest.approx(float(picks.flatten().logsumexp(0)), abs=1e-4)
    assert float(led.flatten().softmax(0)[[6 * 8 + 6, 5 * 8 + 6]].sum()) > 0.6
    alike = led_picks(picks, Outlined(cells, torch.tensor([0.9, 0.9, 0.02])).leads())
    assert divmod(int(alike.argmax()), 8) == (1, 1), "of two such things the one that the policy would take"
    for nothing in (Outlined(cells, torch.full((3,), 0.02)), Outlined(cells[:0], torch.zeros(0))):
        assert led_picks(picks, nothing.leads()) is picks


@pytest.mark.parametrize("names", [("letter K", "letter S", "number 4"), ("arrow", "heart", "letter H")])
def test_the_policy_picks_shapes_that_no_demonstration_holds(policy: Policy, names: tuple[str, ...]) -> None:
    scene, where = _table(names)
    assert not {name for name in names if name in policy.card.presence["kinds"]}
    for name, cells in zip(names, where, strict=True):
        seen = policy.infer(scene, f"pack the {name} shape in the brown box")
        assert seen.null_action(0.9, 0.5) is not NullAction.ABSENT, f"the {name} lies there"
        row, col = seen.pick_pixel
        assert cells[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3].any(), f"at {row, col} is no {name}"
    absent = policy.infer(scene, "pack the letter X shape in the brown box")
    assert absent.null_action(0.5, 0.5) is NullAction.ABSENT and absent.missing == "letter X"


def test_a_shape_of_the_wrong_color_is_missing(policy: Policy) -> None:
    scene, where = _table(("letter K", "letter K", "letter S"))
    for color, cells in zip(("red", "blue"), where, strict=False):
        row, col = policy.infer(scene, f"pack the {color} letter K shape in the brown box").pick_pixel
        assert cells[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3].any(), color
    assert policy.infer(scene, "pack the yellow letter K shape in the brown box").missing == "yellow letter K"


@pytest.mark.parametrize(("by_kind", "is_outline"), [(1.0, False), (0.3, True)])
def test_a_known_shape_is_found_by_its_kind_or_by_its_outline(
    policy: Policy, monkeypatch: pytest.MonkeyPatch, by_kind: float, is_outline: bool
) -> None:
    """A ring is known as one of Hanoi's: what is found by either is not missing."""
    assert policy._presence is not None and "ring" in policy.card.presence["kinds"]
    seen = {True: torch.full((3, 1, 1), by_kind), False: torch.ones(3, 1, 1)}
    monkeypatch.setattr(policy._presence, "_seen", lambda role, *_: seen[bool(role.shape)])
    scene, _ = _table(("ring", "letter K"))
    missing = policy._presence.look(policy._tensor(scene), "move the red ring to the middle of the stand").missing
    assert missing.is_outline == is_outline and missing.probability < 0.1


def test_only_a_policy_that_reads_shapes_looks_for_them(policy: Policy) -> None:
    assert policy._presence is not None and policy._presence._shapes is not None
    scene, _ = _table(("letter K", "letter S", "number 4"))
    image = policy._tensor(scene)
    assert policy._presence.look(image, "pack the letter K shape in the brown box").leads is not None
    for sentence in ("push the pile of red blocks into the green square", "pack all the red blocks into the brown box",
                     "align the rope from front left tip to back right corner"):  # fmt: skip
        assert policy._presence.look(image, sentence).leads is None, f"'{sentence}' has no shape picked"


@pytest.mark.parametrize(
    ("arm", "reads", "knows"), [("open", True, True), ("open", False, False), ("strict", True, False)]
)
def test_the_strict_arm_is_not_told_what_shapes_look_like(
    policy: Policy, tmp_path: Path, arm: str, reads: bool, knows: bool
) -> None:
    tensors, card = load_checkpoint(resolve_checkpoint("default"))
    assert isinstance(card.network, JointConfig)
    network = replace(card.network, color_words=arm, reads_shapes=reads)
    presence = load_presence(tensors, replace(card, network=network), shared_encoder(), tmp_path)
    assert presence is not None
    scene, _ = _table(("letter K", "letter S"))
    look = presence.look(policy._tensor(scene), "pack the letter K shape in the brown box")
    assert (look.leads is not None) == knows


@pytest.fixture
def received(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the list of signals that the command is told of, and let it make small batches."""
    signals: list[int] = []
    monkeypatch.setattr("cliport_policy.fit_shapes.stop_on_signals", lambda: signals)
    monkeypatch.setattr("cliport_policy.fit_shapes._BATCH", 8)
    monkeypatch.setattr("cliport_policy.fit_shapes._ASKED", 1)
    return signals


def test_a_stopped_fit_goes_on(
    received: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from cliport_policy import fit_shapes

    steps: list[int] = []
    real: Callable[..., float] = fit_shapes.outline_step

    def step(net: OutlineNet, optimizer: torch.optim.Optimizer, batch: object, number: int, count: int) -> float:
        steps.append(number)
        if number == 1:
            received.append(2)
        return real(net, optimizer, batch, number, count)

    monkeypatch.setattr(fit_shapes, "outline_step", step)
    words = ["--steps", "4", "--state", str(tmp_path / "state"), "--out", str(tmp_path / "outlines.safetensors")]
    assert main(words) == 130 and "the same command goes on" in capsys.readouterr().out
    assert not (tmp_path / "outlines.safetensors").exists()
    received.clear()
    assert main(words) == 0 and steps == [0, 1, 2, 3] and "named rightly" in capsys.readouterr().out
    pictures = torch.rand(2, SIDE, SIDE)
    assert load_outline_net(tmp_path / "outlines.safetensors")(pictures).shape == (2, len(SHAPES) + 1)
    assert main([*words, "--seed", "1"]) == 1 and "can't be resumed" in capsys.readouterr().err
    assert main([*words, "--steps", "0"]) == 1 and "--steps is 0: give 1 or more" in capsys.readouterr().err


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    path = tmp_path / "outlines.safetensors"
    save_outline_net(OutlineNet(), path)
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(CheckpointError, match="run fit_shapes again"):
        load_outline_net(path)
