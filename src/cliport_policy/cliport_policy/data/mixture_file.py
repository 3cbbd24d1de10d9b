"""Mixtures as YAML files: which data sets a training draws from, how often, and how it may change their scenes."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from cliport_policy.data.mixture import SourceSettings
from cliport_policy.errors import ConfigError
from cliport_policy.settings import check_keys, did_you_mean

FOLDER = Path(__file__).parent.parent / "mixtures"
_SWITCHES = tuple(field.name for field in fields(SourceSettings))


class SourceEntry(NamedTuple):
    """Data set of a mixture: its folder, its weight relative to the others', and what may be done to its scenes."""

    folder: Path
    weight: float
    settings: SourceSettings


def mixture_names() -> list[str]:
    """Return the names of the shipped mixtures."""
    return sorted(path.stem for path in FOLDER.glob("*.yaml"))


def read_mixture(name_or_path: str, root: Path) -> tuple[SourceEntry, ...]:
    """Read a mixture by its shipped name or from a file; its data sets lie in the folder `root`.

    Raises:
        ConfigError: in one line, for a file that is no mixture, an unknown setting or a value that can't be.
    """
    path = FOLDER / f"{name_or_path}.yaml"
    if not path.is_file():
        path = Path(name_or_path).expanduser()
    if not path.is_file():
        near = did_you_mean(name_or_path, mixture_names())
        raise ConfigError(f"no mixture '{name_or_path}': {near}, or give a YAML file")
    try:
        values = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} is no YAML ({' '.join(str(error).split())[:120]})") from None
    if not isinstance(values, dict) or not isinstance(values.get("sources"), list) or not values["sources"]:
        raise ConfigError(f"{path} must hold a list `sources` of data sets")
    check_keys(values, ("sources",), "mixture")
    return tuple(_entry(entry, root, path) for entry in values["sources"])


def _entry(entry: Any, root: Path, path: Path) -> SourceEntry:
    if not isinstance(entry, dict) or not isinstance(entry.get("data"), str):
        raise ConfigError(f"a source of {path} must hold `data`, a folder's name, not {entry!r}")
    check_keys(entry, ("data", "weight", *_SWITCHES), "source")
    weight = entry.get("weight", 1.0)
    if isinstance(weight, bool) or not isinstance(weight, (int, float)) or not weight > 0:
        raise ConfigError(f"the weight of {entry['data']} in {path} is {weight!r}: give a positive number")
    switches = {name: entry[name] for name in _SWITCHES if name in entry}
    for name, value in switches.items():
        if not isinstance(value, bool):
            raise ConfigError(f"{name} of {entry['data']} in {path} is {value!r}: give true or false")
    return SourceEntry(root / entry["data"], float(weight), SourceSettings(**switches))
