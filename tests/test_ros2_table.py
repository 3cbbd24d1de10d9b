"""docs/ros2.md's table of verbs and flags, held to the parsers of the `ros2` command."""

from __future__ import annotations

import argparse
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest
from ros2cli_small.main import build_parser

ROOT = Path(__file__).parents[1]
ROW = re.compile(r"\| `([^`]+)` \| (same|differs|not here) \| (.+) \|")


def verbs(parser: argparse.ArgumentParser, name: str = "") -> Iterator[tuple[str, set[str]]]:
    """Yield each verb with its flags, aliases joined by blanks, and its arguments."""
    groups = [action for action in parser._actions if isinstance(action, argparse._SubParsersAction)]
    if not groups:
        own = [action for action in parser._actions if action.dest != "help"]
        yield name, {" ".join(action.option_strings) or action.dest for action in own}
    for group in groups:
        for verb, below in group.choices.items():
            yield from verbs(below, f"{name} {verb}".strip())


def table() -> dict[str, dict[str, list[str]]]:
    """Return what the table says: verb, status, flags."""
    found: dict[str, dict[str, list[str]]] = defaultdict(lambda: defaultdict(list))
    for line in (ROOT / "docs/ros2.md").read_text().splitlines():
        row = ROW.fullmatch(line)
        if row:
            found[row[1]][row[2]] += re.findall(r"`([^`]+)`", row[3])
    return found


PARSERS = dict(verbs(build_parser()))


def test_the_table_has_the_verbs_of_the_command():
    assert set(table()) == set(PARSERS)
    assert {"action send_goal", "bag record", "run", "topic list"} <= set(PARSERS)


@pytest.mark.parametrize("verb", sorted(PARSERS))
def test_the_table_has_the_flags_of_each_verb(verb):
    rows = table()[verb]
    here = rows["same"] + rows["differs"]
    assert set(here) == PARSERS[verb]
    assert len(here) == len(set(here)), "a flag is the same or differs, not both"
    names = {name for flag in PARSERS[verb] for name in flag.split()}
    assert not names & {name for flag in rows["not here"] for name in flag.split()}


def test_each_verb_that_differs_is_explained():
    text = (ROOT / "docs/ros2.md").read_text().partition("## What differs")[2]
    for verb, rows in table().items():
        for flag in rows["differs"]:
            words = (flag.split()[-1], f"**{verb.split()[0]}", f"**{verb.split()[-1]}**")
            assert any(word in text for word in words), (verb, flag)


def test_every_flag_says_what_it_does():
    def actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
        for action in parser._actions:
            if isinstance(action, argparse._SubParsersAction):
                for below in action.choices.values():
                    yield from actions(below)
            else:
                yield action

    assert [action.dest for action in actions(build_parser()) if not action.help] == []
