"""README's commands are real: each is typed by a test, or is a part of one that is.

`SHORT` are run here. `LONG` are run by test_readme_sessions.py, as README has them but with fewer scenes and steps
(`make soak PYTEST_ARGS=tests/test_readme_sessions.py`). `ELSEWHERE` are run by other tests. `MADE` are targets of the
Makefile: what they start is held here, and README says how long they take.
"""

from __future__ import annotations

import argparse
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
from importlib import import_module, metadata
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest
from readme_commands import README, ROOT, commands, is_command, neither, smaller, snippet
from ros2cli_small.main import build_parser
from setup_shell import program
from test_readme_sessions import GRAPH, LESSONS

from cliport_benchmark.generate import GenerateConfig, make_part
from cliport_core.command_line import CommandParser
from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec

TYPED = commands(README)
PYTHON = "-m cliport_benchmark"
SHORT = [
    "git clone <this repository> && cd cliport-ros",
    "source env.sh",
    "python tools/extras.py",
]
MADE = {  # command: what the Makefile starts for it, and README's words on how long that takes if it is slow
    "make demo": (f"python {PYTHON}.demo", "some six minutes"),
    "make demo SEED=7": (f"python {PYTHON}.demo --seed 7", "wall_s=60.0"),
    'make demo INSTRUCTION="every red cube goes into the blue bowl, please"': (
        f"python {PYTHON}.demo --instruction 'every red cube goes into the blue bowl, please'",
        "wall_s=60.0",
    ),
    "make demo TASK=stack-block-pyramid-seq-seen-colors SEED=1": (
        f"python {PYTHON}.demo --task stack-block-pyramid-seq-seen-colors --seed 1",
        "six sentences",
    ),
    "make demo TASK=": (f"python {PYTHON}.demo", "wall_s=60.0"),
    "make teach": ("ros2 launch cliport_bringup teach.launch.yaml", ""),
    "make setup": ("setup", "some six minutes, most of them for downloads"),
    'make setup EXTRAS="runtime simulate"': ("setup", "some six minutes, most of them for downloads"),
    "make test": ("python -m pytest -n 3 --no-loadscope-reorder", "15 minutes on two slow cores"),
    "make soak": ("python -m pytest -m soak", "load the machine for minutes"),
    "make bench": (f"python {PYTHON}.bench", "some minutes"),
    "make lint": ("ruff check\nruff format --check\nmypy\ncheck_page", ""),
    "make mutants PACKAGE=…": ("python tools/mutants.py …", ""),
    "make build": ("build", ""),
    "make clean": ("", ""),
}
ELSEWHERE = {  # command: a test that types it, and what of it stands there
    "torchrun --nproc-per-node 2 -m cliport_policy.train …": (
        "src/cliport_policy/test/test_train_command.py::test_two_processes_are_as_one",
        ("torch.distributed.run", "--nproc-per-node", "cliport_policy.train"),
    ),
    "tensorboard --logdir runs": (
        "src/cliport_policy/test/test_train_command.py::test_a_training_writes_policies_curves_and_pictures",
        ("EventAccumulator",),
    ),
    "ros2 run cliport_perception calibrate": (
        "src/cliport_perception/test/test_calibration_nodes.py::test_a_tied_calibration_ends_with_who_started_it",
        ("cliport_perception.calibration.cli",),
    ),
    "ros2 run panda_driver driver": ("src/panda_driver/test/test_node.py::test_the_driver_conforms", ("DriverNode(",)),
    "python tools/lock.py": ("tests/test_extras.py::test_a_package_without_a_hash_is_refused", ("lock",)),
}
SAID = ["demo: success task=put-blocks-in-bowls-seen-colors seed=3 score=1.00 steps=2 wall_s=60.0"]


def test_every_command_is_in_a_list_and_every_list_is_readmes() -> None:
    listed = [*SHORT, *MADE, *ELSEWHERE, *GRAPH, *LESSONS]
    assert len(listed) == len(set(listed))
    assert set(TYPED) == set(listed)
    assert neither(README) == SAID


