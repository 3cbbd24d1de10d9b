"""Settings read from people: unknown names and values end in one line that shows the nearest valid one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from difflib import get_close_matches
from typing import Any

from cliport_policy.errors import ConfigError

TOKEN_DIM = 384  # width of the frozen text encoder's token embeddings
GOAL_HEADS = 4  # of the attention that reads the goal from them


def did_you_mean(name: object, valid: Iterable[str]) -> str:
    """Return `did you mean 'x'? Known are a, b, x`, or without the question if nothing is near."""
    names = sorted(valid)
    near = get_close_matches(str(name), names, 1, cutoff=0.5)
    known = f"known are {', '.join(names)}"
    return f"did you mean '{near[0]}'? {known.capitalize()}" if near else known


def check_keys(values: Mapping[str, Any], valid: Iterable[str], where: str) -> None:
    """Raise ConfigError if a key is not one of the valid ones."""
    valid = list(valid)
    for key in values:
        if key not in valid:
            raise ConfigError(f"unknown {where} setting '{key}': {did_you_mean(key, valid)}")


def check_choice(value: object, valid: Iterable[str], where: str) -> None:
    """Raise ConfigError if a value is not one of the valid names."""
    valid = list(valid)
    if value not in valid:
        raise ConfigError(f"{where} can't be '{value}': {did_you_mean(value, valid)}")


def check_least(name: str, value: float, least: float) -> None:
    """Raise ConfigError if an option's value is below the least that it can be, or is no number."""
    if not value >= least:
        raise ConfigError(f"{name} is {value}: give {least} or more")


def check_types(config: Any, where: str) -> None:
    """Raise ConfigError if a plain field (bool, int, float, str) of a dataclass holds another type."""
    kinds: dict[str, tuple[type, ...]] = {"bool": (bool,), "int": (int,), "float": (int, float), "str": (str,)}
    for field in fields(config):
        value, kind = getattr(config, field.name), str(field.type)
        wrong = kind in kinds and (not isinstance(value, kinds[kind]) or (kind != "bool" and isinstance(value, bool)))
        if wrong:
            raise ConfigError(f"{where} setting '{field.name}' must be a {kind}, not {value!r}")


def channel_counts(value: Any) -> tuple[int, ...]:
    """Return the setting `widths` as a tuple.

    Raises:
        ConfigError: if it is no list of at least two positive whole numbers.
    """
    listed = isinstance(value, (list, tuple)) and all(type(count) is int for count in value)
    if not listed or len(value) < 2 or min(value) < 1:
        raise ConfigError(f"widths must hold at least two positive channel counts, as in [24, 40], not {value!r}")
    return tuple(value)


def check_common_shape(config: Any) -> None:
    """Raise ConfigError if a setting that the compact and the joint network share cannot work."""
    for name in ("goal_dim", "transport_channels", "query_cells", "crop_pixels", "n_rotations"):
        if getattr(config, name) < 1:
            raise ConfigError(f"{name}={getattr(config, name)} must be positive")
    if config.token_dim != TOKEN_DIM:
        raise ConfigError(f"token_dim={config.token_dim} must be the text encoder's {TOKEN_DIM}")
    if config.goal_dim % GOAL_HEADS:
        raise ConfigError(f"goal_dim={config.goal_dim} must be a multiple of {GOAL_HEADS}, the reader's heads")
    if config.query_cells % 2 == 0 or config.crop_pixels % 8:
        raise ConfigError(
            f"query_cells={config.query_cells} must be odd, crop_pixels={config.crop_pixels} a multiple of 8"
        )
