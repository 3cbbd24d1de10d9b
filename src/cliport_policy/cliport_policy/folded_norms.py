"""Batch norms multiplied into the convolutions before them, once nothing more is learned."""

from __future__ import annotations

from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval


def fold_norms(module: nn.Module) -> None:
    """Multiply each batch norm of a module in eval mode into the convolution before it: the same, for less work.

    Pairs are found by name: `conv1` and `norm1` or `bn1`, `stem` and `stem_norm`, neighbours in a Sequential.
    """
    for parent in module.modules():
        for name, norm in list(parent.named_children()):
            before = _convolution_before(name)
            conv = getattr(parent, before, None)
            if isinstance(norm, nn.BatchNorm2d) and isinstance(conv, nn.Conv2d):
                setattr(parent, before, fuse_conv_bn_eval(conv, norm).requires_grad_(False))
                setattr(parent, name, nn.Identity())


def _convolution_before(name: str) -> str:
    """Return the name of the convolution that a batch norm of a name follows."""
    if name.isdigit():
        return str(int(name) - 1)
    return name.removesuffix("_norm").replace("norm", "conv").replace("bn", "conv")
