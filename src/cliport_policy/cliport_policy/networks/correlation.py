"""Cross-correlation of query windows with a map in the frequency domain, a few windows at a time."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F

_AT_ONCE = 6  # windows of one entry whose spectra share a processor's cache: half the time and memory of all 36


def correlate(key: Tensor, window: Tensor, size: tuple[int, int]) -> Tensor:
    """key: (B, C, H, W); window: (B, R, C, q, q) -> (B, R, *size): index (i, j) has each window's first corner on
    cell (i, j) of the key. It wraps around at `size`, up to which both are padded with zeros."""
    spectra = torch.fft.rfft2(key, s=size).conj().resolve_conj().unsqueeze(1)  # (B, 1, C, ...)
    if key.is_cuda:
        return _scores(window, spectra, size)
    return torch.stack(
        [
            torch.cat([_scores(part, spectrum, size) for part in windows.split(_AT_ONCE)])
            for windows, spectrum in zip(window, spectra, strict=True)
        ]
    )


def _scores(windows: Tensor, spectrum: Tensor, size: tuple[int, int]) -> Tensor:
    """(..., R, C, q, q) and (..., 1, C, *size halved) -> (..., R, *size)."""
    # Along rows first, of which there are q: those that padding would add are zero.
    turned = torch.fft.fft(torch.fft.rfft(windows, n=size[1]), n=size[0], dim=-2)
    return torch.fft.irfft2((turned * spectrum).sum(-3).conj(), s=size)


def correlate_inside(key: Tensor, window: Tensor) -> Tensor:
    """key: (B, C, H, W); window: (B, R, C, q, q) -> (B, R, H - q + 1, W - q + 1), where no window leaves the map.

    The same as F.conv2d of the key with each window: a circular correlation wraps only where a window leaves the map.
    """
    height, width = key.shape[-2:]
    side = window.shape[-1]
    return correlate(key, window, (height, width))[..., : height - side + 1, : width - side + 1]


def correlate_centered(key: Tensor, window: Tensor) -> Tensor:
    """key: (B, C, H, W); window: (B, R, C, q, q) with q odd -> (B, R, H, W): the score of putting the window's
    centre on each cell; the map is zero outside."""
    height, width = key.shape[-2:]
    half = window.shape[-1] // 2
    padded = F.pad(key, (half, 0, half, 0))  # where a window on the far edge wraps around to
    size = (_fast_length(height + half), _fast_length(width + half))
    return correlate(padded, window, size)[..., :height, :width]


def _fast_length(n: int) -> int:
    """The next length that factors into 2, 3 and 5 only."""
    while True:
        m = n
        for p in (2, 3, 5):
            while m % p == 0:
                m //= p
        if m == 1:
            return n
        n += 1
