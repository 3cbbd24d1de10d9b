"""The joint network: one look serves all scores, words of colour become maps, and old kinds still load beside it."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import SafetensorError

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy import color_words
from cliport_policy.checkpoint import ANCHORS, Card, save_checkpoint
from cliport_policy.color_words import likelihoods, load_color_head, read_survey
from cliport_policy.errors import CheckpointError, ConfigError
from cliport_policy.joint_config import JointConfig
from cliport_policy.language import ENCODER_NAME, shared_encoder
from cliport_policy.named_colors import basic_tokens, color_name_reader
from cliport_policy.named_configs import load_network_config, network_config_from_dict
from cliport_policy.networks.compact.unet import Downsample
from cliport_policy.networks.factory import build_network
from cliport_policy.networks.joint.color_words import scaled_lab
from cliport_policy.networks.joint.network import JointNetwork
from cliport_policy.networks.policy_network import Placings
from cliport_policy.networks.rotation import bin_angles, straight_cells
from cliport_policy.observation import observation_tensor
from cliport_policy.policy import Policy, load_policy

SMALL = {
    "widths": (8, 12, 16),
    "decoder_width": 8,
    "goal_dim": 16,
    "crop_pixels": 16,
    "query_cells": 9,
    "n_rotations": 8,
}
PALETTE = {
    "blue": (78, 121, 167), "red": (255, 87, 89), "green": (89, 169, 79), "orange": (242, 142, 43),
    "yellow": (237, 201, 72), "purple": (176, 122, 161), "pink": (255, 157, 167), "cyan": (118, 183, 178),
    "brown": (156, 117, 95), "white": (255, 255, 255), "gray": (186, 176, 172),
}  # fmt: skip
pytestmark = pytest.mark.usefixtures("one_thread")


def _network(**changes: object) -> JointNetwork:
    torch.manual_seed(0)
    network = build_network(load_network_config("multi", {**SMALL, **changes}))
    assert isinstance(network, JointNetwork)
    return network.eval()


@pytest.mark.parametrize(
    "changes",
    [
        {}, {"color_words": "none", "color_reading": "tokens"}, {"color_words": "strict"}, {"gate": False},
        {"context_layers": 0},
        {"null_actions": 1}, {"chooses_primitive": False}, {"aligner": False},
        {"color_reading": "tokens"}, {"color_reading": "tokens", "color_words": "strict"},
    ],
)  # fmt: skip
@torch.no_grad()
def test_one_look_gives_the_scores_that_many_give(changes: dict[str, object]) -> None:
    network = _network(**changes)
    images = torch.rand(2, 5, 32, 16)
    goal = network.encode_goal(["put the red blocks in a blue bowl", "align the rope"])
    seen = network.look(images, goal)
    pick, angles = torch.full((2, 2), 8.0), bin_angles(8).expand(2, -1)
    assert network.score_picks(images, seen).shape == (2, 16 * 8 + network.n_null)
    assert network.score_places(images, seen, pick, angles).shape == (2, 8, 16, 8)
    for score in (network.score_picks, network.score_primitives):
        apart, together = score(images, goal), score(images, seen)
        assert (apart is None) == (together is None)
        assert apart is None or torch.allclose(apart, together, atol=1e-5)
    alone = network.score_picks(images[1:], seen.select(torch.tensor([False, True])))
    assert torch.allclose(alone, network.score_picks(images, seen)[1:], atol=1e-5)


@torch.no_grad()
def test_an_aligner_sees_pick_and_place_from_the_gripper() -> None:
    network = _network()
    images = torch.rand(1, 5, 32, 32)
    goal = network.encode_goal(["put the red blocks in a blue bowl"])
    pick, angles = torch.tensor([[9.5, 10.5]]), bin_angles(8)[None]
    places = torch.tensor([[20.5, 21.5]]).expand(1, 8, 2)
    scores = network.score_fits(images, goal, Placings(pick, torch.tensor([0.3]), places, angles))
    assert scores.shape == (1, 8) and float(scores.std()) > 1e-3
    # By a quarter turn of the whole scene about its middle, from columns to rows, nothing changes for the gripper.
    turned = torch.rot90(images, -1, (2, 3))
    pick, places = (torch.stack((pixel[..., 1], 31 - pixel[..., 0]), dim=-1) for pixel in (pick, places))
    again = network.score_fits(turned, goal, Placings(pick, torch.tensor([0.3 + torch.pi / 2]), places, angles))
    assert torch.allclose(again, scores, atol=1e-4)
    half = network.score_fits(turned, goal, Placings(pick, torch.tensor([0.3 - torch.pi / 2]), places, angles))
    assert not torch.allclose(half, scores, atol=1e-3), "it sees how the thing lies in the gripper"
    one = network.score_fits(
        turned, goal, Placings(pick, torch.tensor([0.3 + torch.pi / 2]), places[:, 3:4], angles[:, 3:4])
    )
    assert torch.allclose(one, scores[:, 3:4], atol=1e-4)
    assert network.has_aligner and not _network(aligner=False).has_aligner
    without = build_network(load_network_config("compact", {"widths": (8, 12, 16)}))
    assert not without.has_aligner
    with pytest.raises(ValueError, match="CompactNetwork has no aligner"):
        without.score_fits(images, goal, Placings(pick, torch.tensor([0.3]), places, angles))


@torch.no_grad()
def test_the_aligner_lays_the_thing_as_it_would_be_turned_upon_the_place() -> None:
    network = _network(crop_pixels=8)
    patch = torch.rand(5, 8, 8)
    images = torch.zeros(1, 5, 32, 32)
    images[0, :, 6:14, 7:15], images[0, :, 17:25, 18:26] = patch, torch.rot90(patch, -1, (1, 2))  # a quarter turn
    seen: list[tuple[torch.Tensor, torch.Tensor]] = []
    assert network.aligner is not None
    network.aligner.scorer.register_forward_pre_hook(lambda _, inputs: seen.append((inputs[2][0], inputs[0][0])))
    goal = network.encode_goal(["put the red blocks in a blue bowl"])
    pick, angles = torch.tensor([[9.5, 10.5]]), bin_angles(8)[None]
    network.score_fits(
        images, goal, Placings(pick, torch.zeros(1), torch.tensor([[20.5, 21.5]]).expand(1, 8, 2), angles)
    )
    held, below = seen[0]  # (5, 8, 8), (8, 5, 8, 8)
    assert torch.allclose(held, patch, atol=1e-5)
    off = (held - below).abs().amax((1, 2, 3))
    assert float(off[2]) < 1e-4 and float(off[[0, 1, 3, 4, 5, 6, 7]].min()) > 0.1
    # What fits still fits when both are seen smaller and mirrored.
    cells = (straight_cells(8) @ torch.tensor([[0.7, 0.2], [0.2, -0.6]]))[None]
    places = torch.tensor([[20.5, 21.5]]).expand(1, 8, 2)
    network.score_fits(images, goal, Placings(pick, torch.zeros(1), places, angles, cells))
    smaller, below = seen[1]
    off = (smaller - below).abs().amax((1, 2, 3))
    assert float(off[2]) < 1e-4 and float((smaller - held).abs().max()) > 0.1


@torch.no_grad()
def test_what_is_the_same_in_all_crops_is_convolved_once() -> None:
    down = Downsample(5, 4).eval()
    each, same = torch.rand(2, 3, 2, 8, 8), torch.rand(2, 3, 8, 8)
    both = torch.cat((same[:, None].expand(-1, 3, -1, -1, -1), each), dim=2).flatten(0, 1)
    assert torch.allclose(down.beside(each, same), down(both), atol=1e-5)


def _acting(network: JointNetwork, sentence: str, primitive: Primitive) -> PickPlaceAction:
    """Return what a network that chooses a primitive does in a scene of noise."""
    workspace, encoder = WorkspaceSpec(pixel_size=0.0125), shared_encoder()
    chosen = 9.0 * torch.nn.functional.one_hot(torch.tensor([int(primitive)]), len(Primitive))
    network.score_primitives = lambda images, goal: chosen  # type: ignore[method-assign]
    card, anchors = Card(network.config, workspace, "", 0.0), encoder.encode_one(sentence).sentence_vectors()
    generator = np.random.default_rng(0)
    shape = workspace.shape
    color = generator.integers(0, 255, (*shape, 3), np.uint8)
    heightmap = Heightmap(color, generator.random(shape, np.float32) * 0.1, np.ones(shape, np.bool_), workspace)
    return Policy(network, anchors, card, encoder).infer(heightmap, sentence).action


@torch.no_grad()
@pytest.mark.parametrize("primitive", Primitive)
def test_what_the_aligner_says_is_the_rotation_of_what_is_placed(primitive: Primitive) -> None:
    network = _network()
    workspace = WorkspaceSpec(pixel_size=0.0125)
    asked: list[Placings] = []

    def score_fits(images: torch.Tensor, goal: object, placings: Placings) -> torch.Tensor:
        asked.append(placings)
        return -5 * (placings.angles - 3 * torch.pi / 4).abs()

    network.score_fits = score_fits  # type: ignore[assignment,method-assign]
    action = _acting(network, "put the red blocks in a blue bowl", primitive)
    assert action.primitive is primitive
    if primitive is not Primitive.PICK_PLACE:
        assert not asked, "what is swept or folded fits nowhere"
        return
    assert math.remainder(action.place.yaw - action.pick.yaw, 2 * math.pi) == pytest.approx(3 * math.pi / 4, abs=1e-5)
    ((pick, yaw, places, angles, _),) = asked
    assert workspace.pixel_to_xy(*map(int, pick[0])) == pytest.approx((action.pick.x, action.pick.y))
    assert float(yaw[0]) == pytest.approx(action.pick.yaw % (2 * math.pi), abs=1e-5)
    assert places.shape == (1, 8 * len(places[0].unique(dim=0)), 2) and angles.shape == places.shape[:2]
    assert torch.equal(angles[0], bin_angles(8).repeat(len(angles[0]) // 8))
    assert torch.equal(places[0, 0], places[0, 7]) and len(places[0]) <= 3 * 8


def test_training_hides_colours_from_the_encoder_but_not_from_the_maps() -> None:
    network = _network(gray_share=1.0).train()
    heard: list[torch.Tensor] = []
    network.encoder.register_forward_pre_hook(lambda _, inputs: heard.append(inputs[0]))
    images = torch.rand(1, 5, 32, 16)
    network.look(images, network.encode_goal(["put the red blocks in a blue bowl"]))
    red, green, blue = heard[0][0, :12].unflatten(0, (3, 4))
    assert torch.allclose(red, green) and torch.allclose(red, blue)
    assert heard[0].shape[1] == 20 + 3


@torch.no_grad()
def test_a_map_is_bright_where_the_named_colour_is() -> None:
    network = _network()
    assert network.color_maps is not None
    torch.nn.init.zeros_(network.color_maps.choose.weight)
    image = torch.zeros(1, 5, 64, 32)
    image[:, 4] = 1
    for number, name in enumerate(("red", "blue")):
        color = (torch.tensor(PALETTE[name]) - 127.5) / 64
        image[0, :3, 32 * number : 32 * number + 32] = color[:, None, None]
    tokens, mask = shared_encoder().encode(["the blue things"])
    words = network.goal_reader.read_words(tokens, mask)
    maps = network.color_maps(torch.nn.functional.pixel_unshuffle(image, 2), tokens, words, mask)
    assert maps.shape == (1, 3, 32, 16)
    assert maps[0, 0, 16:].mean() > 5 * maps[0, 0, :16].mean() and maps[0, 0, 16:].mean() > 0.2


@torch.no_grad()
def test_a_map_of_names_is_bright_where_no_basic_term_names_the_colour_better() -> None:
    """The survey's blue is none of the palette's: how well it suits that is not asked, only what else would."""
    colors = torch.tensor(list(PALETTE.values())) / 255
    head = load_color_head("open")
    others = head(basic_tokens("open")[None])
    for name in ("red", "green", "blue", "yellow", "orange", "purple", "pink", "brown", "cyan", "turquoise"):
        tokens = color_name_reader().name_tokens(name)[None]
        shown = head(tokens).naming(scaled_lab(colors)[None], others)[0].amax(0)
        own = "cyan" if name == "turquoise" else name
        named = dict(zip(PALETTE, shown.tolist(), strict=True))
        assert 0.8 < named.pop(own) <= 1.0 and max(named.values()) < 0.5, name


@torch.no_grad()
def test_maps_by_name_show_the_named_colour_and_nothing_where_none_is_named() -> None:
    network = _network(color_reading="names")
    image = torch.zeros(1, 5, 64, 32)
    image[:, 4] = 1
    for number, name in enumerate(("orange", "purple")):
        image[0, :3, 32 * number : 32 * number + 32] = ((torch.tensor(PALETTE[name]) - 127.5) / 64)[:, None, None]
    shown = {}
    for sentence in ("move the purple ring", "align the rope"):
        heard: list[torch.Tensor] = []
        hook = network.encoder.register_forward_pre_hook(lambda _, inputs, heard=heard: heard.append(inputs[0]))
        network.look(image, network.encode_goal([sentence]))
        hook.remove()
        shown[sentence] = heard[0][0, -3:]
    assert float(shown["move the purple ring"][:, :16].max()) < 0.05
    assert float(shown["move the purple ring"][:, 16:].min()) > 0.8
    assert not shown["align the rope"].any()


@torch.no_grad()
@pytest.mark.parametrize("light", [1.0, 0.8])
def test_of_things_seen_the_nearest_to_a_known_colour_is_shown(light: float) -> None:
    """In any light, and in grey, as bright as blocks are; nothing where no thing comes near."""
    network = _network(color_reading="names")
    image = torch.zeros(1, 5, 64, 64)
    image[:, 4] = 1
    image[:, :3] = -0.3  # the table
    named, distractor = slice(0, 16), slice(24, 40)
    for rows, rgb in ((named, (2, 0, 53)), (distractor, (60, 100, 160))):
        image[0, :3, rows, :16] = ((light * torch.tensor(rgb) - 127.5) / 64)[:, None, None]
        image[0, 3, rows, :16] = 1
    heard: list[torch.Tensor] = []
    network.encoder.register_forward_pre_hook(lambda _, inputs: heard.append(inputs[0]))
    for sentence in ("put the midnight blue block here", "put the bright orange block here"):
        network.look(image, network.encode_goal([sentence]))
    near, none = heard
    shown = near[0, -3:]
    assert float(shown[:, :8, :8].min()) > 0.9 and float(shown[:, 12:20, :8].max()) < 0.3
    assert float(shown[:, :, 8:].max()) < 0.01 and float(none[0, -3:].max()) < 0.05
    assert torch.equal(near[0, :4], near[0, 8:12]), "grey"
    assert float(near[0, :12, :8, :8].mean()) == pytest.approx((140 - 127.5) / 64, abs=0.1)


@torch.no_grad()
def test_words_without_colours_differ_in_nothing_but_the_maps() -> None:
    one, other = "put the red blocks in a blue bowl", "put the orange blocks in a pink bowl"
    network = _network(color_reading="names")
    goals = [network.encode_goal([sentence]) for sentence in (one, other)]
    assert torch.equal(goals[0].words, goals[1].words) and torch.equal(goals[0].language, goals[1].language)
    assert not torch.equal(goals[0].tokens, goals[1].tokens), "the maps read on"
    assert not torch.equal(goals[0].words, network.encode_goal(["put the red rings in a blue bowl"]).words)


def test_the_open_head_knows_the_palette_and_the_strict_one_was_not_told_the_unseen_words() -> None:
    colors = torch.tensor(list(PALETTE.values())) / 255
    names, own = list(PALETTE), np.arange(len(PALETTE))
    known = likelihoods(load_color_head("open"), names, colors, shared_encoder())
    assert (known.argmax(1) == own).sum() >= 10
    strict = likelihoods(load_color_head("strict"), names, colors, shared_encoder())
    seen = [i for i, name in enumerate(names) if name not in ("orange", "purple", "pink", "white")]
    assert (strict.argmax(1) == own)[seen].sum() >= 6
    told = " ".join(read_survey("strict").names)
    assert not any(word in told for word in ("orange", "purple", "purplish", "pink", "white"))
    assert len(read_survey("open").names) > 900


def test_no_other_word_is_taken_for_a_colour() -> None:
    head = load_color_head("open")
    encoder = shared_encoder()
    tokens = encoder.encode(["put the blocks in a bowl"]).tokens[0]
    assert float(head(tokens).is_color.sigmoid().max()) < 0.2


def test_lab_is_that_of_the_standard() -> None:
    found = scaled_lab(torch.tensor([[1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])) * 50
    expected = torch.tensor([[100.0, 0.0, 0.0], [53.24, 80.09, 67.20], [0.0, 0.0, 0.0]])
    assert torch.allclose(found, expected, atol=0.1)


def test_a_checkpoint_loads_and_says_what_it_does(tmp_path: Path) -> None:
    network = _network()
    with torch.no_grad():
        network.null_score.copy_(torch.tensor([0.0, 30.0]))
        assert network.primitive_head is not None
        network.primitive_head[-1].bias.copy_(torch.tensor([0.0, 30.0, 0.0]))
    workspace = WorkspaceSpec(pixel_size=0.0125)
    anchors = shared_encoder().encode_one("push the pile of red blocks into the blue square").sentence_vectors()
    path = tmp_path / "joint.safetensors"
    save_checkpoint(
        path, {**network.state_dict(), ANCHORS: anchors}, Card(network.config, workspace, ENCODER_NAME, 0.45)
    )
    policy = load_policy(path)
    rows, cols = workspace.shape
    scene = Heightmap(
        np.full((rows, cols, 3), 90, np.uint8),
        np.zeros((rows, cols), np.float32),
        np.ones((rows, cols), bool),
        workspace,
    )
    assert observation_tensor(scene).shape[1] == 5
    answer = policy.infer(scene, "push the pile of red blocks into the blue square")
    assert answer.action.primitive is Primitive.SWEEP
    assert answer.absent_probability > 0.99 and answer.done_probability < 0.01
    exact, rough = (load_policy(path, precision) for precision in ("float32", "bfloat16"))
    scores = [p.score(scene, "push the pile of red blocks into the blue square") for p in (exact, rough)]
    off = (scores[0].places - scores[1].places).abs().max() / scores[0].places.abs().max()
    assert 0 < float(off) < 0.05 and all(found.places.dtype is torch.float32 for found in scores)


def test_settings_come_back_and_wrong_ones_are_named() -> None:
    config = JointConfig(gate=False, widths=(8, 16))
    assert network_config_from_dict(config.to_dict()) == config
    with pytest.raises(ConfigError, match="did you mean 'open'"):
        JointConfig(color_words="opne")
    with pytest.raises(ConfigError, match="null_actions=3"):
        JointConfig(null_actions=3)


def test_a_damaged_color_head_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(color_words, "FOLDER", tmp_path)
    for content in (b"", b"no tensors at all"):
        (tmp_path / "open.safetensors").write_bytes(content)
        with pytest.raises(CheckpointError, match="run fit_color_words again"):
            load_color_head("open")


def test_heads_that_cannot_be_written_leave_the_shipped_ones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "strict.safetensors"
    path.write_bytes(b"as it was")

    def full(_: object, to: Path) -> None:
        to.write_bytes(b"half")
        raise SafetensorError("no space left")

    monkeypatch.setattr(color_words, "fit", lambda *_: (color_words.ColorHead(), 0.0))
    monkeypatch.setattr(color_words, "save_file", full)
    assert color_words.main(["--out", str(tmp_path)]) == 1
    assert capsys.readouterr().err.startswith(f"error: can't write {path} (no space left)")
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [(path.name, b"as it was")]
