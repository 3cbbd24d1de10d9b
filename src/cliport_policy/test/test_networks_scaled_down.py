"""All networks, scaled down: each learns, is saved and acts behind one interface, and tricks change no score."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy import load_policy
from cliport_policy.card import Card
from cliport_policy.checkpoint import ANCHORS, save_checkpoint
from cliport_policy.config import TrainConfig
from cliport_policy.data.batches import Batch
from cliport_policy.encoders.frozen import EncoderShape
from cliport_policy.errors import CheckpointError, ConfigError, ObservationError, PolicyError
from cliport_policy.language import ENCODER_NAME, shared_encoder
from cliport_policy.named_configs import config_names, load_network_config
from cliport_policy.networks.factory import build_network, has_fast_bfloat16
from cliport_policy.networks.policy_network import Goal, PolicyNetwork
from cliport_policy.networks.rotation import bin_angles
from cliport_policy.networks.streams import network as streams
from cliport_policy.networks.streams.network import StreamsNetwork
from cliport_policy.observation import observation_tensor
from cliport_policy.stream_config import StreamsConfig
from cliport_policy.training.losses import compute_losses

SENTENCE = "put the red blocks in a green bowl"
WORKSPACE = WorkspaceSpec(pixel_size=0.0125)  # 64 x 32 pixels
TINY = {"width": 0.0625, "crop_pixels": 32, "n_rotations": 8}
TINY_COMPACT = {"widths": (8, 12), "goal_dim": 16, "crop_pixels": 16, "query_cells": 9, "n_rotations": 8}
TINY_JOINT = {**TINY_COMPACT, "decoder_width": 8}
pytestmark = pytest.mark.usefixtures("one_thread")
TRAINING = TrainConfig(rotator_rotations=3, transport_rotations=2)


def _tiny(name: str, **changes: object) -> PolicyNetwork:
    torch.manual_seed(0)
    small = TINY_JOINT if name == "multi" else TINY_COMPACT if name.startswith("compact") else TINY
    return build_network(load_network_config(name, {**small, **changes}))


def _images(batch: int = 1, seed: int = 0) -> Tensor:
    """(B, 5, 64, 32): three coloured blocks on a table each."""
    rng = np.random.default_rng(seed)
    rows, cols = WORKSPACE.shape
    observations = []
    for _ in range(batch):
        color, height = np.full((rows, cols, 3), 80, np.uint8), np.zeros((rows, cols), np.float32)
        for block in ((255, 87, 89), (89, 169, 79), (78, 121, 167)):
            row, col = int(rng.integers(0, rows - 8)), int(rng.integers(0, cols - 8))
            color[row : row + 8, col : col + 8], height[row : row + 8, col : col + 8] = block, 0.04
        observations.append(Heightmap(color, height, rng.random((rows, cols)) > 0.02, WORKSPACE, 0))
    return torch.cat([observation_tensor(observation) for observation in observations])


def _observation() -> Heightmap:
    size = WORKSPACE.shape
    return Heightmap(np.full((*size, 3), 80, np.uint8), np.zeros(size, np.float32), np.ones(size, bool), WORKSPACE, 0)


def _batch(goal_images: Tensor | None) -> Batch:
    return Batch(
        images=_images(3),
        phrases=[SENTENCE, "pack the hammer in the brown box", SENTENCE],
        done=torch.tensor([False, False, True]),
        pick=torch.tensor([[20.0, 10.0], [40.0, 20.0], [0.0, 0.0]]),
        pick_yaw=torch.tensor([0.0, 0.5, 0.0]),
        pick_yaw_period=torch.full((3,), np.pi / 2),
        place=torch.tensor([[50.0, 20.0], [10.0, 8.0], [0.0, 0.0]]),
        rotation=torch.tensor([0.0, 1.0, 0.0]),
        seeds=torch.arange(3),
        goal_images=goal_images,
        primitive=torch.tensor([0, 1, 0]),
    )


def _saved(network: PolicyNetwork, folder: Path, frozen: str) -> Path:
    path = folder / "policy.safetensors"
    anchors = shared_encoder().encode_one(SENTENCE).sentence_vectors()
    card = Card(network.config, WORKSPACE, ENCODER_NAME, 0.45, frozen=frozen)
    save_checkpoint(path, {**network.state_dict(), ANCHORS: anchors}, card)
    return path


# Those with a rotator are the others with a setting (test_network_config.py): one of them stands for all.
NETWORKS = [name for name in config_names() if not name.endswith("_rotator")]


@pytest.mark.parametrize("name", [*NETWORKS, "cliport+rotator"])
def test_every_config_learns_is_saved_and_acts(name: str, clip_models: Path, tmp_path: Path) -> None:
    name, _, rotator = name.partition("+")
    network = _tiny(name, **({"rotator": "pick"} if rotator else {}))
    batch = _batch(_images(3, seed=1) if network.needs_goal_image else None)
    network.train()
    optimizer = torch.optim.Adam(network.parameters(), lr=5e-4)
    totals = []
    for _ in range(4):
        losses = compute_losses(network, batch, TRAINING)
        optimizer.zero_grad()
        losses.total().backward()
        learned = [p for p in network.parameters() if p.requires_grad]
        assert all(p.grad is not None and p.grad.isfinite().all() for p in learned)
        optimizer.step()
        totals.append(float(losses.total().detach()))
    assert min(totals[1:]) < totals[0]

    policy = load_policy(_saved(network, tmp_path, network.encoder_identity), precision="float32")
    observation = Heightmap(
        np.full((64, 32, 3), 80, np.uint8), np.zeros((64, 32), np.float32), np.ones((64, 32), bool), WORKSPACE, 0
    )
    goal = observation if network.needs_goal_image else None
    inference = policy.infer(observation, SENTENCE, with_maps=True, goal=goal)
    assert inference.maps is not None and inference.maps.pick.shape == inference.maps.place.shape == WORKSPACE.shape
    assert float(inference.maps.place.sum()) == pytest.approx(1, abs=1e-3)
    network.eval()
    image = observation_tensor(observation)
    with torch.no_grad():
        aim = network.encode_goal([SENTENCE], image)
        mass = network.score_picks(image, aim)[0].softmax(0)
    assert inference.done_probability == pytest.approx(float(mass[-network.n_null]), rel=1e-3)
    if network.cell_size == 1:
        assert divmod(int(mass[:-1].argmax()), 32) == inference.pick_pixel
    assert rotator or name.startswith(("compact", "multi")) or inference.action.pick.yaw == 0
    if network.needs_goal_image:
        with pytest.raises(ObservationError, match="image of the goal"):
            policy.infer(observation, SENTENCE)


def test_other_encoders_than_at_training_are_refused(clip_models: Path, tmp_path: Path) -> None:
    path = _saved(_tiny("clip_only"), tmp_path, frozen="clip_rn50 0123456789ab")
    with pytest.raises(CheckpointError, match="0123456789ab") as caught:
        load_policy(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["cliport", "transporter", "image_goal"])
def test_batch_entries_do_not_mix(name: str, clip_models: Path) -> None:
    """Tolerance 1e-4."""
    network = _tiny(name).eval()
    images, pick = _images(3), torch.tensor([[20.0, 10.0], [40.0, 20.0], [5.0, 30.0]])
    sentences = [SENTENCE, "pack the hammer in the brown box", "put the blue blocks in a red bowl"]
    with torch.no_grad():
        goal = network.encode_goal(sentences, images.flip(0))
        picks, (_, places) = network.score_picks(images, goal), network.score_rotations(images, goal, pick)
        one = goal.select(torch.tensor([1]))
        assert torch.allclose(picks[1:2], network.score_picks(images[1:2], one), atol=1e-4)
        assert torch.allclose(places[1:2], network.score_rotations(images[1:2], one, pick[1:2])[1], atol=1e-4)


def test_all_rotations_in_one_batch_are_those_one_by_one(clip_models: Path) -> None:
    """Tolerance 1e-4."""
    network = _tiny("cliport").eval()
    images, pick, angles = _images(), torch.tensor([[20.0, 10.0]]), bin_angles(8)[None]
    with torch.no_grad():
        goal = network.encode_goal([SENTENCE])
        together = network.score_places(images, goal, pick, angles)
        single = [network.score_places(images, goal, pick, angles[:, i : i + 1]) for i in range(8)]
    assert torch.allclose(together, torch.cat(single, dim=1), atol=1e-4)


def test_rotator_and_query_share_what_the_encoder_saw(clip_models: Path) -> None:
    """The same scores as apart (1e-3: crops at +350 and -10 degrees differ by rounding), encoded once less."""
    network = _tiny("cliport", rotator="pick").eval()
    images, pick, angles = _images(2), torch.tensor([[20.0, 10.0], [40.0, 25.0]]), bin_angles(8).expand(2, -1)
    encoders = network._encoders  # type: ignore[attr-defined]
    seen: list[int] = []
    handle = encoders.modules[0].register_forward_hook(lambda _, inputs, __: seen.append(len(inputs[0])))
    with torch.no_grad():
        goal = network.encode_goal([SENTENCE, SENTENCE])
        yaws, places = network.score_rotations(images, goal, pick)
        assert seen == [16, 2]  # the crops, the key
        apart = network.score_yaws(images, goal, pick, angles), network.score_places(images, goal, pick, angles)
    handle.remove()
    assert yaws is not None and apart[0] is not None
    assert torch.allclose(yaws, apart[0], atol=1e-3) and torch.allclose(places, apart[1], atol=1e-3)


@pytest.mark.parametrize("name", ["cliport", "transporter", "rn50_bert"])
def test_a_few_crops_at_a_time_are_all_at_once(name: str, clip_models: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tolerance 1e-4."""
    network = _tiny(name, rotator="pick").eval()
    images, pick = _images(2), torch.tensor([[20.0, 10.0], [40.0, 25.0]])
    found = []
    for at_once in (100, 3):
        monkeypatch.setattr(streams, "IMAGES_PER_CHUNK", at_once)
        with torch.no_grad():
            found.append(network.score_rotations(images, network.encode_goal([SENTENCE, SENTENCE]), pick))
    for a, b in zip(*found, strict=True):
        assert a is not None and b is not None and torch.allclose(a, b, atol=1e-4)


