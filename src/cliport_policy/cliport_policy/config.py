"""Configuration of the network and of its training, as flat dataclasses checked when they are made."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from typing import Any

from cliport_policy.errors import ConfigError
from cliport_policy.settings import check_keys, check_types


@dataclass(frozen=True)
class NetworkConfig:
    """Shape of the compact network.

    widths: channels of the U-Net's levels, at 1/2, 1/4, 1/8 and 1/16 of the heightmap.
    token_dim: width of the frozen text encoder's token embeddings. goal_dim: width of one goal vector.
    transport_channels: features that are correlated. query_cells: side of the query window in cells of 2 pixels.
    crop_pixels: side of the rotator's crop. n_rotations: k of rotator and transport.
    """

    widths: tuple[int, ...] = (24, 40, 64, 96)
    token_dim: int = 384
    goal_dim: int = 128
    transport_channels: int = 4
    query_cells: int = 31
    crop_pixels: int = 64
    n_rotations: int = 36

    def __post_init__(self) -> None:
        check_types(self, "network")
        if len(self.widths) < 2 or min(self.widths) < 1:
            raise ConfigError(f"widths must hold at least two positive channel counts, not {self.widths}")
        if self.n_rotations < 1 or self.query_cells % 2 == 0 or self.crop_pixels % 8:
            raise ConfigError(
                f"n_rotations={self.n_rotations} must be positive, query_cells={self.query_cells} odd, "
                f"crop_pixels={self.crop_pixels} a multiple of 8"
            )

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> NetworkConfig:
        check_keys(values, (f.name for f in fields(cls)), "network")
        return cls(**{**values, "widths": tuple(values.get("widths", cls.widths))})


@dataclass(frozen=True)
class TrainConfig:
    """How a network is trained. Rotations are subsampled in training: the right one and others drawn at random."""

    steps: int = 6000
    batch_size: int = 16
    learning_rate: float = 2e-3
    weight_decay: float = 1e-4
    warmup_steps: int = 200
    ema_decay: float = 0.998
    gradient_clip: float = 1.0
    augment_probability: float = 0.6
    rotation_sigma_deg: float = 60.0
    translation_sigma_px: float = 26.67
    rotator_rotations: int = 12
    transport_rotations: int = 4
    phrases_per_goal: int = 200
    seed: int = 0

    def __post_init__(self) -> None:
        if self.steps < 1 or self.batch_size < 1 or self.learning_rate <= 0:
            raise ConfigError(
                f"steps={self.steps}, batch_size={self.batch_size} and "
                f"learning_rate={self.learning_rate} must be positive"
            )

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)