def test_a_new_command_is_noticed() -> None:
    block = "    ros2 topic hz /clock     # a rate\n    ros2 bag \\\n        info it\n"
    text = f"Do\n\n{block}\nor `make coffee`, `ros2` or `word`.\n"
    assert commands(text) == ["ros2 topic hz /clock", "ros2 bag info it", "make coffee"]
    assert not is_command("ros2") and not is_command("ros2_control there")
    assert neither("\n    $ ls\n    said: so\n") == ["$ ls", "said: so"]
    assert smaller("a --n 5 'b c'", {"--n": "1", "--m": "2"}) == ["a", "--n", "1", "b c", "--m", "2"]


class ParsedError(Exception):
    """A command line was understood, and nothing is done for it."""


@pytest.fixture
def only_parsed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let every command end when it has understood its command line."""
    parse = argparse.ArgumentParser.parse_args

    def parse_and_end(self: CommandParser, *given: Any, **named: Any) -> None:
        parse(self, *given, **named)
        raise ParsedError

    monkeypatch.setattr(CommandParser, "parse_args", parse_and_end)


def programs() -> dict[tuple[str, str], str]:
    """Return the module of each program that `ros2 run` starts."""
    found = {}
    for setup in ROOT.glob("src/*/setup.py"):
        for name, module in re.findall(r'"(\w+) = ([\w.]+):main"', setup.read_text()):
            found[setup.parent.name, name] = module
    return found


@pytest.mark.parametrize("typed", [line for line in TYPED if line.startswith("ros2 run") and " --" in line])
def test_the_program_understands_what_readme_types(typed: str, only_parsed: None, capsys: Any) -> None:
    _, _, package, name, *arguments = shlex.split(typed)
    with pytest.raises(ParsedError):
        import_module(programs()[package, name]).main(arguments)


@pytest.mark.parametrize("typed", [line for line in TYPED if line.startswith("ros2")])
def test_ros2_understands_what_readme_types(typed: str) -> None:
    build_parser().parse_args(shlex.split(typed)[1:])


@pytest.mark.parametrize("typed", ELSEWHERE)
def test_a_test_that_types_a_command_is_there(typed: str) -> None:
    test, words = ELSEWHERE[typed]
    file, _, function = test.partition("::")
    text = (ROOT / file).read_text()
    assert f"def {function}(" in text
    assert all(word in text for word in words)


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """A checkout in which every program that the Makefile starts writes down its words instead."""
    shutil.copy(ROOT / "Makefile", tmp_path)
    (tmp_path / "env.sh").write_text('export PATH="$PWD/bin:$PATH"\n')
    note = 'printf "%s\\t" "${0##*/}" "$@" >>started; echo >>started'
    for name in ("bin/python", "bin/ros2", "bin/ruff", "bin/mypy", "tools/build", "tools/check_page"):
        program(tmp_path / name, note)
    program(tmp_path / "tools/setup", f'case "$*" in *--when-needed*) ;; *) {note} ;; esac; echo "$EXTRAS" >extras')
    for folder in ("build", "out", ".venv"):
        (tmp_path / folder).mkdir()
    return tmp_path


@pytest.mark.parametrize("typed", MADE)
def test_make_starts_what_readme_says_and_how_long_is_said(typed: str, made: Path, only_parsed: None) -> None:
    starts, takes = MADE[typed]
    assert takes in " ".join(README.split())
    # without what `make test PYTEST_ARGS=...` hands on to every make below it
    bare = {name: value for name, value in os.environ.items() if name not in ("MAKEFLAGS", "PYTEST_ARGS")}
    subprocess.run(["bash", "-c", typed], cwd=made, env=bare, check=True, capture_output=True, timeout=60)
    log = made / "started"
    started = [line.split("\t")[:-1] for line in log.read_text().splitlines()] if log.exists() else []
    assert started == [shlex.split(line) for line in starts.splitlines()]
    if "EXTRAS" in typed:
        assert (made / "extras").read_text() == "runtime simulate\n"
    if typed == "make clean":
        assert not (made / "out").exists() and (made / ".venv").exists()
    for _, *words in started:
        if words[:1] == ["-m"] and words[1].startswith("cliport"):
            with pytest.raises(ParsedError):
                import_module(words[1]).main(words[2:])


def test_a_clone_has_what_readme_begins_with(tmp_path: Path) -> None:
    if not (ROOT / ".git").exists():
        pytest.skip("this checkout is no clone")
    (tmp_path / "cliport-ros").symlink_to(ROOT)
    (tmp_path / "here").mkdir()
    typed = SHORT[0].replace("<this repository>", str(tmp_path / "cliport-ros"))
    script = ["bash", "-c", f"{typed} && make help"]
    done = subprocess.run(script, cwd=tmp_path / "here", capture_output=True, text=True)
    assert done.returncode == 0 and "make demo" in done.stdout, done.stderr


def test_a_shell_has_python_packages_and_ros2() -> None:
    script = f"{SHORT[1]} && command -v ros2 && python -c 'import rclpy, cliport_policy, cliport_interfaces.msg'"
    done = subprocess.run(["bash", "-c", script], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0 and done.stdout.strip().endswith("ros2"), done.stderr


def test_sizes_of_extras_are_printed() -> None:
    done = subprocess.run(
        [sys.executable, *SHORT[2].split()[1:]], cwd=ROOT, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert all(
        re.search(rf"^\| {extra} \| \d+ \| \d\.\d\d \|", done.stdout, re.MULTILINE)
        for extra in ("runtime", "train", "simulate")
    )


def test_the_row_of_a_data_set_is_read_as_readme_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "data/train").mkdir(parents=True)
    make_part(GenerateConfig("put-blocks-in-bowls-seen-colors", "train", 0, 1), tmp_path / "data/train", 0)
    shown: list[tuple[int, int]] = []
    monkeypatch.setattr(PIL.Image.Image, "show", lambda picture: shown.append(picture.size))
    monkeypatch.chdir(tmp_path)
    exec(snippet(README, "pyarrow"), {"io": io})
    sentence, row, col = re.fullmatch(r"(.*) (\d+) (\d+)\n", capsys.readouterr().out).groups()  # type: ignore[union-attr]
    assert len(shown) == 1 and sentence.startswith("put the ")
    assert int(row) < shown[0][1] and int(col) < shown[0][0]


def test_the_policy_is_asked_as_readme_says() -> None:
    workspace = WorkspaceSpec()
    size = workspace.shape
    color = np.random.default_rng(0).integers(0, 255, (*size, 3)).astype(np.uint8)
    names: dict[str, Any] = {"heightmap": Heightmap(color, np.zeros(size, np.float32), np.ones(size, bool), workspace)}
    exec(snippet(README, "load_policy"), names)
    inference = names["inference"]
    pick, place = inference.action.pick, inference.action.place
    assert workspace.contains_xy(pick.x, pick.y) and workspace.contains_xy(place.x, place.y)
    assert 0.0 <= inference.action.confidence <= 1.0 and 0.0 <= inference.done_probability <= 1.0
    assert inference.maps


def test_every_program_says_its_version(capsys: pytest.CaptureFixture[str]) -> None:
    """README says so of every command: those of `ros2 run`, but nodes, whose words are ROS's."""
    for module in sorted(set(programs().values())):
        if "CommandParser" in Path(import_module(module).__file__ or "").read_text():
            with pytest.raises(SystemExit) as ended:
                import_module(module).main(["--version"])
            assert ended.value.code == 0
            assert capsys.readouterr().out == f"CLIPort for ROS 2 {metadata.version('cliport_core')}\n"