def test_compiled_parts_are_the_plain_ones() -> None:
    """Tolerance 1e-4. Traced and lowered as in earnest, but not handed to a C++ compiler, which takes a minute."""
    network = _tiny("compact").eval()
    images, pick = _images(), torch.tensor([[20.0, 10.0]])
    found = []
    for compiled in (False, True):
        if compiled:
            network.compile_parts(backend="aot_eager")
        with torch.no_grad():
            goal = network.encode_goal([SENTENCE])
            found.append((network.score_picks(images, goal), *network.score_rotations(images, goal, pick)))
    for a, b in zip(*found, strict=True):
        assert a is not None and b is not None and torch.allclose(a, b, atol=1e-4)


def test_compiling_without_a_compiler_is_one_line(
    tiny_checkpoint: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(ConfigError, match="needs the C\\+\\+ compiler no-such-compiler"):
        load_policy(tiny_checkpoint("compact"), compiled=True)


def test_what_can_not_be_acted_on_is_refused_in_one_line(tiny_checkpoint: Callable[..., Path]) -> None:
    policy, seen = load_policy(tiny_checkpoint("compact")), _observation()
    height = seen.height.copy()
    height[3, 4] = np.nan
    other = WorkspaceSpec(pixel_size=0.025)
    elsewhere = Heightmap(seen.color[::2, ::2], seen.height[::2, ::2], seen.valid[::2, ::2], other, 0)
    cases = [
        (replace(seen, height=height), SENTENCE, "heights are not all numbers"),
        (replace(seen, valid=np.zeros_like(seen.valid)), SENTENCE, "no valid cell"),
        (elsewhere, SENTENCE, "is not the policy's"),
        (seen, "  \n ", "the instruction is empty"),
        (seen, "x" * 2000, "at most 500 are taken"),
        (seen, "what is the capital of France?", "unlike anything"),
    ]
    for observation, instruction, message in cases:
        with pytest.raises(PolicyError, match=message) as caught:
            policy.infer(observation, instruction)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["cliport", "transporter", "compact"])
