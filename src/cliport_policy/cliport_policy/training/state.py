"""State of a training, complete enough to resume from, in one file of tensors: no pickle."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from cliport_policy.errors import DataError
from cliport_policy.whole_files import whole_file, write_json

_NAME = "training_state.safetensors"
_CONFIG_NAME = "training_config.json"
_BEFORE = {  # what earlier versions did, which had no such settings
    "train.absent_share": 0.0,
    "train.strange_share": 0.0,
    "train.mirror_probability": 0.0,
    "train.stretch_sigma": 0.0,
    "train.bend_sigma_px": 0.0,
    "network.aligner": False,
    "network.mask": True,
}


def save_state(
    folder: Path, parts: Mapping[str, nn.Module], optimizer: torch.optim.Optimizer, step: int, identity: dict[str, Any]
) -> None:
    """Write modules, optimiser and step; the previous state stays if that fails.

    identity: the settings, which a training that resumes must share.

    Raises:
        CheckpointError: if the state can't be written.
    """
    state = {f"{part}.{name}": value for part, module in parts.items() for name, value in module.state_dict().items()}
    for index, slot in optimizer.state_dict()["state"].items():
        state |= {f"optimizer.{index}.{name}": torch.as_tensor(value) for name, value in slot.items()}
    state["step"] = torch.tensor(step)
    write_json(folder / _CONFIG_NAME, identity)
    with whole_file(folder / _NAME) as temporary:
        save_file({name: value.detach().cpu().contiguous() for name, value in state.items()}, temporary)


def resume_state(
    folder: Path, parts: Mapping[str, nn.Module], optimizer: torch.optim.Optimizer, identity: dict[str, Any]
) -> int:
    """Restore modules and optimiser from a folder; return the step, 0 if nothing was begun there.

    Raises:
        DataError: if the folder has other settings (but for the number of steps) or is damaged.
    """
    if not (folder / _NAME).is_file():
        return 0
    try:
        _check_settings(json.loads((folder / _CONFIG_NAME).read_text()), identity)
        state = load_file(folder / _NAME)
        for part, module in parts.items():
            module.load_state_dict(_strip_prefix(state, f"{part}."))
        slots: dict[int, dict[str, Tensor]] = {}
        for name, value in _strip_prefix(state, "optimizer.").items():
            index, key = name.split(".", 1)
            slots.setdefault(int(index), {})[key] = value
        optimizer.load_state_dict({"state": slots, "param_groups": optimizer.state_dict()["param_groups"]})
        return int(state["step"])
    except Exception as error:
        raise DataError(
            f"{folder} can't be resumed with these settings ({' '.join(str(error).split())[:160]}): "
            "give another --out or the settings it was begun with"
        ) from error


def _check_settings(begun: dict[str, Any], given: dict[str, Any]) -> None:
    was, now = _flatten(begun), _flatten(json.loads(json.dumps(given)))
    was.setdefault("primitive", now.get("primitive"))  # earlier versions did not write it down
    for name in now.keys() & _BEFORE.keys():
        was.setdefault(name, _BEFORE[name])
    if was.get("train.turn_weight") == 0.0:
        del was["train.turn_weight"]  # a setting that is gone, where it did nothing
    for name in sorted(was.keys() | now.keys()):
        if name != "train.steps" and was.get(name) != now.get(name):
            raise ValueError(f"{name} was {was.get(name)!r}, not {now.get(name)!r}")


def _flatten(values: Any, name: str = "") -> dict[str, Any]:
    if not isinstance(values, dict):
        return {name: values}
    found: dict[str, Any] = {}
    for key, value in values.items():
        found |= _flatten(value, f"{name}.{key}" if name else str(key))
    return found


def _strip_prefix(state: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name[len(prefix) :]: value for name, value in state.items() if name.startswith(prefix)}
