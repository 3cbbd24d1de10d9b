"""The paper's networks: sizes and shapes of its tables, and parts that compute what plain formulas do."""

import pytest
import torch
from torch import nn
from torch.nn import functional as F

from cliport_policy.encoders.frozen import EncoderShape
from cliport_policy.named_configs import load_network_config
from cliport_policy.networks.correlation import correlate_inside
from cliport_policy.networks.policy_network import count_parameters
from cliport_policy.networks.streams.fusion import LateralFusion
from cliport_policy.networks.streams.hourglass import Hourglass
from cliport_policy.networks.streams.network import StreamsNetwork
from cliport_policy.stream_config import StreamsConfig

CLIP = EncoderShape((256, 512, 1024, 2048), 1024)
BERT = EncoderShape((256, 512, 1024, 2048), 768, 1024)
pytestmark = pytest.mark.usefixtures("one_thread")


def _on_paper(name: str, shape: EncoderShape) -> StreamsNetwork:
    """The network at full size, without memory for its weights."""
    config = load_network_config(name)
    assert isinstance(config, StreamsConfig)
    with torch.device("meta"):
        return StreamsNetwork(config, shape=shape)


# Millions of trainable parameters: pick; query and key together (docs/paper.md, "Layers").
@pytest.mark.parametrize(
    ("name", "shape", "pick", "place"),
    [
        ("cliport", CLIP, 92.3, 184.7),
        ("cliport_wo_lang", CLIP, 92.3 - 1.84, 184.7 - 3.67),  # three linear layers less, each
        ("transporter", EncoderShape((), 0), 9.82, 2 * 9.82),
        ("clip_only", CLIP, 51.82, 2 * 51.82),
        ("rn50_bert", BERT, 92.3 + 0.79, 184.7 + 1.57),  # a projection of 768 to 1024 more, each
        ("untrained_sem", BERT, 9.82 + 51.82 + 0.79, 2 * (9.82 + 51.82 + 0.79)),
        ("language_transporter", CLIP, 9.82 + 0.92, 2 * (9.82 + 0.92)),
        ("image_goal", EncoderShape((), 0), 9.82, 2 * 9.82),
    ],
)
def test_parameters_are_those_of_the_tables(name: str, shape: EncoderShape, pick: float, place: float) -> None:
    nets = _on_paper(name, shape).nets
    assert count_parameters(nets["pick"]) == pytest.approx(pick * 1e6, rel=0.01)
    assert count_parameters(nets["query"]) + count_parameters(nets["key"]) == pytest.approx(place * 1e6, rel=0.01)


def test_parameters_of_the_streams() -> None:
    cliport, clip_only = _on_paper("cliport", CLIP).nets["pick"], _on_paper("clip_only", CLIP).nets["pick"]
    assert count_parameters(cliport.spatial) == pytest.approx(39.47e6, rel=0.01)
    assert count_parameters(cliport.semantic) == pytest.approx(52.87e6, rel=0.01)
    assert count_parameters(clip_only.semantic) == pytest.approx(51.82e6, rel=0.01)


@pytest.mark.parametrize(("kind", "convolutions"), [("plain", 57), ("lateral", 78)])
def test_shapes_of_the_hourglass(kind: str, convolutions: int) -> None:
    with torch.device("meta"):
        stream = Hourglass(kind, out=3)
        features = stream(torch.empty(2, 6, 320, 320))
    assert sum(isinstance(module, nn.Conv2d) for module in stream.modules()) == convolutions
    assert features.map.shape == (2, 3, 320, 320)
    if kind == "lateral":
        shapes = [(1024, 20), (512, 40), (256, 80), (128, 160), (64, 320), (32, 640)]
        assert [tuple(x.shape[1:3]) for x in features.laterals] == shapes


def test_cliport_at_full_size_answers_at_full_resolution() -> None:
    """Shapes only: on the meta device, with taps of the paper's widths."""
    network = _on_paper("cliport", CLIP)
    size = {"pick": (320, 320), "key": (384, 224), "query": (64, 64)}
    with torch.device("meta"):
        for name, (rows, cols) in size.items():
            taps = [
                torch.empty(2, c, rows // s, cols // s) for c, s in zip(CLIP.tap_widths, (4, 8, 16, 32), strict=True)
            ]
            out = network.nets[name](torch.empty(2, 4, rows, cols), torch.empty(2, 1024), taps)
            assert out.shape == (2, 1 if name == "pick" else 3, rows, cols)


def test_correlation_in_the_frequency_domain_is_conv2d() -> None:
    """Tolerance 1e-4 of the largest score."""
    generator = torch.Generator().manual_seed(0)
    key, window = torch.randn(2, 3, 96, 64, generator=generator), torch.randn(2, 4, 3, 32, 32, generator=generator)
    direct = torch.cat([F.conv2d(key[i : i + 1], window[i]) for i in range(2)])
    assert (correlate_inside(key, window) - direct).abs().max() < 1e-4 * direct.abs().max()


def test_a_lateral_fusion_is_that_of_the_joined_maps() -> None:
    """Tolerance 1e-5."""
    generator = torch.Generator().manual_seed(0)
    x, lateral = torch.randn(2, 6, 8, 8, generator=generator), torch.randn(2, 4, 8, 8, generator=generator)
    fusion = LateralFusion(6, 4)
    with torch.no_grad():
        joined = fusion.project(F.relu(torch.cat((x, lateral), dim=1)))
        assert torch.allclose(fusion(x, lateral), joined, atol=1e-5)
