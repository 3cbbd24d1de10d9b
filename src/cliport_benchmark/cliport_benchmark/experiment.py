"""One experiment in the paper's four phases: generate, train, choose a checkpoint on val, score on test (seed, B)."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.json_files import differences, read_json, write_json
from cliport_policy.data.dataset_format import META_NAME
from cliport_policy.named_configs import load_network_config
from sim_bridge.tasks import make_task

RESULT_NAME = "experiment.json"


@dataclass(frozen=True)
class Experiment:
    """What is learned from how much, and what it is scored on.

    config: a network's name or YAML file; settings: changes to it, as train's --set takes them. keep_steps: the
    steps whose checkpoints compete on val. also_test: tasks beside its own that the chosen one is scored on.

    Raises:
        OptionError: on numbers that make no experiment.
        UnknownNameError: on an unknown task; ConfigError: on an unknown config.
    """

    task: str
    config: str
    n_demos: int
    steps: int
    keep_steps: tuple[int, ...]
    val_episodes: int = 100
    test_episodes: int = 100
    also_test: tuple[str, ...] = ()
    settings: tuple[str, ...] = ()
    train_options: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in (self.task, *self.also_test):
            make_task(name, "test")
        load_network_config(self.config)
        for option in ("n_demos", "steps", "val_episodes", "test_episodes"):
            if getattr(self, option) < 1:
                raise OptionError(f"--{option.replace('_', '-')} must be 1 or more, got {getattr(self, option)}")
        wrong = [step for step in self.keep_steps if not 0 < step <= self.steps]
        if wrong or not self.keep_steps:
            raise OptionError(f"--keep-steps must be within 1 and --steps {self.steps}, got {list(self.keep_steps)}")

    @property
    def method(self) -> str:
        """The network as a folder and a table call it."""
        return "+".join([Path(self.config).stem, *(text.replace("/", "_") for text in self.settings)])

    @property
    def folder(self) -> Path:
        """Where it lies within the folder of all experiments."""
        return Path(self.task) / self.method / f"{self.n_demos}-demos"


def run_experiment(experiment: Experiment, out: Path, data: Path, processes: int, say: Callable[[str], None]) -> Path:
    """Do what is left of an experiment; the path of its result. data: demonstrations, as make_data leaves them.

    Each phase is a command of its own, said before it begins, and leaves files that are not made again.

    Raises:
        BenchmarkError: when a command fails, or the folder holds another experiment.
    """
    folder = out / experiment.folder
    identity = asdict(experiment)
    begun = folder / "settings.json"
    if begun.exists():
        differing = differences(read_json(begun), identity)
        if differing:
            raise OptionError(f"{folder} holds an experiment of other settings ({differing}); choose another --out")
    else:
        write_json(begun, identity)
    _train(experiment, folder / "train", data, say)
    steps = sorted(experiment.keep_steps)
    val = [
        _score(experiment.task, "val", experiment.val_episodes, _checkpoint(folder, step), out_file, processes, say)
        for step in steps
        for out_file in [folder / "val" / f"step-{step:07d}.json"]
    ]
    chosen = choose(steps, [_mean(result) for result in val])
    checkpoint = _checkpoint(folder, chosen)
    tests = {
        task: _score(
            task, "test", experiment.test_episodes, checkpoint, folder / "test" / f"{task}.json", processes, say
        )
        for task in (experiment.task, *experiment.also_test)
    }
    result = {
        **identity,
        "method": experiment.method,
        "val": {str(step): _mean(value) for step, value in zip(steps, val, strict=True)},
        "chosen_step": chosen,
        "checkpoint": str(checkpoint),
        "commit": tests[experiment.task]["commit"],
        "test": {
            task: {name: value[name] for name in ("mean_score", "chance", "n_episodes", "command")}
            for task, value in tests.items()
        },
    }
    write_json(folder / RESULT_NAME, result)
    return folder / RESULT_NAME


def choose(steps: Sequence[int], scores: Sequence[float]) -> int:
    """The step whose checkpoint scores highest on val; of several, the first."""
    return steps[max(range(len(steps)), key=lambda i: scores[i])]


def make_data(task: str, episodes: int, out: Path, processes: int, say: Callable[[str], None]) -> Path:
    """The folder with at least so many training demonstrations of a task, made unless it is there."""
    folders = (out / "data" / task).glob("*/" + META_NAME)
    made = [int(meta.parent.name) for meta in folders if meta.parent.name.isdecimal()]
    whole = min((n for n in made if n >= episodes), default=episodes)
    folder = out / "data" / task / str(whole)
    _run(
        "cliport_benchmark.generate_cli",
        ["--task", task, "--split", "train", "--episodes", str(whole), "--processes", str(processes)],
        folder,
        say,
    )
    return folder


def _train(experiment: Experiment, folder: Path, data: Path, say: Callable[[str], None]) -> None:
    if not _missing(experiment, folder):
        return
    options = ["--config", experiment.config, "--data", str(data), "--n-demos", str(experiment.n_demos)]
    options += ["--steps", str(experiment.steps), "--keep-steps", ",".join(map(str, sorted(experiment.keep_steps)))]
    options += [part for text in experiment.settings for part in ("--set", text)]
    _run("cliport_policy.train", [*options, *experiment.train_options], folder, say)
    if missing := _missing(experiment, folder):
        raise BenchmarkError(f"training stopped before step {missing[0]}; run this again to go on")


def _missing(experiment: Experiment, folder: Path) -> list[int]:
    return [step for step in sorted(experiment.keep_steps) if not _checkpoint(folder.parent, step).exists()]


def _score(
    task: str, split: str, episodes: int, checkpoint: Path, out: Path, processes: int, say: Callable[[str], None]
) -> dict[str, Any]:
    if not out.exists():
        options = ["--checkpoint", str(checkpoint), "--task", task, "--split", split, "--episodes", str(episodes)]
        _run("cliport_benchmark.evaluate_cli", [*options, "--processes", str(processes)], out, say)
    return read_json(out)


def _mean(result: dict[str, Any]) -> float:
    score = result.get("mean_score")
    if score is None:
        raise BenchmarkError(f"no episode of {result.get('task')} {result.get('split')} could be scored")
    return float(score)


def _checkpoint(folder: Path, step: int) -> Path:
    return folder / "train" / "checkpoints" / f"step-{step:07d}.safetensors"


def _run(module: str, options: list[str], out: Path, say: Callable[[str], None]) -> None:
    """Run a command of the workspace in a process of its own, its output passed through."""
    command = [sys.executable, "-m", module, *options, "--out", str(out)]
    say(" ".join([module.split(".")[-1].removesuffix("_cli"), *command[3:]]))
    process = subprocess.Popen(command)
    try:
        status = process.wait()
    except BaseException:
        process.terminate()  # it saves what it has
        process.wait()
        raise
    if status == 130:
        raise KeyboardInterrupt
    if status:
        raise BenchmarkError(f"{module} failed with status {status}; its last line says why. Run this again to go on")
