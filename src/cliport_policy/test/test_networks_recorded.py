"""A checkpoint means tomorrow what it meant when it was saved: fixed weights give the scores that were recorded.

A change of a stride, a padding, an activation or a scale leaves shapes and names as they are, and makes every published
checkpoint another policy. Where such a change is meant, raise FORMAT_VERSION and record anew.
"""

import math
import re
from collections.abc import Sequence

import numpy as np
import pytest
import torch
import yaml
from torch import Tensor, nn

from cliport_policy.config import NetworkConfig
from cliport_policy.encoders.bert_modules import Bert, BertShape
from cliport_policy.encoders.clip_modules import ClipResNet, ClipText
from cliport_policy.encoders.efficientnet import load_efficientnet
from cliport_policy.joint_config import JointConfig
from cliport_policy.named_configs import load_network_config
from cliport_policy.networks.factory import build_network
from cliport_policy.networks.policy_network import Placings, PolicyNetwork, count_parameters
from cliport_policy.networks.rotation import bin_angles

SENTENCES = ["put the red blocks in a green bowl", "align the rope"]
STREAMS = {"width": 0.0625, "crop_pixels": 32, "n_rotations": 6}
COMPACT = {"widths": (8, 12, 16), "goal_dim": 16, "crop_pixels": 16, "query_cells": 9, "n_rotations": 6}
JOINT = {**COMPACT, "decoder_width": 12}
# (spread, wave) of the picks' scores, of the yaws' where there is a rotator, of the places', of the primitives', and of
# the turns' where there is an aligner.
RECORDED: dict[str, list[tuple[float, float]]] = {
    "compact": [(4.4297, 1.1415), (0.3261, 0.24672), (10.016, 7.9657)],
    "compact_wo_height": [(5.1237, 1.2131), (0.32999, 0.26486), (9.5177, 8.8658)],
    "compact_wo_lang": [(4.6672, 0.35438), (0.35386, 0.28049), (10.429, 11.28)],
    "multi": [(11.377, 2.0496), (0.47951, 0.67058), (1307.6, -357.37), (1.1886, -0.10837), (0.35667, -0.29719)],
    "multi compares_colors=false": [
        (11.395, 1.8306),
        (0.47951, 0.67058),
        (1317.4, -369.64),
        (1.1893, -0.10754),
        (0.35668, -0.29719),
    ],
    "multi color_reading=tokens": [
        (11.543, 1.4596),
        (0.47674, 0.64423),
        (791.65, -173.87),
        (1.2412, -0.017773),
        (0.3681, -0.30189),
    ],
    "multi aligner=false color_reading=tokens": [
        (48.825, 9.4677),
        (1.1292, 4.0999),
        (371.47, 64.391),
        (0.14386, -0.14927),
    ],
    "multi aligner=false color_words=none color_reading=tokens": [
        (26.9, 2.137),
        (0.7039, -0.5465),
        (13819, 3617.1),
        (0.51131, -0.36871),
    ],
    "transporter": [(93.7, 40.245), (126.23, 0.94008)],
    "language_transporter": [(3695.8, -23.018), (20065, 98.468)],
    "cliport rotator=pick": [(31.153, 2.9039), (0.090109, -0.12235), (1.0137, 0.0054258)],
    "cliport pick.language=film pick.fusion=concat": [(52.068, 2.6505), (101.55, -3.5567)],
    "clip_only": [(0.049213, -0.0055187), (0.077307, -0.00050685)],
    "wo_skips": [(141.33, 4.5123), (434.79, 5.2251)],
    "image_goal": [(82.269, 38.598), (974.72, 19.162)],
    "rn50_bert": [(3688.3, 280.7), (0.76453, -0.01505)],
}
TAPS = [(13.926, 3.8471), (11.752, -4.0444), (8.5587, 5.5702), (3.6514, -1.84)]  # of the packaged image encoder
# Stages of a small CLIP, its sentences, and a small BERT's tokens.
ENCODERS = [
    (0.63685, 0.057114),
    (0.47558, 0.31825),
    (0.64286, -0.25767),
    (0.88103, 0.27751),
    (0.8618, -0.56467),
    (4.1854, -1.9788),
    (1.0874, -0.63351),
]
pytestmark = [pytest.mark.usefixtures("one_thread"), pytest.mark.usefixtures("clip_models")]


def _figures(scores: Tensor) -> tuple[float, float]:
    """Spread of scores, and their product with a wave, which no two of them have alike."""
    flat = scores.double().flatten()
    wave = torch.cos(0.7 * torch.arange(len(flat), dtype=torch.float64))
    return float(flat.std()), float(flat @ wave) / math.sqrt(len(flat))


def _check(scores: Sequence[Tensor], recorded: Sequence[tuple[float, float]]) -> None:
    for each, (spread, wave) in zip(scores, recorded, strict=True):
        assert _figures(each) == (pytest.approx(spread, rel=2e-3), pytest.approx(wave, abs=2e-3 * spread))


