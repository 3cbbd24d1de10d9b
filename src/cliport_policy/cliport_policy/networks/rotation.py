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


def straight_cells(side: int, device: torch.device | None = None) -> Tensor:
    """Return the offsets (side, side, 2), (column, row), of a window's cells from its centre, in cells."""
    line = torch.arange(side, device=device, dtype=torch.float32) - (side - 1) / 2
    v, u = torch.meshgrid(line, line, indexing="ij")  # rows, columns
    return torch.stack((u, v), dim=-1)


def window_offsets(side: int, angles: Tensor) -> Tensor:
    """Return the offsets of a side x side window's cells when the window is turned by each angle.

    angles: (..., R) rad -> (..., R, side, side, 2) offsets (column, row) from the window's centre, in cells.
    """
    u, v = straight_cells(side, angles.device).unbind(-1)
    cos = torch.cos(angles)[..., None, None]
    sin = torch.sin(angles)[..., None, None]
    return torch.stack((u * cos - v * sin, u * sin + v * cos), dim=-1)


def rotated_windows(maps: Tensor, centers: Tensor, angles: Tensor, side: int, cells: Tensor | None = None) -> Tensor:
    """Cut windows of the maps, turned by each angle about each centre; zero outside the map.

    maps: (B, C, H, W); centers: (B, 2), or (B, R, 2) one for each angle, float (row, col) in cells; angles: (B, R) rad
    -> (B, R, C, side, side). A window turned by the yaw of an object shows that object unrotated.
    cells: (B, side, side, 2), offsets of a window's cells that is not turned, a straight grid's where there are none.
    """
    batch, channels, height, width = maps.shape
    n = angles.shape[1]
    size = torch.tensor((2 / width, 2 / height), device=maps.device)  # of a cell, where a map is 2 wide and 2 high
    each = centers if centers.dim() == 3 else centers[:, None]
    middles = ((each.flip(-1) + 0.5) * size - 1)[:, :, None, None]  # (B, R or 1, 1, 1, 2)
    cos, sin = torch.cos(angles), torch.sin(angles)
    along_u, along_v = (torch.stack(turned, -1)[:, :, None, None] * size for turned in ((cos, sin), (-sin, cos)))
    u, v = (straight_cells(side, maps.device) if cells is None else cells[:, None]).split(1, -1)
    grid = torch.addcmul(torch.addcmul(middles, u, along_u), v, along_v)  # (B, R, side, side, 2)
    grid = grid.to(maps.dtype)
    if batch == 1 and not maps.requires_grad:  # a window an entry: those are sampled on all cores
        return _sampled(maps.expand(n, -1, -1, -1), grid[0])[None]
    windows = _sampled(maps, grid.reshape(batch, n * side, side, 2))  # (B, C, R * side, side)
    return windows.reshape(batch, channels, n, side, side).transpose(1, 2)


def _sampled(maps: Tensor, grid: Tensor) -> Tensor:
    return F.grid_sample(maps, grid, mode="bilinear", padding_mode="zeros", align_corners=False)
