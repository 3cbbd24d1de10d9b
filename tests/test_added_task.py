"""A task that another package adds: installed beside, without a touch of this tree, it goes through every command.

The commands share a process, as each start of one is seconds of imports: `python test_added_task.py` with a list of
modules and their arguments runs them one after the other, and those that an experiment starts too.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from importlib import import_module
from pathlib import Path

import pytest
from ros_domain import next_domain

from cliport_benchmark import experiment
from cliport_benchmark.json_files import read_json
from cliport_policy.data.demonstrations import load_demonstrations

EXAMPLE = Path(__file__).resolve().parents[1] / "examples/cliport_example_task"
TASK = "put-block-on-mat"
SENTENCE = r"put the \w+ block on the \w+ mat"


@pytest.fixture(scope="module")
def beside(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder into which the example's package is installed."""
    folder = tmp_path_factory.mktemp("added")
    source = shutil.copytree(EXAMPLE, folder / "source")  # pip writes beside what it installs
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", "--no-build-isolation"]
    subprocess.run([*pip, "--target", str(folder / "site"), str(source)], check=True, timeout=120)
    return folder / "site"


def run(beside: Path, *commands: Sequence[str], status: tuple[int, ...] = (0,)) -> str:
    """Run commands, each a module and its arguments, in a process that finds the example, and return their words."""
    path = os.pathsep.join([str(beside), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, __file__, json.dumps(commands)],
        env={**os.environ, "PYTHONPATH": path, "ROS_DOMAIN_ID": str(next_domain())},
        capture_output=True,
        text=True,
        timeout=800,
        check=False,
    )
    assert done.returncode in status, done.stdout + done.stderr
    return done.stdout


def run_here(commands: Iterable[Sequence[str]]) -> int:
    """Run commands in this process up to the first that fails, and return its status, or 0."""
    for module, *arguments in commands:
        if status := import_module(module).main(arguments):
            return int(status)
    return 0


def run_phase(module: str, options: list[str], out: Path, say: Callable[[str], None]) -> None:
    """Run a phase of an experiment in this process, and say its name."""
    say(module)
    assert run_here([[module, *options, "--out", str(out)]]) == 0


def phases(said: str) -> list[str]:
    return [line.split()[1] for line in said.splitlines() if line.startswith("== ")]


@pytest.mark.timeout(1800)
def test_an_added_task_is_generated_learnt_evaluated_and_listed(beside: Path, tmp_path: Path) -> None:
    options = f"--task {TASK} --n-demos 2 --steps 2 --keep-steps 2 --val-episodes 1 --test-episodes 1 --processes 1"
    train = ["--train-options", "--batch 2 --phrases 0"]
    folder, expert = tmp_path / TASK / "compact" / "2-demos", tmp_path / "results" / "expert.json"
    evaluate = ["cliport_benchmark.evaluate_cli", "--task", TASK, "--split", "test", "--checkpoint", "expert"]
    several = ["--goals-per-scene", "3", "--episodes", "1", "--out", str(tmp_path / "several")]
    said = run(
        beside,
        ["cliport_benchmark.experiment_cli", *options.split(), *train, "--out", str(tmp_path)],
        [*evaluate, "--episodes", "2", "--processes", "1", "--out", str(expert)],
        ["cliport_benchmark.results", str(expert.parent), str(folder / "test")],
        ["cliport_benchmark.generate_cli", "--task", TASK, *several],
    )
    generate, score = "cliport_benchmark.generate_cli", "cliport_benchmark.evaluate_cli"
    assert phases(said) == [generate, "cliport_policy.train", score, score]
    meta = read_json(tmp_path / "data" / TASK / "2" / "meta.json")
    assert meta["task"] == TASK and meta["stepwise"] is False
    result = read_json(folder / "experiment.json")
    assert result["chosen_step"] == 2 and set(result["val"]) == {"2"}
    assert read_json(folder / "val" / "step-0000002.json")["split"] == "val"
    learnt = read_json(folder / "test" / f"{TASK}.json")
    assert learnt["split"] == "test" and learnt["n_episodes"] == 1
    assert re.fullmatch(SENTENCE, learnt["episodes"][0]["instruction"])
    assert result["test"][TASK]["mean_score"] == learnt["mean_score"]
    assert TASK in (tmp_path / "experiments.md").read_text()

    assert read_json(expert)["mean_score"] == 100.0 and read_json(expert)["chance"] == 43.75
    _, _, others = said.partition("## Other tasks")
    assert f"| {TASK} | expert | test | 100.0 | 2 |" in others and others.count(f"| {TASK} |") == 2

    own, *more = load_demonstrations(tmp_path / "several").frames[0].demos
    assert len({own.instruction, *(demo.instruction for demo in more)}) == 3
    assert all(re.fullmatch(SENTENCE, demo.instruction) for demo in (own, *more))


@pytest.mark.soak  # a whole graph for what `make demo` shows of another task
@pytest.mark.timeout(900)
def test_the_demo_shows_an_added_task(beside: Path, tmp_path: Path) -> None:
    said = run(beside, ["cliport_benchmark.demo", "--task", TASK, "--out", str(tmp_path)], status=(0, 1))
    assert re.search(f"demo: instruction: {SENTENCE}", said)  # whether the shipped policy can do it is another matter
    assert re.search(rf"demo: (success|failure) task={TASK} seed=3 score=\d", said)
    assert (tmp_path / "before.png").is_file() and (tmp_path / "after.png").is_file()


if __name__ == "__main__":
    experiment._run = run_phase
    sys.exit(run_here(json.loads(sys.argv[1])))