def _fill(network: nn.Module) -> None:
    """Set all weights but those of the shipped colour head, as large as keeps the features' size."""
    for number, (name, value) in enumerate(sorted(network.state_dict().items())):
        if not value.is_floating_point() or name.startswith("color_maps.head"):
            continue
        drawn = torch.from_numpy(np.random.default_rng(number).standard_normal(tuple(value.shape))).float()
        if value.dim() > 1:
            value.copy_(drawn * math.sqrt(2 / value[0].numel()))
        elif name.endswith("running_var") or (name.endswith("weight") and re.search("norm|bn|ln_", name)):
            value.copy_(1 + 0.3 * drawn.clamp(-2, 2))
        else:
            value.copy_(0.3 * drawn)


def _images(batch: int) -> Tensor:
    """(B, 5, 64, 32): smooth colours and heights, each pixel another, and a few pixels that were not seen."""
    rows, cols = torch.meshgrid(torch.arange(64.0), torch.arange(32.0), indexing="ij")
    waves = [torch.sin(0.11 * (i + 1) * rows + 0.07 * (5 - i) * cols + i) for i in range(4)]
    one = torch.stack([*waves, ((rows * cols) % 17 > 0).float()])
    return torch.stack([one.roll(9 * i, 1) for i in range(batch)])


def _network(name: str) -> PolicyNetwork:
    base, *changes = name.split()
    small = JOINT if base == "multi" else COMPACT if base.startswith("compact") else STREAMS
    given = {key: yaml.safe_load(value) for key, value in (change.split("=") for change in changes)}
    network = build_network(load_network_config(base, {**small, **given}))
    _fill(network)
    return network.eval()


@pytest.mark.parametrize("name", RECORDED)
@torch.no_grad()
def test_fixed_weights_give_the_recorded_scores(name: str) -> None:
    network, images, pick = _network(name), _images(2), torch.tensor([[20.0, 11.0], [41.5, 17.0]])
    goal = network.look(images, network.encode_goal(SENTENCES, images.flip(0)))
    scores = [network.score_picks(images, goal), *network.score_rotations(images, goal, pick)]
    scores.append(network.score_primitives(images, goal))
    angles = bin_angles(network.config.n_rotations).expand(2, -1)
    places = pick.flip(0)[:, None].expand(-1, angles.shape[1], -1)
    if network.has_aligner:
        scores.append(network.score_fits(images, goal, Placings(pick, angles[:, 1], places, angles)))
    _check([each for each in scores if each is not None], RECORDED[name])


def test_the_packaged_image_encoder_sees_what_it_saw() -> None:
    with torch.no_grad():
        taps = load_efficientnet().eval()(0.5 + 0.5 * _images(1)[:, :3])
    _check(taps, TAPS)


@torch.no_grad()
def test_encoders_of_fixed_weights_see_and_read_what_they_did() -> None:
    """CLIP's stages and sentences, and BERT's tokens, which the shared instances are made of."""
    stages, text, bert = ClipResNet(8, (1, 2, 1, 1)), ClipText(50, 9, 64, 2, 8), Bert(BertShape(50, 9, 16, 24, 2, 4))
    for network in (stages, text, bert):
        _fill(network.eval())
    x, found = _images(2)[:, :3], []
    for stage in stages.stages:
        x = stage(x)
        found.append(x)
    numbers = torch.tensor([[3, 7, 49, 0, 0], [5, 1, 2, 8, 49]])
    _check([*found, text(numbers), bert.states(numbers, numbers > 0)], ENCODERS)
    assert [tuple(each.shape[1:]) for each in found] == [(8, 16, 8), (32, 16, 8), (64, 8, 4), (128, 4, 2), (256, 2, 1)]


def test_sizes_of_the_default_networks() -> None:
    """Those of README.md and docs/training.md: 1.65 and 2.29 million."""
    for config, count in ((NetworkConfig(), 1_652_206), (JointConfig(aligner=True), 2_285_278)):
        assert count_parameters(build_network(config)) == count


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("compact", {"locator.null_score": 4.0, "transport.log_scale": 2.0, "transport.log_radius": 1.5}),
        ("multi", {"null_score": 4.0, "transport.log_scale": 2.5, "transport.log_radius": 1.5}),
        ("transporter", {"null_score": 4.0}),
    ],
)
def test_a_training_begins_with_rare_null_actions_and_narrow_windows(name: str, values: dict[str, float]) -> None:
    small = JOINT if name == "multi" else COMPACT if name == "compact" else STREAMS
    network = build_network(load_network_config(name, small))
    weights = network.state_dict()
    for key, value in values.items():
        assert (weights[key] == value).all()
    for key, weight in weights.items():
        if key.endswith("film.bias"):
            assert not weight.any()
        if key.endswith("film.weight"):
            assert float(weight.std()) == pytest.approx(0.02, rel=0.2)
