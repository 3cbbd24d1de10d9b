"""Crops and windows turned about a pixel. Yaw is about the base frame's +z: from +x (columns) towards +y (rows)."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as F


def bin_angles(n_rotations: int, device: torch.device | None = None) -> Tensor:
    """Return the angles of the rotation bins: (k,) rad, bin i at i * 2 pi / k."""
    return torch.arange(n_rotations, device=device) * (2 * math.pi / n_rotations)


def are_opposite_pairs(angles: Tensor) -> bool:
    """Return True if the second half of angles (..., R) rad is the first plus half a turn, as even bins are."""
    half, odd = divmod(angles.shape[-1], 2)
    return not odd and bool(((angles[..., half:] - angles[..., :half]).abs() - math.pi).abs().max() < 1e-4)


def window_offsets(side: int, angles: Tensor, stretch: Tensor | None = None) -> Tensor:
    """Return the offsets of a side x side window's cells when the window is turned by each angle.

    angles: (..., R) rad -> (..., R, side, side, 2) offsets (column, row) from the window's centre, in cells.
    stretch: (..., 2, 2) matrices by which offsets are multiplied before they are turned.
    """
    line = torch.arange(side, device=angles.device, dtype=torch.float32) - (side - 1) / 2
    v, u = torch.meshgrid(line, line, indexing="ij")  # rows, columns
    if stretch is not None:
        u, v = (torch.stack((u, v), dim=-1) @ stretch[..., None, :, :].mT).unbind(-1)  # (..., side, side)
        u, v = u[..., None, :, :], v[..., None, :, :]
    cos = torch.cos(angles)[..., None, None]
    sin = torch.sin(angles)[..., None, None]
    return torch.stack((u * cos - v * sin, u * sin + v * cos), dim=-1)


def rotated_windows(maps: Tensor, centers: Tensor, angles: Tensor, side: int, stretch: Tensor | None = None) -> Tensor:
    """Cut windows of the maps, turned by each angle about each centre; zero outside the map.

    maps: (B, C, H, W); centers: (B, 2), or (B, R, 2) one for each angle, float (row, col) in cells; angles: (B, R) rad
    -> (B, R, C, side, side). A window turned by the yaw of an object shows that object unrotated.
    stretch: (B, 2, 2) matrices that offsets (column, row) in a turned window are multiplied by before it is cut.
    """
    batch, channels, height, width = maps.shape
    n = angles.shape[1]
    offsets = window_offsets(side, angles, stretch)  # (B, R, side, side, 2)
    each = centers if centers.dim() == 3 else centers[:, None]
    col = each[..., 1, None, None] + offsets[..., 0]
    row = each[..., 0, None, None] + offsets[..., 1]
    grid = torch.stack(((2 * col + 1) / width - 1, (2 * row + 1) / height - 1), dim=-1)
    windows = F.grid_sample(
        maps,
        grid.reshape(batch, n * side, side, 2).to(maps.dtype),
        mode="bilinear",
        padding_mode="zeros",
        align_corners=False,
    )  # (B, C, R * side, side)
    return windows.reshape(batch, channels, n, side, side).transpose(1, 2)
