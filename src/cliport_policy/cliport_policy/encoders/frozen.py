"""The frozen encoders of a process: one instance, however many networks and streams use it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

from cliport_policy.networks.stream_net import EncoderShape

CACHE_SIZE = 20_000  # sentences
_FINGERPRINT_VALUES = 64  # of each tensor


class Vision(nn.Module):
    """Stages of a frozen image encoder behind its own normalisation.

    stages: each hands its output on; those of the last four are the taps, at 1/4, 1/8, 1/16 and 1/32.
    """

    def __init__(self, stages: Sequence[nn.Module], mean: Sequence[float], std: Sequence[float]) -> None:
        super().__init__()
        self.stages = nn.ModuleList(stages)
        self.register_buffer("mean", torch.tensor(mean)[:, None, None], persistent=False)
        self.register_buffer("std", torch.tensor(std)[:, None, None], persistent=False)

    def forward(self, color: Tensor) -> list[Tensor]:
        """(B, 3, H, W) in 0..1 -> four taps (B, C, H / s, W / s)."""
        x = ((color - self.mean) / self.std).to(next(self.parameters()).dtype)
        x = x.contiguous(memory_format=torch.channels_last)
        outputs: list[Tensor] = []
        for stage in self.stages:
            x = stage(x)
            outputs.append(x)
        return outputs[-4:]


class FrozenEncoders:
    """An image and a sentence encoder. Not a module itself, so that no network trains, counts or saves them."""

    def __init__(
        self,
        name: str,
        shape: EncoderShape,
        vision: Vision,
        text: nn.Module,
        read: Callable[[list[str]], Tensor],
    ) -> None:
        """text: the module behind read, which takes sentences to (B, shape.text_dim) float32."""
        self.shape = shape
        self._text = text.eval().requires_grad_(False)
        self._read = read
        self._cache: dict[str, Tensor] = {}
        self._device = torch.device("cpu")
        vision.eval().requires_grad_(False)
        self.identity = f"{name} {_fingerprint(vision, text)}"
        fold_norms(vision)
        self._vision = vision.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def __deepcopy__(self, memo: dict[int, Any]) -> FrozenEncoders:
        """A copied network sees through the same eyes."""
        return self

    @property
    def modules(self) -> tuple[nn.Module, nn.Module]:
        """The image and the sentence encoder, for those who count or inspect."""
        return self._vision, self._text

    def cast(self, dtype: torch.dtype, text: bool) -> FrozenEncoders:
        """The same in another precision: of images and, where it is nobody else's, of sentences."""
        self._vision.stages.to(dtype)
        if text:
            self._text.to(dtype)
        return self

    @torch.no_grad()
    def see(self, color: Tensor) -> list[Tensor]:
        """(B, 3, H, W) in 0..1, H and W multiples of 32 -> (B, C, H / s, W / s) for s = 4, 8, 16, 32."""
        if color.device != self._device:
            self._device = color.device
            self._vision.to(self._device)
        return self._vision(color)

    def read(self, sentences: Sequence[str]) -> Tensor:
        """(B, text_dim) float32 on the CPU; a sentence is encoded once and remembered."""
        found = {s: self._cache[s] for s in sentences if s in self._cache}
        missing = [s for s in dict.fromkeys(sentences) if s not in found]
        if missing:
            # What is remembered must serve training, too, though it be asked for within inference_mode.
            with torch.inference_mode(False), torch.no_grad():
                found.update(zip(missing, self._read(missing), strict=True))
            if len(self._cache) + len(missing) > CACHE_SIZE:
                self._cache.clear()
            self._cache.update((s, found[s]) for s in missing)
        return torch.stack([found[s] for s in sentences])


def fold_norms(module: nn.Module) -> None:
    """Multiply each batch norm of an encoder in eval mode into the convolution before it: the same, for less work.

    Pairs are found by name: `conv1` and `bn1`, or `0` and `1` of a shortcut.
    """
    for parent in module.modules():
        for name, norm in list(parent.named_children()):
            before = "0" if name == "1" else name.replace("bn", "conv")
            conv = getattr(parent, before, None)
            if isinstance(norm, nn.BatchNorm2d) and isinstance(conv, nn.Conv2d):
                setattr(parent, before, fuse_conv_bn_eval(conv, norm).requires_grad_(False))
                setattr(parent, name, nn.Identity())


def _fingerprint(*modules: nn.Module) -> str:
    """Twelve hexadecimal digits that another set of weights does not have."""
    digest = hashlib.sha256()
    for module in modules:
        for name, value in module.named_parameters():
            digest.update(f"{name}{tuple(value.shape)}".encode())
            digest.update(value.detach().flatten()[:_FINGERPRINT_VALUES].float().numpy().tobytes())
    return digest.hexdigest()[:12]
