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
CHANGELOG = ROOT / "CHANGELOG.md"
KINDS = ["Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]  # in this order
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


def sections(text: str) -> dict[str, dict[str, list[str]]]:
    """Read a changelog: the lines under each kind of change, of each release."""
    found: dict[str, dict[str, list[str]]] = {}
    for line in text.partition("\n## ")[2].splitlines():
        heading, _, title = line.partition(" ")
        if heading == "###":
            kinds = found[next(reversed(found))]
            assert title not in kinds, f"{title} stands twice"
            kinds[title] = []
        elif heading == "##" or not found:
            found[title if heading == "##" else line] = {}
        elif line:
            kinds = found[next(reversed(found))]
            assert kinds, f"under no kind of change: {line}"
            kinds[next(reversed(kinds))].append(line)
    return found


def test_the_changelog_has_the_form_of_keep_a_changelog():
    text = CHANGELOG.read_text()
    assert text.startswith("# Changelog\n\n")
    for release, kinds in sections(text).items():
        assert re.fullmatch(r"\[Unreleased\]|\[\d+\.\d+\.\d+\] - \d{4}-\d\d-\d\d", release), release
        assert list(kinds) == [kind for kind in KINDS if kind in kinds], f"{release}: unknown, or out of order"
        for kind, lines in kinds.items():
            assert lines and lines[0].startswith("- "), f"{release}, {kind}"
            strays = [line for line in lines if not line.startswith(("- ", "  "))]
            assert not strays, f"{release}, {kind}: {strays[0]}"


def test_unreleased_changes_stand_above_releases_newest_first():
    first, *releases = sections(CHANGELOG.read_text())
    assert first == "[Unreleased]"
    numbers = [tuple(int(part) for part in re.findall(r"\d+", release)[:3]) for release in releases]
    assert numbers == sorted(set(numbers), reverse=True)
    assert not numbers or tuple(int(part) for part in version().split(".")) >= numbers[0]


def test_the_version_is_released_on_the_day_that_the_citation_says():
    released = re.search(rf"^## \[{re.escape(version())}\] - (\S+)$", CHANGELOG.read_text(), re.MULTILINE)
    cited = re.search(r"^date-released: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert released and cited and released[1] == cited[1]


def test_a_changelog_of_another_form_is_noticed():
    with pytest.raises(AssertionError, match="under no kind of change"):
        sections("# Changelog\n\n## [Unreleased]\n\n- something\n")
    with pytest.raises(AssertionError, match="Added stands twice"):
        sections("# Changelog\n\n## [Unreleased]\n\n### Added\n- a\n\n### Added\n- b\n")
