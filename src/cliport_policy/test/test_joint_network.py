"""The joint network: one look serves all scores, words of colour become maps, and old kinds still load beside it."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from joint_networks import small_joint_network
from torch import nn

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.card import Card
from cliport_policy.checkpoint import ANCHORS, save_checkpoint
from cliport_policy.errors import ConfigError
from cliport_policy.folded_norms import fold_norms
from cliport_policy.joint_config import JointConfig
from cliport_policy.language import ENCODER_NAME, shared_encoder
from cliport_policy.named_configs import load_network_config, network_config_from_dict
from cliport_policy.networks.compact.unet import Downsample
from cliport_policy.networks.factory import build_network
from cliport_policy.networks.joint.network import JointNetwork
from cliport_policy.networks.policy_network import Placings
from cliport_policy.networks.rotation import bin_angles, straight_cells
from cliport_policy.observation import observation_tensor
from cliport_policy.policy import Policy, load_policy
from cliport_policy.presence.scene_net import SceneNet

pytestmark = pytest.mark.usefixtures("one_thread")


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
    network = small_joint_network(**changes)
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
    network = small_joint_network()
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
    assert network.has_aligner and not small_joint_network(aligner=False).has_aligner
    without = build_network(load_network_config("compact", {"widths": (8, 12, 16)}))
    assert not without.has_aligner
    with pytest.raises(ValueError, match="CompactNetwork has no aligner"):
        without.score_fits(images, goal, Placings(pick, torch.tensor([0.3]), places, angles))


@torch.no_grad()
def test_the_aligner_lays_the_thing_as_it_would_be_turned_upon_the_place() -> None:
    network = small_joint_network(crop_pixels=8)
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


@torch.no_grad()
def test_a_policys_networks_have_their_norms_folded_and_score_the_same() -> None:
    """Tolerance 1e-4 of the largest value; the norms are given the statistics of a little training first."""
    images = torch.rand(2, 5, 32, 16)
    pick, angles = torch.full((2, 2), 8.0), bin_angles(8).expand(2, -1)
    network = small_joint_network().train()
    goal = network.encode_goal(["put the red blocks in a blue bowl", "align the rope"])

    def scores() -> list[torch.Tensor]:
        seen = network.look(images, goal)
        yaws, fits = (
            network.score_yaws(images, seen, pick, angles),
            network.score_fits(images, seen, Placings(pick, torch.zeros(2), pick[:, None].expand(-1, 8, -1), angles)),
        )
        assert yaws is not None
        return [network.score_picks(images, seen), yaws, network.score_places(images, seen, pick, angles), fits]

    scene = SceneNet(3, 4).train()
    for _ in range(3):
        scores()
        scene.features(images)
    network.eval()
    scene.eval()
    before = [*scores(), scene.features(images)]
    fold_norms(network)
    fold_norms(scene)
    assert not any(isinstance(module, nn.BatchNorm2d) for net in (network, scene) for module in net.modules())
    for a, b in zip(before, [*scores(), scene.features(images)], strict=True):
        assert (a - b).abs().max() < 1e-4 * a.abs().max()


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
    network = small_joint_network()
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
    pick, yaw, places, angles, _ = asked[0]
    assert workspace.pixel_to_xy(*map(int, pick[0])) == pytest.approx((action.pick.x, action.pick.y))
    assert float(yaw[0]) == pytest.approx(action.pick.yaw % (2 * math.pi), abs=1e-5)
    assert places.shape == (1, 8 * len(places[0].unique(dim=0)), 2) and angles.shape == places.shape[:2]
    assert torch.equal(angles[0], bin_angles(8).repeat(len(angles[0]) // 8))
    assert torch.equal(places[0, 0], places[0, 7]) and len(places[0]) <= 3 * 8


def test_a_checkpoint_loads_and_says_what_it_does(tmp_path: Path) -> None:
    network = small_joint_network()
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
