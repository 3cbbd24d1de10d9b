"""Command line of `train`, as checked values."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from cliport_core.command_line import CommandParser
from cliport_policy.config import RECIPES, TrainConfig
from cliport_policy.data.demonstrations import CACHE_BYTES
from cliport_policy.data.mixture import SourceSettings
from cliport_policy.data.mixture_file import SourceEntry, mixture_names, read_mixture
from cliport_policy.errors import ConfigError
from cliport_policy.joint_config import REREAD, JointConfig
from cliport_policy.named_configs import AnyNetworkConfig, config_names, load_network_config
from cliport_policy.settings import check_keys

if TYPE_CHECKING:
    from cliport_policy.training.initial import Initial

DEFAULT_CONFIG = "compact"
_DEVICES = ("auto", "cpu", "cuda")
_TRAIN = "train."


@dataclass(frozen=True)
class TrainOptions:
    """Options of a training.

    config_name: stem of the network's config, "" with --init, where the checkpoint's card knows it.
    data: folders with their weights and settings; n_demos: number of episodes of each task.
    initial: the checkpoint to begin with; None: random weights.
    """

    config_name: str
    network: AnyNetworkConfig
    initial: Initial | None
    train: TrainConfig
    data: tuple[SourceEntry, ...]
    n_demos: int | None
    val: Path | None
    out: Path
    device: str
    save_minutes: float
    max_minutes: float
    keep_steps: frozenset[int]
    cache_bytes: int


def parse_options(argv: Sequence[str] | None) -> TrainOptions:
    """Parse the command line. With --init the network's config is the checkpoint's.

    Raises:
        ConfigError: in one line with the nearest valid name, for a setting that can't be.
        CheckpointError: if --init names no checkpoint.
    """
    args = _parser().parse_args(argv)
    changes = dict(_setting(text) for text in args.set)
    network = {name: value for name, value in changes.items() if not name.startswith(_TRAIN)}
    initial = _initial(args.init)
    return TrainOptions(
        config_name="" if initial is not None else Path(args.config or DEFAULT_CONFIG).stem,
        network=_network_config(args.config, network, initial),
        initial=initial,
        train=_train_config(args, {n.removeprefix(_TRAIN): v for n, v in changes.items() if n not in network}),
        data=_sources(args.data, args.mixture),
        n_demos=_at_least("--n-demos", args.n_demos, 1),
        val=None if args.val is None else Path(args.val),
        out=Path(args.out),
        device=args.device,
        save_minutes=_finite("--save-minutes", args.save_minutes),
        max_minutes=math.inf if args.minutes == math.inf else _finite("--minutes", args.minutes),
        keep_steps=_steps(args.keep_steps),
        cache_bytes=int(_finite("--cache-gb", args.cache_gb) * 2**30),
    )


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(
        prog="train", description="Train a policy on demonstrations; run again with the same --out, it resumes."
    )
    add = parser.add_argument
    add("--config", help=f"network: one of {', '.join(config_names())} (default {DEFAULT_CONFIG}), or a YAML file")
    add("--init", metavar="CHECKPOINT", help="begin with its weights and config: a file, a folder or a shipped name")
    add(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="a setting: pick.language=film, train.jitter=false",
    )
    add("--data", action="append", required=True, metavar="DIR[:WEIGHT]", help="data set; several are mixed by weight")
    add(
        "--mixture",
        metavar="NAME",
        help=f"{', '.join(mixture_names())} or a YAML file that lists data sets in the one folder --data",
    )
    add("--n-demos", type=int, metavar="N", help="only the first N episodes of each task of each data set")
    add(
        "--val",
        metavar="DIR",
        help="held-out data set to picture, and to measure agreement on: at each kept step and at the end",
    )
    add("--out", required=True, metavar="DIR", help="training folder")
    add(
        "--optimizer",
        choices=sorted(RECIPES),
        help="recipe, by default ours, or fine_tune with --init; what follows changes single values of it",
    )
    add("--steps", type=int)
    add("--batch", type=int, dest="batch_size", help="samples of a step, in all processes together")
    add("--accumulate", type=int, help="parts that a process handles its share of a step in, to save memory")
    add("--learning-rate", type=float)
    add("--phrases", type=int, dest="phrases_per_goal", help="wordings a canonical sentence is trained with")
    add("--seed", type=int)
    add("--device", choices=_DEVICES, default="auto")
    add("--save-minutes", type=float, default=3.0, help="between saves")
    add("--minutes", type=float, default=math.inf, help="stop (and save) after so long")
    add("--keep-steps", default="", metavar="N,N,...", help="steps whose policies are kept in OUT/checkpoints")
    add(
        "--cache-gb",
        type=float,
        default=CACHE_BYTES / 2**30,
        help="memory for encoded observations, of each process that makes batches",
    )
    return parser


def _initial(name: str | None) -> Initial | None:
    if name is None:
        return None
    from cliport_policy.training.initial import load_initial  # brings torch, for which other options need not wait

    return load_initial(name)


def _network_config(name: str | None, changes: dict[str, Any], initial: Initial | None) -> AnyNetworkConfig:
    if initial is None:
        return load_network_config(name or DEFAULT_CONFIG, changes)
    network = initial.card.network
    if name is None and isinstance(network, JointConfig):
        given = JointConfig.from_dict({**asdict(network), **changes})
        initial.check_network(replace(given, **{setting: getattr(network, setting) for setting in REREAD}))
        return given
    if name is not None or changes:
        initial.check_network(load_network_config(name or DEFAULT_CONFIG, changes))
    return network


def _train_config(args: argparse.Namespace, changes: dict[str, Any]) -> TrainConfig:
    names = [field.name for field in fields(TrainConfig)]
    check_keys(changes, names, "training")
    given = {name: getattr(args, name) for name in names if getattr(args, name, None) is not None}
    recipe = args.optimizer or ("ours" if args.init is None else "fine_tune")
    return replace(RECIPES[recipe], **given, **{k: v for k, v in changes.items() if k not in given})


def _setting(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals or not name:
        raise ConfigError(f"--set {text}: write KEY=VALUE, as in pick.language=film")
    try:
        return name, yaml.safe_load(value)
    except yaml.YAMLError:
        raise ConfigError(f"--set {text}: the value is no YAML") from None


def _sources(data: Sequence[str], mixture: str | None) -> tuple[SourceEntry, ...]:
    if mixture is None:
        return tuple(_weighted(text) for text in data)
    if len(data) != 1:
        raise ConfigError(f"--mixture {mixture} needs one --data, the folder of its data sets, not {len(data)}")
    return read_mixture(mixture, Path(data[0]))


def _weighted(text: str) -> SourceEntry:
    folder, colon, weight = text.rpartition(":")
    try:
        folder, number = (folder, float(weight)) if colon else (text, 1.0)
    except ValueError:
        folder, number = text, 1.0
    return SourceEntry(Path(folder), number, SourceSettings())


def _steps(text: str) -> frozenset[int]:
    try:
        return frozenset(int(part) for part in text.split(",") if part.strip())
    except ValueError:
        raise ConfigError(f"--keep-steps {text}: write whole numbers with commas, as in 1000,2000") from None


def _at_least(option: str, value: int | None, least: int) -> int | None:
    if value is not None and value < least:
        raise ConfigError(f"{option} must be {least} or more, not {value}")
    return value


def _finite(option: str, value: float) -> float:
    if not 0.0 <= value < math.inf:
        raise ConfigError(f"{option} must be a finite number of 0 or more, not {value}")
    return value
