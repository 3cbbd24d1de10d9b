"""ResNet50 of torchvision: with ImageNet weights from the user's file, or untrained."""

from __future__ import annotations

from pathlib import Path

import torch
from torch import nn

from cliport_policy.encoders.clip_rn50 import MEAN, STD  # as the published baseline normalises
from cliport_policy.encoders.files import read_state_dict
from cliport_policy.encoders.frozen import Vision
from cliport_policy.errors import EncoderError

TAP_WIDTHS = (256, 512, 1024, 2048)
_NOISE_SHAPE = (2, 3, 96, 96)


def load_resnet50(path: Path) -> Vision:
    """Load a state dict of torchvision's resnet50.

    Raises:
        EncoderError: if the file is none.
    """
    network = _resnet50()
    try:
        network.load_state_dict(read_state_dict(path))
    except RuntimeError as error:
        reason = " ".join(str(error).split())[:120]
        raise EncoderError(f"{path} is no state dict of torchvision's resnet50 ({reason}): give that file") from None
    return _stages(network)


def untrained_resnet50(seed: int) -> Vision:
    """Make a ResNet50 of random weights.

    The batch norms' statistics are those of noise, or activations would grow from block to block.
    """
    with torch.random.fork_rng(devices=[]), torch.no_grad():
        torch.manual_seed(seed)
        vision = _stages(_resnet50())
        for module in vision.modules():
            if isinstance(module, nn.BatchNorm2d):
                module.momentum = None  # the plain mean of what was seen
        vision.train()(torch.rand(_NOISE_SHAPE))
    return vision.eval()


def _resnet50() -> nn.Module:
    from torchvision.models import resnet50  # costs seconds

    return resnet50(weights=None)


def _stages(network: nn.Module) -> Vision:
    stem = nn.Sequential()
    for name in ("conv1", "bn1", "relu", "maxpool"):
        stem.add_module(name, getattr(network, name))
    return Vision([stem, network.layer1, network.layer2, network.layer3, network.layer4], MEAN, STD)
