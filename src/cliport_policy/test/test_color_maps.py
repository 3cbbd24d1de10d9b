"""Words of colour become maps of where such colours are seen; the heads that say which were told what their arm was."""

from pathlib import Path
from typing import cast

import numpy as np
import pytest
import torch
from joint_networks import small_joint_network
from safetensors import SafetensorError

from cliport_policy import color_words
from cliport_policy.color_words import likelihoods, load_color_head, read_survey
from cliport_policy.errors import CheckpointError
from cliport_policy.language import shared_encoder
from cliport_policy.named_colors import basic_tokens, color_name_reader
from cliport_policy.networks.joint.color_words import naming, scaled_lab
from cliport_policy.networks.joint.network import JointNetwork
from cliport_policy.policy import load_policy

PALETTE = {
    "blue": (78, 121, 167), "red": (255, 87, 89), "green": (89, 169, 79), "orange": (242, 142, 43),
    "yellow": (237, 201, 72), "purple": (176, 122, 161), "pink": (255, 157, 167), "cyan": (118, 183, 178),
    "brown": (156, 117, 95), "white": (255, 255, 255), "gray": (186, 176, 172),
}  # fmt: skip
pytestmark = pytest.mark.usefixtures("one_thread")


def test_training_hides_colours_from_the_encoder_but_not_from_the_maps() -> None:
    network = small_joint_network(gray_share=1.0).train()
    heard: list[torch.Tensor] = []
    network.encoder.register_forward_pre_hook(lambda _, inputs: heard.append(inputs[0]))
    images = torch.rand(1, 5, 32, 16)
    network.look(images, network.encode_goal(["put the red blocks in a blue bowl"]))
    red, green, blue = heard[0][0, :12].unflatten(0, (3, 4))
    assert torch.allclose(red, green) and torch.allclose(red, blue)
    assert heard[0].shape[1] == 20 + 3


@torch.no_grad()
def test_a_map_is_bright_where_the_named_colour_is() -> None:
    network = small_joint_network()
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
        lab = scaled_lab(colors)[None]
        shown = naming(head(tokens).log_nearness(lab), others.log_nearness(lab))[0].amax(0)
        own = "cyan" if name == "turquoise" else name
        named = dict(zip(PALETTE, shown.tolist(), strict=True))
        assert 0.8 < named.pop(own) <= 1.0 and max(named.values()) < 0.5, name


@torch.no_grad()
def test_maps_by_name_show_the_named_colour_and_nothing_where_none_is_named() -> None:
    network = small_joint_network(color_reading="names")
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
@pytest.mark.parametrize(
    ("compares", "gray_side", "height", "shown"),
    [
        (True, 16, 1.0, (0.0, 0.3)),
        (True, 16, 0.0, (0.9, 1.0)),
        (True, 4, 1.0, (0.9, 1.0)),
        (False, 16, 1.0, (0.9, 1.0)),
    ],
)
def test_cyan_is_shown_as_gray_but_beside_a_thing_that_is_gray(
    compares: bool, gray_side: int, height: float, shown: tuple[float, float]
) -> None:
    """No basic term names the palette's cyan better than gray does; a table or a few pixels are no gray thing."""
    network = small_joint_network(color_reading="names", compares_colors=compares)
    image = torch.zeros(1, 5, 64, 64)
    image[:, 4] = 1
    for rows, side, name in ((0, gray_side, "gray"), (32, 16, "cyan")):
        color = (torch.tensor(PALETTE[name]) - 127.5) / 64
        image[0, :3, rows : rows + side, :side] = color[:, None, None]
        image[0, 3, rows : rows + side, :side] = height if name == "gray" else 1.0
    heard: list[torch.Tensor] = []
    network.encoder.register_forward_pre_hook(lambda _, inputs: heard.append(inputs[0]))
    network.look(image, network.encode_goal(["put the gray block here"]))
    maps = heard[0][0, -3:]
    assert float(maps[:, : gray_side // 2, : gray_side // 2].min()) > 0.9
    assert shown[0] <= float(maps[:, 16:24, :8].min()) <= float(maps[:, 16:24, :8].max()) <= shown[1]


@torch.no_grad()
@pytest.mark.parametrize("shipped", [False, True])
def test_a_thing_is_shown_where_light_falls_on_it_as_in_its_shade(shipped: bool) -> None:
    """Red is far redder in the shade, and shown in both; cyan is none of gray's shades."""
    network = small_joint_network(color_reading="names", compares_colors=True)
    if shipped:
        network = cast("JointNetwork", load_policy("default")._network)
    image = torch.zeros(1, 5, 64, 64)
    image[:, 3:] = 1
    image[0, :3] = -1.9  # dark
    for rows, name, light in ((0, "red", 1.0), (16, "red", 0.6), (32, "gray", 1.0), (48, "cyan", 1.0)):
        image[0, :3, rows : rows + 16, :16] = ((light * torch.tensor(PALETTE[name]) - 127.5) / 64)[:, None, None]
    heard: list[torch.Tensor] = []
    network.encoder.register_forward_pre_hook(lambda _, inputs: heard.append(inputs[0]))
    for name in ("red", "gray"):
        network.look(image, network.encode_goal([f"put the {name} block here"]))
    red, gray = (inputs[0, -3, :, :8] for inputs in heard)
    assert float(red[:16].min()) > 0.9
    assert float(gray[16:24].min()) > 0.9 and float(gray[24:].max()) < 0.3


@torch.no_grad()
@pytest.mark.parametrize("light", [1.0, 0.8])
def test_of_things_seen_the_nearest_to_a_known_colour_is_shown(light: float) -> None:
    """In any light, and in grey, as bright as blocks are; nothing where no thing comes near."""
    network = small_joint_network(color_reading="names")
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
def test_only_the_scene_whose_sentence_has_a_known_colour_is_seen_in_grey() -> None:
    network = small_joint_network(color_reading="names")
    image = torch.rand(1, 5, 64, 64, generator=torch.Generator().manual_seed(0)).expand(3, -1, -1, -1).clone()
    image[:, 4] = 1
    heard: list[torch.Tensor] = []
    network.encoder.register_forward_pre_hook(lambda _, inputs: heard.append(inputs[0]))
    sentences = ["put the red block here", "put the teal block here", "align the rope all the way to its corner there"]
    network.look(image, network.encode_goal(sentences))
    gray = [torch.equal(seen[:4], seen[8:12]) for seen in heard[0]]
    assert gray == [False, True, False]


@torch.no_grad()
def test_words_without_colours_differ_in_nothing_but_the_maps() -> None:
    one, other = "put the red blocks in a blue bowl", "put the orange blocks in a pink bowl"
    network = small_joint_network(color_reading="names")
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
