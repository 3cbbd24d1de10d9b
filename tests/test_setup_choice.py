"""What a user chooses of tools/setup: extras, PyTorch without CUDA, the locked packages. Nothing is downloaded."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from extras import EXTRAS, pins
from setup_shell import program, shell

ROOT = Path(__file__).parents[1]
CHOOSE = 'choose; echo "$extras|$torch|$locked"; keep_choice'
DEFAULT = "runtime train simulate develop|default|0\n"


@pytest.mark.parametrize(
    ("given", "chosen"),
    [
        ({}, DEFAULT),
        ({"EXTRAS": "all"}, DEFAULT),
        ({"EXTRAS": "develop,simulate"}, "runtime simulate develop|default|0\n"),
        ({"EXTRAS": "runtime", "TORCH": "cpu"}, "runtime|cpu|0\n"),
        ({"EXTRAS": "all driver"}, "runtime train simulate develop driver|default|0\n"),
        ({"EXTRAS": "driver"}, "runtime driver|default|0\n"),
        ({"LOCKED": "1"}, "runtime train simulate develop|default|1\n"),
    ],
)
def test_a_choice_is_kept_until_another_is_made(tmp_path, given, chosen):
    assert shell(f"set -e; {CHOOSE}", tmp_path, **given).stdout == chosen
    assert shell(f"set -e; {CHOOSE}", tmp_path).stdout == chosen
    back = {"EXTRAS": "all", "TORCH": "default", "LOCKED": "0"}
    assert shell(f"set -e; {CHOOSE}", tmp_path, **back).stdout == DEFAULT


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"EXTRAS": "robot"}, "EXTRAS names robot: it takes all, or some of runtime train simulate develop driver"),
        ({"TORCH": "cuda"}, "TORCH is cuda: it takes cpu or default"),
        ({"LOCKED": "yes"}, "LOCKED is yes: it takes 1 or 0"),
        ({"LOCKED": "1", "TORCH": "cpu"}, "the lock holds PyTorch's ordinary build"),
    ],
)
def test_what_cannot_be_chosen_is_refused_in_one_line(tmp_path, given, said):
    refused = shell(CHOOSE, tmp_path, **given)
    assert refused.returncode == 1 and not refused.stdout
    assert refused.stderr.startswith(f"error: {said}") and refused.stderr.count("\n") == 1


def test_a_command_that_needs_more_says_how_to_get_it(tmp_path):
    refused = shell("require_extras train simulate", tmp_path, extras="runtime train")
    assert refused.returncode == 1
    assert refused.stderr == (
        "error: this needs more than was set up (runtime train): run 'make setup EXTRAS=\"runtime train simulate\"'\n"
    )
    assert shell("require_extras train", tmp_path, extras="runtime train").returncode == 0


def test_each_choice_has_a_key_of_its_own(tmp_path):
    for name in ("runtime", "locked"):
        (tmp_path / f"requirements-{name}.txt").write_text(f"{name}==1\n")
    key = "packages_key requirements-runtime.txt"
    common = {"python_version": "3.11", "extras": "runtime", "torch": "default", "locked": "0"}
    keys = {
        shell(key, tmp_path, **{**common, **other}).stdout
        for other in ({}, {"torch": "cpu"}, {"locked": "1"}, {"extras": "runtime train"}, {"python_version": "3.12"})
    }
    assert len(keys) == 5


def test_other_extras_do_not_build_the_workspace_anew(tmp_path):
    for name in ("ros", "runtime"):
        (tmp_path / f"requirements-{name}.txt").write_text(f"{name}==1\n")
    common = {"python_version": "3.11", "torch": "default", "locked": "0"}
    few, all_of_them = (
        shell("underlay_key", tmp_path, **common, extras=extras).stdout for extras in ("runtime", "runtime develop")
    )
    assert few == all_of_them
    assert few != shell("underlay_key", tmp_path, **{**common, "locked": "1"}).stdout


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A folder with this project's pins, and a python whose pip writes down what it is asked for."""
    for file in ROOT.glob("requirements*.txt"):
        (tmp_path / file.name).write_text(file.read_text())
    program(tmp_path / ".venv/bin/python", 'echo "$*" >>"$stamps/asked"; exit ${FOUND:-0}')
    (tmp_path / ".setup").mkdir()
    (tmp_path / "bin").mkdir()
    return tmp_path


