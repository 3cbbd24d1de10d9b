"""Networks by name, one YAML file each in configs/, and the network entry of a checkpoint's card."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from cliport_policy.config import NetworkConfig
from cliport_policy.errors import ConfigError
from cliport_policy.joint_config import JointConfig
from cliport_policy.settings import check_choice, did_you_mean
from cliport_policy.stream_config import StreamsConfig

_EXTENDS = "extends"  # a file's key that names the shipped config whose settings it changes
FOLDER = Path(__file__).parent / "configs"
AnyNetworkConfig = NetworkConfig | StreamsConfig | JointConfig


def config_names() -> list[str]:
    """Return the names of the shipped network configs."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def load_network_config(name_or_path: str | Path, changes: Mapping[str, Any] | None = None) -> AnyNetworkConfig:
    """Read a network's config by its shipped name or from a YAML file, and change settings by dotted name.

    `load_network_config("cliport", {"pick.language": "film", "rotator": "pick"})`: a net is given by its settings or as
    another net's name, whose settings it copies.

    Raises:
        ConfigError: with the nearest valid name, for an unknown name, setting or value.
    """
    values = _read(name_or_path)
    for dotted, value in (changes or {}).items():
        *parents, last = dotted.split(".")
        level: Any = values
        for parent in parents:
            level = level.get(parent)
            if not isinstance(level, dict):
                raise ConfigError(f"unknown network setting '{dotted}': {did_you_mean(dotted, _dotted(values))}")
        level[last] = value
    return network_config_from_dict(values)


def network_config_from_dict(values: Mapping[str, Any]) -> AnyNetworkConfig:
    """Return the config of a mapping whose `kind` is `compact` (the default), `joint` or `streams`.

    Raises:
        ConfigError: for an unknown kind, setting or value.
    """
    rest = dict(values)
    kind = rest.pop("kind", "compact")
    check_choice(kind, ("compact", "joint", "streams"), "kind")
    if kind == "joint":
        return JointConfig.from_dict(rest)
    return StreamsConfig.from_dict(rest) if kind == "streams" else NetworkConfig.from_dict(rest)


def _read(name_or_path: str | Path) -> dict[str, Any]:
    path = FOLDER / f"{name_or_path}.yaml"
    if not path.is_file():
        path = Path(name_or_path).expanduser()
    if not path.is_file():
        raise ConfigError(
            f"no network config '{name_or_path}': {did_you_mean(name_or_path, config_names())}, or give a YAML file"
        )
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} is no YAML ({' '.join(str(error).split())[:120]})") from None
    if not isinstance(values, dict):
        raise ConfigError(f"{path} must hold a mapping of network settings")
    base = values.pop(_EXTENDS, None)
    if base is not None:
        if base not in config_names() or base == path.stem:
            raise ConfigError(f"{path} extends no network '{base}': {did_you_mean(str(base), config_names())}")
        values = _read(base) | values
    # Two nets may be one mapping in the file (a YAML alias) and must not be one when a setting is changed.
    return {name: dict(value) if isinstance(value, dict) else value for name, value in values.items()}


def _dotted(values: Mapping[str, Any]) -> list[str]:
    names = list(values)
    for name, inner in values.items():
        if isinstance(inner, dict):
            names += [f"{name}.{key}" for key in inner]
    return names
