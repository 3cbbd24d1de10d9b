"""Cross-correlation of query windows with a padded map, where no window leaves the map."""

from __future__ import annotations

import torch
from torch import Tensor


def correlate_inside(key: Tensor, window: Tensor) -> Tensor:
    """key: (B, C, H, W); window: (B, R, C, q, q) -> (B, R, H - q + 1, W - q + 1), in the frequency domain.

    The same as F.conv2d of the key with each window: a circular correlation wraps only where a window leaves the map.
    """
    height, width = key.shape[-2:]
    side = window.shape[-1]
    spectrum = torch.fft.rfft2(key).unsqueeze(1) * torch.fft.rfft2(window, s=(height, width)).conj()
    scores = torch.fft.irfft2(spectrum.sum(2), s=(height, width))  # (B, R, H, W) of the window's first corner
    return scores[..., : height - side + 1, : width - side + 1]
