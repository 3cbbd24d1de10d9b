"""Frozen encoders of a process: one instance, however many networks and streams use it."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from cliport_policy.folded_norms import fold_norms

CACHE_SIZE = 20_000  # sentences
_FINGERPRINT_VALUES = 64  # number of values taken from each tensor


class EncoderShape(NamedTuple):
    """Widths of frozen encoders, all that a network must know of them to be built.

    tap_widths: channels at 1/4, 1/8, 1/16 and 1/32. text_dim: width of a sentence's vector.
    projected_dim: width of a learned projection of it, if the encoder has none of its own; 0: no projection.
    """

    tap_widths: tuple[int, ...]
    text_dim: int
    projected_dim: int = 0


class Vision(nn.Module):
    """Stages of a frozen image encoder behind its own normalisation.

    The outputs of the last four stages are the taps, at 1/4, 1/8, 1/16 and 1/32.
    """

    def __init__(self, stages: Sequence[nn.Module], mean: Sequence[float], std: Sequence[float]) -> None:
        super().__init__()
        self.stages = nn.ModuleList(stages)
        self.register_buffer("mean", torch.tensor(mean)[:, None, None], persistent=False)
        self.register_buffer("std", torch.tensor(std)[:, None, None], persistent=False)

    def forward(self, color: Tensor) -> list[Tensor]:
        """Return four taps (B, C, H / s, W / s) of images (B, 3, H, W) in 0..1."""
        x = ((color - self.mean) / self.std).to(next(self.parameters()).dtype)
        x = x.contiguous(memory_format=torch.channels_last)
        outputs: list[Tensor] = []
        for stage in self.stages:
            x = stage(x)
            outputs.append(x)
        return outputs[-4:]


class FrozenEncoders:
    """Image encoder and sentence encoder. Not a module itself, so that no network trains, counts or saves them."""

    def __init__(
        self,
        name: str,
        shape: EncoderShape,
        vision: Vision,
        text: nn.Module,
        encode: Callable[[list[str]], Tensor],
    ) -> None:
        """Freeze the encoders and take the fingerprint of their weights.

        encode: takes sentences to (B, shape.text_dim) float32. text: the module behind it.
        """
        self.shape = shape
        self._text = text.eval().requires_grad_(False)
        self._encode = encode
        self._cache: dict[str, Tensor] = {}
        self._device = torch.device("cpu")
        vision.eval().requires_grad_(False)
        self.identity = f"{name} {_fingerprint(vision, text)}"
        fold_norms(vision)
        self._vision = vision.eval().to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def __deepcopy__(self, memo: dict[int, Any]) -> FrozenEncoders:
        """Return the instance itself: a copied network shares its encoders."""
        return self

    @property
    def modules(self) -> tuple[nn.Module, nn.Module]:
        """Image encoder and sentence encoder, for counting and inspection."""
        return self._vision, self._text

    def cast(self, dtype: torch.dtype, text: bool) -> FrozenEncoders:
        """Change the precision of the image encoder and, if `text`, of the sentence encoder; return the instance."""
        self._vision.stages.to(dtype)
        if text:
            self._text.to(dtype)
        return self

    @torch.no_grad()
    def encode_images(self, color: Tensor) -> list[Tensor]:
        """Return the taps (B, C, H / s, W / s), s = 4, 8, 16, 32, of images (B, 3, H, W) in 0..1.

        H and W are multiples of 32.
        """
        if color.device != self._device:
            self._device = color.device
            self._vision.to(self._device)
        return self._vision(color)

    def encode_sentences(self, sentences: Sequence[str]) -> Tensor:
        """Return (B, text_dim) float32 on the CPU; a sentence is encoded once and remembered."""
        found = {s: self._cache[s] for s in sentences if s in self._cache}
        missing = [s for s in dict.fromkeys(sentences) if s not in found]
        if missing:
            # A vector encoded within inference_mode could not serve training later.
            with torch.inference_mode(False), torch.no_grad():
                found.update(zip(missing, self._encode(missing), strict=True))
            if len(self._cache) + len(missing) > CACHE_SIZE:
                self._cache.clear()
            self._cache.update((s, found[s]) for s in missing)
        return torch.stack([found[s] for s in sentences])


def _fingerprint(*modules: nn.Module) -> str:
    """Return twelve hexadecimal digits that another set of weights does not have."""
    digest = hashlib.sha256()
    for module in modules:
        for name, value in module.named_parameters():
            digest.update(f"{name}{tuple(value.shape)}".encode())
            digest.update(value.detach().flatten()[:_FINGERPRINT_VALUES].float().numpy().tobytes())
    return digest.hexdigest()[:12]