def test_channels_last_is_contiguous(name: str, clip_models: Path) -> None:
    """Tolerance 1e-3."""
    network = _tiny(name).eval()
    images, pick = _images(), torch.tensor([[20.0, 10.0]])
    with torch.no_grad():
        goal = network.encode_goal([SENTENCE])
        plain = network.score_picks(images, goal), network.score_rotations(images, goal, pick)[1]
        network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        images = images.contiguous(memory_format=torch.channels_last)
        other = network.score_picks(images, goal), network.score_rotations(images, goal, pick)[1]
    assert all(torch.allclose(a, b, atol=1e-3) for a, b in zip(plain, other, strict=True))


def test_bfloat16_is_near_float32(clip_models: Path, tmp_path: Path) -> None:
    """Tolerance: 10 % of the spread of the scores, on average."""
    assert isinstance(has_fast_bfloat16(), bool)
    network = _tiny("cliport").eval()
    path = _saved(network, tmp_path, network.encoder_identity)
    images, pick = _images(), torch.tensor([[20.0, 10.0]])
    scores = []
    for precision in ("float32", "bfloat16"):
        other = load_policy(path, precision)._network
        with torch.no_grad():
            goal = other.encode_goal([SENTENCE])
            scores.append([other.score_picks(images, goal)[:, :-1], other.score_rotations(images, goal, pick)[1]])
    for a, b in zip(*scores, strict=True):
        assert (a - b.float()).abs().mean() < 0.1 * a.std()