FIND = 'find_cpu_torch requirements-runtime.txt; echo "torch=$torch"'
PINNED = [f"{pin.name}{pin.specifier}+cpu" for pin in pins("runtime") if pin.name in ("torch", "torchvision")]


def test_cpu_builds_come_from_the_users_own_index(checkout):
    done = shell(FIND, checkout, torch="cpu", TORCH_INDEX="file:///index")
    assert done.stdout.endswith("as pip found them\ntorch=cpu\n"), done.stderr
    assert (checkout / ".setup/torch.txt").read_text().split() == PINNED
    asked = (checkout / ".setup/asked").read_text()
    assert "--extra-index-url file:///index " + " ".join(PINNED) in asked


def test_where_pip_finds_none_uv_is_asked(checkout):
    program(checkout / "bin/uv", 'echo "uv $*" >>"$stamps/asked"')
    path = f"{checkout}/bin:/usr/bin:/bin"
    done = shell(FIND, checkout, torch="cpu", FOUND="1", PATH=path)
    assert done.stdout.endswith("as uv found them\ntorch=cpu\n"), done.stderr
    assert "--torch-backend cpu " + " ".join(PINNED) in (checkout / ".setup/asked").read_text()


def test_where_there_is_none_one_line_says_so_and_the_ordinary_build_follows(checkout):
    program(checkout / "bin/uv", "exit 1")
    done = shell(FIND, checkout, torch="cpu", FOUND="1", PATH=f"{checkout}/bin:/usr/bin:/bin")
    assert (done.returncode, done.stdout) == (0, "torch=default\n")
    assert done.stderr.count("\n") == 1 and "the ordinary one follows; TORCH_INDEX=URL" in done.stderr
    assert not (checkout / ".setup/torch.txt").exists()


INSTALL = (
    "python_version=3.11; locked_requirements >$stamps/locked.txt; install_python_packages requirements-runtime.txt"
)


def test_locked_packages_of_the_chosen_extras_are_installed_by_hash(checkout):
    program(checkout / "bin/uname", "echo x86_64")
    path = f"{checkout}/bin:/usr/bin:/bin"
    done = shell(INSTALL, checkout, locked="1", torch="default", extras="runtime", PATH=path)
    assert done.returncode == 0, done.stderr
    assert "--require-hashes --no-deps -r" in (checkout / ".setup/asked").read_text()
    names = {line.partition("==")[0] for line in (checkout / ".setup/locked.txt").read_text().splitlines()}
    assert {"torch", "ros-jazzy-rclpy", "starlette"} <= names
    assert not {"open3d", "pybullet", "mypy", "pyarrow"} & names


def test_the_lock_is_refused_on_a_python_that_it_was_not_made_for(checkout):
    refused = shell("locked_requirements", checkout, python_version="3.13", extras="runtime")
    assert refused.returncode == 1
    assert refused.stderr.startswith("error: LOCKED=1 takes Python 3.11 x86_64, and this is 3.13 ")


@pytest.mark.parametrize(("torch", "gone"), [("cpu", "nvidia-cublas triton"), ("default", "torch")])
def test_the_other_build_of_pytorch_goes(checkout, torch, gone):
    listed = r"nvidia-cublas==1\ntorch==2.15.0+cpu\ntriton==3\nnumpy==2\n"
    program(checkout / ".venv/bin/python", f'[ "$3" = list ] && printf "{listed}" || echo "$*" >"$stamps/asked"')
    assert shell("remove_other_torch", checkout, torch=torch).returncode == 0
    assert (checkout / ".setup/asked").read_text() == f"-m pip uninstall -y -q {gone}\n"


def test_requirements_name_what_all_takes_and_no_host():
    named = re.findall(r"^-r requirements-(\w+)\.txt$", (ROOT / "requirements.txt").read_text(), re.MULTILINE)
    assert named == [extra for extra in EXTRAS if extra not in ("ros", "driver")]
    for file in ROOT.glob("requirements*.txt"):
        assert "://" not in file.read_text(), file
        assert "index-url" not in file.read_text(), file
