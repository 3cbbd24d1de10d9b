"""One version everywhere, and asked for where a user would look."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from cliport_core.command_line import CommandParser, version

ROOT = Path(__file__).parents[1]
PACKAGES = sorted(path for path in ROOT.glob("src/*/package.xml"))


def test_all_packages_and_the_citation_have_one_version():
    versions = {ElementTree.parse(path).findtext("version") for path in PACKAGES}
    cited = re.search(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert cited is not None
    assert versions == {cited[1]} == {version()}


def test_no_package_states_its_version_again():
    for path in PACKAGES:
        setup = path.with_name("setup.py")
        if setup.exists():
            assert "version=ElementTree" in setup.read_text(), setup


def test_every_parser_knows_its_version():
    for path in ROOT.glob("src/*/*/**/*.py"):
        if "test" not in path.parts and path.name != "command_line.py" and "underlay" not in path.parts:
            assert "argparse.ArgumentParser(" not in path.read_text(), f"{path}: use CommandParser"


def test_a_command_says_its_version(capsys):
    with pytest.raises(SystemExit) as ended:
        CommandParser(prog="anything").parse_args(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"CLIPort for ROS 2 {version()}\n"


def test_the_demos_command_line_says_it_too():
    said = subprocess.run(
        [sys.executable, "-m", "cliport_benchmark.demo", "--version"], capture_output=True, text=True, timeout=60
    )
    assert said.stdout == f"CLIPort for ROS 2 {version()}\n"
