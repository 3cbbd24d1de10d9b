"""One experiment in the paper's four phases: generate, train, choose a checkpoint on val, score on test.

See docs/paper.md, "Evaluation".
"""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

from cliport_benchmark.errors import BenchmarkError, OptionError
from cliport_benchmark.json_files import differences, read_json, write_json
from cliport_benchmark.own_setup import OwnSetup
from cliport_benchmark.policy_facts import check_needs_no_goal_image, method_facts
from cliport_benchmark.variation import Variation
from cliport_benchmark.with_parent import command_with_parent
from cliport_policy.card import load_card
from cliport_policy.data.dataset_format import META_NAME
from cliport_policy.named_configs import load_network_config
from cliport_policy.training.options import parse_options
from sim_bridge.tasks import make_task

RESULT_NAME = "experiment.json"
_ADDED_LATER = ("exact_offset",)  # settings that a finished experiment may still get
_SCORES = (
    "mean_score",
    "chance",
    "n_episodes",
    "discarded",
    "redrawn",
    "broken",
    "object_set",
    "commit",
    "dirty",
    "command",
)


@dataclass(frozen=True)
class Experiment:
    """Settings of a training from so much data, and of the tasks that it is scored on.

    config: a network's name or YAML file; settings: changes to it, as train's --set takes them. keep_steps: the
    steps whose checkpoints compete on val. also_test: tasks beside its own that the chosen one is scored on.
    workspace, camera: files of an own set-up, or None; randomize: what varies in the demonstrations, and
    randomize_scores: in the scenes that it is scored on, as generate and evaluate take it, or None. exact_offset:
    whether the chosen one is scored on test a second time, with each thing placed as far off as it was picked.

    Raises:
        OptionError: on numbers that make no experiment, what train does not take, or a network that cannot be scored.
        UnknownNameError: on an unknown task; ConfigError: on an unknown config or setting.
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
    workspace: str | None = None
    camera: str | None = None
    randomize: str | None = None
    randomize_scores: str | None = None
    exact_offset: bool = False

    def __post_init__(self) -> None:
        workspace, camera = (path and Path(path) for path in (self.workspace, self.camera))
        OwnSetup.load(workspace or None, camera or None).check_room(self.task, "train", 0)
        for text in (self.randomize, self.randomize_scores):
            Variation.parse(text)
        for name in (self.task, *self.also_test):
            make_task(name, "test")
        check_needs_no_goal_image(f"--config {self.config}", load_network_config(self.config))
        for option in ("n_demos", "steps", "val_episodes", "test_episodes"):
            if getattr(self, option) < 1:
                raise OptionError(f"--{option.replace('_', '-')} must be 1 or more, got {getattr(self, option)}")
        wrong = [step for step in self.keep_steps if not 0 < step <= self.steps]
        if wrong or not self.keep_steps:
            raise OptionError(f"--keep-steps must be within 1 and --steps {self.steps}, got {list(self.keep_steps)}")
        try:
            parse_options([*self.options_of_train("data"), "--out", "train"])
        except SystemExit:  # argparse has said which
            raise OptionError(f"--train-options '{' '.join(self.train_options)}' are not what train takes") from None

    def options_of_train(self, data: str) -> list[str]:
        """Return the options of train but for its folder; data: folder of the demonstrations."""
        options = ["--config", self.config, "--data", data, "--n-demos", str(self.n_demos)]
        options += ["--steps", str(self.steps), "--keep-steps", ",".join(map(str, sorted(self.keep_steps)))]
        options += [part for text in self.settings for part in ("--set", text)]
        return [*options, *self.train_options]

    @property
    def setup_options(self) -> list[str]:
        """The own set-up, for a command of this package."""
        files = (("--workspace", self.workspace), ("--camera", self.camera))
        return [part for name, file in files if file for part in (name, file)]

    @property
    def score_options(self) -> list[str]:
        """Options of evaluate beside task, split and checkpoint."""
        return [*self.setup_options, *_randomized(self.randomize_scores)]

    @property
    def method(self) -> str:
        """The network as a folder calls it; tables also say which of its parts were replaced."""
        return "+".join([Path(self.config).stem, *(text.replace("/", "_") for text in self.settings)])

    @property
    def folder(self) -> Path:
        """Folder of the experiment within that of all experiments."""
        return Path(self.task) / self.method / f"{self.n_demos}-demos"


def train_experiment(experiment: Experiment, out: Path, data: Path, say: Callable[[str], None]) -> None:
    """Do what is left of an experiment's training. data: demonstrations, as make_data leaves them.

    Raises:
        BenchmarkError: when the command fails, or the folder holds another experiment.
    """
    folder = out / experiment.folder
    identity = {name: value for name, value in asdict(experiment).items() if name not in _ADDED_LATER}
    begun = folder / "settings.json"
    if begun.exists():
        differing = differences(read_json(begun), identity)
        if differing:
            raise OptionError(f"{folder} holds an experiment of other settings ({differing}); choose another --out")
    else:
        write_json(begun, identity)
    _train(experiment, folder / "train", data, say)


def run_experiment(
    experiment: Experiment, out: Path, data: Path, evaluate_options: Sequence[str], say: Callable[[str], None]
) -> Path:
    """Run what is left of an experiment and return the path of its result.
    data: demonstrations, as make_data leaves them.

    evaluate_options: how evaluate spreads its scenes, `--processes 2` say.

    Each phase is a command of its own, said before it begins, and leaves files that are not made again.

    Raises:
        BenchmarkError: when a command fails, or the folder holds another experiment.
    """
    train_experiment(experiment, out, data, say)
    folder = out / experiment.folder
    options = [*experiment.score_options, *evaluate_options]
    val = _validate(experiment, folder, options, say)
    chosen = choose(list(val), list(val.values()))
    tests = _test(experiment, folder / "test", _checkpoint(folder, chosen), options, say)
    result = _result(experiment, val, chosen, _checkpoint(folder, chosen), tests)
    if experiment.exact_offset:
        exact = [*options, "--exact-offset"]
        result["test_exact"] = _kept(_test(experiment, folder / "test-exact", _checkpoint(folder, chosen), exact, say))
    write_json(folder / RESULT_NAME, result)
    return folder / RESULT_NAME


def choose(steps: Sequence[int], scores: Sequence[float]) -> int:
    """Return the step whose checkpoint scores highest on val; of several, the first."""
    return steps[max(range(len(steps)), key=lambda i: scores[i])]


def make_data(
    task: str,
    episodes: int,
    out: Path,
    processes: int,
    say: Callable[[str], None],
    setup_options: Sequence[str] = (),
    randomize: str | None = None,
) -> Path:
    """Return the folder with at least so many training demonstrations of a task, made unless it is there.

    setup_options: Experiment's; randomize: what varies, as generate takes it.
    """
    folders = (out / "data" / task).glob("*/" + META_NAME)
    made = [int(meta.parent.name) for meta in folders if meta.parent.name.isdecimal()]
    whole = min((n for n in made if n >= episodes), default=episodes)
    folder = out / "data" / task / str(whole)
    options = ["--task", task, "--split", "train", "--episodes", str(whole), "--processes", str(processes)]
    _run("cliport_benchmark.generate_cli", [*options, *setup_options, *_randomized(randomize)], folder, say)
    return folder


def _validate(
    experiment: Experiment, folder: Path, options: Sequence[str], say: Callable[[str], None]
) -> dict[int, float]:
    """Return the mean score on val of each kept step's checkpoint, 0..100."""
    scores = {}
    for step in sorted(experiment.keep_steps):
        scoring = _Scoring(experiment.task, "val", experiment.val_episodes, _checkpoint(folder, step))
        scores[step] = _mean(_score(scoring, folder / "val" / f"step-{step:07d}.json", options, say))
    return scores


