"""Cross-correlation of query windows with a map in the frequency domain, a few windows at a time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable
from torch.nn import functional as F

# Windows of one entry whose spectra fit a processor's cache: half the time and memory of all 36 together.
_WINDOWS_PER_CHUNK = 6


def correlate_inside(key: Tensor, window: Tensor) -> Tensor:
    """Correlate a key (B, C, H, W) with windows (B, R, C, q, q) that do not leave it: (B, R, H - q + 1, W - q + 1).

    This is F.conv2d of the key with each window: a circular correlation wraps only where a window leaves the map.
    """
    height, width = key.shape[-2:]
    side = window.shape[-1]
    return _Correlation.apply(key, window, (height, width), (height - side + 1, width - side + 1), False)


def correlate_centered(key: Tensor, window: Tensor, half_turns: bool = False) -> Tensor:
    """Score each cell of a key (B, C, H, W) as the centre of windows (B, R, C, q, q), q odd: (B, R, H, W).

    The key is zero outside. half_turns: the scores are (B, 2 R, H, W), of the windows, then of the windows turned by
    half a turn, which have the same spectra, conjugated.
    """
    height, width = key.shape[-2:]
    half = window.shape[-1] // 2
    padded = F.pad(key, (half, 0, half, 0))  # a window on the far edge wraps around to this margin
    size = (_fast_length(height + half), _fast_length(width + half))
    return _Correlation.apply(padded, window, size, (height, width), half_turns)


class _Correlation(torch.autograd.Function):
    """Circular correlation of a key (B, C, H, W) with windows (B, R, C, q, q), and its gradient: (B, R, *shape).

    Index (i, j) has each window's first corner on cell (i, j) of the key. It wraps around at `size`, up to which both
    are padded with zeros. With half_turns the result is (B, 2 R, *shape).
    Spectra are made again for the gradient: that is quicker than to fetch them from memory.
    """

    @staticmethod
    def forward(
        ctx: Any, key: Tensor, window: Tensor, size: tuple[int, int], shape: tuple[int, int], half_turns: bool
    ) -> Tensor:
        """Return the scores."""
        ctx.save_for_backward(key, window)
        ctx.size, ctx.half_turns = size, half_turns
        count = window.shape[1]
        scores = key.new_empty((len(key), count * (1 + half_turns), *shape))
        spectra = torch.fft.rfft2(key, s=size)  # (B, C, ...)
        ahead = _conjugate(spectra)
        behind = spectra * _shift(window.shape[-1] - 1, size, spectra) if half_turns else None
        for entry, turns in _chunks(window):
            windows = _window_spectra(window[entry, turns], size)
            total = _sum_of_channels(windows, ahead[entry]).conj()
            scores[entry, turns] = torch.fft.irfft2(total, s=size)[..., : shape[0], : shape[1]]
            if behind is not None:
                total = _sum_of_channels(windows, behind[entry])
                opposite = slice(count + turns.start, count + turns.stop)
                scores[entry, opposite] = torch.fft.irfft2(total, s=size)[..., : shape[0], : shape[1]]
        return scores

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, Tensor, None, None, None]:
        (gradient,) = gradients
        key, window = ctx.saved_tensors
        size, count, side = ctx.size, window.shape[1], window.shape[-1]
        spectra = torch.fft.rfft2(key, s=size)
        shift = _shift(side - 1, size, spectra)
        behind = _conjugate(spectra * shift) if ctx.half_turns else None
        window_gradient = torch.empty_like(window)
        ahead_total, behind_total = torch.zeros_like(spectra), torch.zeros_like(spectra)
        for entry, turns in _chunks(window):
            windows = _window_spectra(window[entry, turns], size)
            ahead = torch.fft.rfft2(gradient[entry, turns], s=size).unsqueeze(2)  # (B, R, 1, ...)
            _add_turns(ahead_total[entry], windows, ahead)
            window_spectra = _conjugate(ahead) * spectra[entry].unsqueeze(1)
            if behind is not None:
                opposite = slice(count + turns.start, count + turns.stop)
                turned = torch.fft.rfft2(gradient[entry, opposite], s=size).unsqueeze(2)
                _add_turns(behind_total[entry], windows, _conjugate(turned))
                window_spectra.addcmul_(turned, behind[entry].unsqueeze(1))
            rows = torch.fft.ifft(window_spectra, dim=-2)[..., :side, :]
            window_gradient[entry, turns] = torch.fft.irfft(rows, n=size[1])[..., :side]
        if ctx.half_turns:
            ahead_total += _conjugate(behind_total * shift)
        key_gradient = torch.fft.irfft2(ahead_total, s=size)[..., : key.shape[-2], : key.shape[-1]]
        return key_gradient, window_gradient, None, None, None


def _chunks(window: Tensor) -> Iterator[tuple[slice, slice]]:
    """Yield the slices of (B, R, ...) that are handled together: all of it, or on a CPU what fits its cache."""
    batch, count = window.shape[:2]
    if window.is_cuda:
        yield slice(0, batch), slice(0, count)
        return
    for entry in range(batch):
        for first in range(0, count, _WINDOWS_PER_CHUNK):
            yield slice(entry, entry + 1), slice(first, min(first + _WINDOWS_PER_CHUNK, count))


def _window_spectra(windows: Tensor, size: tuple[int, int]) -> Tensor:
    """Return the spectra (..., *size halved) of windows (..., q, q)."""
    # Rows first: only q of them are not zero before padding.
    return torch.fft.fft(torch.fft.rfft(windows, n=size[1]), n=size[0], dim=-2)


def _sum_of_channels(windows: Tensor, spectra: Tensor) -> Tensor:
    """Multiply (B, R, C, ...) by (B, C, ...) and sum over the channels: (B, R, ...)."""
    total = windows[:, :, 0] * spectra[:, None, 0]
    for channel in range(1, windows.shape[2]):
        total.addcmul_(windows[:, :, channel], spectra[:, None, channel])
    return total


def _add_turns(total: Tensor, windows: Tensor, scores: Tensor) -> None:
    """Add (B, R, C, ...) times (B, R, 1, ...) to (B, C, ...)."""
    for turn in range(windows.shape[1]):
        total.addcmul_(windows[:, turn], scores[:, turn])


def _conjugate(spectra: Tensor) -> Tensor:
    return spectra.conj().resolve_conj()


def _shift(cells: int, size: tuple[int, int], like: Tensor) -> Tensor:
    """Return the factors of a spectrum, (*size halved), that move a map up and left by a number of cells."""
    rows = torch.fft.fftfreq(size[0], device=like.device, dtype=like.real.dtype)
    cols = torch.fft.rfftfreq(size[1], device=like.device, dtype=like.real.dtype)
    phase = 2 * math.pi * cells * (rows[:, None] + cols)
    return torch.polar(torch.ones_like(phase), phase)


def _fast_length(n: int) -> int:
    """Return the next length that factors into 2, 3 and 5 only."""
    while True:
        m = n
        for p in (2, 3, 5):
            while m % p == 0:
                m //= p
        if m == 1:
            return n
        n += 1