class _ColorAsFeatures(nn.Module):
    """Stands in for a net: its features are the scene's own colours."""

    reads_taps = False

    def forward(self, scene: Tensor, language: Tensor | None, taps: object) -> Tensor:
        return scene[:, :3] - 0.5 * (scene[:, :3].sum(1, keepdim=True) > 0)


def test_the_place_is_where_the_picked_thing_is_found_turned() -> None:
    network = _tiny("transporter")
    for name in ("query", "key"):
        network.nets[name] = _ColorAsFeatures()  # type: ignore[index]
    images = torch.zeros(1, 5, 64, 32)
    images[:, 4] = 1
    images[:, :3] = -127.5 / 64  # a black table
    corner = torch.zeros(3, 9, 9)
    corner[0, :, :3] = corner[0, 6:, :] = corner[1, :3, 3:6] = 3.9  # an L with a green spot: no symmetry
    images[0, :3, 10:19, 8:17] += corner
    images[0, :3, 40:49, 12:21] += corner.rot90(1, (2, 1))  # turned by +90 degrees: from columns towards rows
    with torch.no_grad():
        _, places = network.score_rotations(images, Goal(), torch.tensor([[14.0, 12.0]]))
    itself, turned = (divmod(int(places[0, rotation].argmax()), 32) for rotation in (0, 2))  # at 0 and 90 degrees
    assert itself == (14, 12) and turned == (44, 16)
    assert float(places[0, 2, 44, 16]) == pytest.approx(float(places[0, 0, 14, 12]), rel=0.02)


def test_a_network_without_its_encoders_says_so() -> None:
    config = load_network_config("clip_only", TINY)
    assert isinstance(config, StreamsConfig)
    network = StreamsNetwork(config, shape=EncoderShape((32, 64, 128, 256), 32))
    with pytest.raises(ConfigError, match="without its encoders"):
        network.encode_goal([SENTENCE])