def _test(
    experiment: Experiment, folder: Path, checkpoint: Path, options: Sequence[str], say: Callable[[str], None]
) -> dict[str, dict[str, Any]]:
    """Return the results on test of each task that the chosen checkpoint is scored on; folder: where they lie."""
    results = {}
    for task in (experiment.task, *experiment.also_test):
        scoring = _Scoring(task, "test", experiment.test_episodes, checkpoint)
        results[task] = _score(scoring, folder / f"{task}.json", options, say)
    return results


def _result(
    experiment: Experiment, val: dict[int, float], chosen: int, checkpoint: Path, tests: dict[str, dict[str, Any]]
) -> dict[str, Any]:
    """Return what RESULT_NAME holds."""
    facts = method_facts(load_card(checkpoint))
    return {
        **facts,
        **asdict(experiment),
        "method": "+".join([facts["method"], *experiment.settings]),
        "val": {str(step): score for step, score in val.items()},
        "chosen_step": chosen,
        "checkpoint": str(checkpoint),
        **{name: tests[experiment.task].get(name) for name in ("weights_sha256", "commit", "dirty")},
        "test": _kept(tests),
    }


def _kept(tests: dict[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return what RESULT_NAME holds of the results on test, by task."""
    return {task: {name: value.get(name) for name in _SCORES} for task, value in tests.items()}


def _train(experiment: Experiment, folder: Path, data: Path, say: Callable[[str], None]) -> None:
    if not _missing(experiment, folder):
        return
    _run("cliport_policy.train", experiment.options_of_train(str(data)), folder, say)
    if missing := _missing(experiment, folder):
        raise BenchmarkError(f"training stopped before step {missing[0]}; run this again to go on")


def _missing(experiment: Experiment, folder: Path) -> list[int]:
    return [step for step in sorted(experiment.keep_steps) if not _checkpoint(folder.parent, step).exists()]


def _randomized(aspects: str | None) -> list[str]:
    return ["--randomize", aspects] if aspects else []


class _Scoring(NamedTuple):
    """A checkpoint and the task that it is scored on."""

    task: str
    split: str
    episodes: int
    checkpoint: Path


def _score(scoring: _Scoring, out: Path, evaluate_options: Sequence[str], say: Callable[[str], None]) -> dict[str, Any]:
    if not out.exists():
        options = ["--checkpoint", str(scoring.checkpoint), "--task", scoring.task, "--split", scoring.split]
        options += ["--episodes", str(scoring.episodes), *evaluate_options]
        _run("cliport_benchmark.evaluate_cli", options, out, say)
    return read_json(out)


def _mean(result: dict[str, Any]) -> float:
    score = result.get("mean_score")
    if score is None:
        raise BenchmarkError(f"no episode of {result.get('task')} {result.get('split')} could be scored")
    return float(score)


def _checkpoint(folder: Path, step: int) -> Path:
    return folder / "train" / "checkpoints" / f"step-{step:07d}.safetensors"


def _run(module: str, options: list[str], out: Path, say: Callable[[str], None]) -> None:
    """Run a command of the workspace in a process of its own that ends with this one, its output passed through."""
    arguments = [*options, "--out", str(out)]
    say(" ".join([module.split(".")[-1].removesuffix("_cli"), *arguments]))
    process = subprocess.Popen(command_with_parent(module, arguments))
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
