"""What static/protocol.d.ts says of the state and the commands, held against the server that sends and takes them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

import demo_tool
from cliport_core.instruction import MAX_INSTRUCTION
from cliport_core.outcome import ActionResult, Outcome
from demo_tool.errors import UnknownCommandError
from demo_tool.web.commands import OWN_COMMANDS

PROTOCOL = (Path(demo_tool.__file__).parent / "static" / "protocol.d.ts").read_text(encoding="utf-8")
STANDING = {"holder", "may_take_over", "pages"}  # what the web server adds for each page


def fields(interface: str) -> dict[str, str]:
    """Names and types in an interface of the file, with those that it extends."""
    found = re.search(rf"interface {interface}(?: extends (\w+))? \{{\n(.*?)\n\}}", PROTOCOL, re.DOTALL)
    assert found is not None, f"no interface {interface}"
    own = dict(re.findall(r"^  (\w+)\??: (.*);$", found[2], re.MULTILINE))
    return {**(fields(found[1]) if found[1] else {}), **own}


def texts(kind: str) -> set[str]:
    """The texts that a type allows; none where it allows any."""
    found = re.search(rf"type {kind} =(.*?);", PROTOCOL, re.DOTALL) if kind.isidentifier() else None
    return set(re.findall(r'"(\w+)"', found[1] if found else kind))


def check(interface: str, value: Mapping[str, Any]) -> None:
    """All fields are there and no other, and so on in what is nested."""
    declared = fields(interface)
    assert set(value) == set(declared), interface
    for name, kind in declared.items():
        inner = kind.removesuffix(" | null").removesuffix("[]")
        for each in value[name] if kind.endswith("[]") else [value[name]]:
            if each is None:
                assert kind.endswith("| null"), f"{interface}.{name} is null"
            elif isinstance(each, dict) and re.search(rf"interface {re.escape(inner)}\b", PROTOCOL):
                check(inner, each)
            elif isinstance(each, str) and (allowed := texts(inner)):
                assert each in allowed, f"{interface}.{name}"


def test_the_state_has_the_fields_that_the_page_expects(bench) -> None:
    bench.begin()
    bench.draw()
    bench.do("preview")
    bench.do("record")
    bench.do("propose")
    bench.draw()
    view = bench.view
    assert view["draft"]["pick"]["grasp"] and view["episode"]["steps"] and view["policy"]["proposal"]
    check("View", {**view, "may_take_over": False, "pages": 1})
    bench.do("preview")
    check("Plan", bench.view["plan"])


def test_what_waits_for_a_person_has_the_fields_that_the_page_expects(held) -> None:
    held.begin()
    held.draw()
    held.do("execute")
    held.arm.on_phase("APPROVAL", 0.2, "1a2b3c4d")
    check("View", {**held.view, "may_take_over": False, "pages": 1})
    check("Approval", held.view["approval"])
    held.arm.on_end(ActionResult(Outcome.REJECTED, "not approved"))
    held.arm.recover = lambda on_answer, on_end: on_answer(True, "begun")
    held.do("recover")
    check("View", {**held.view, "may_take_over": False, "pages": 1})


def test_what_is_listed_has_the_fields_that_the_page_expects(bench) -> None:
    bench.begin()
    bench.draw()
    bench.do("record")
    bench.do("end_episode")
    (info,) = bench.do("episodes")["episodes"]
    check("EpisodeInfo", info)
    check("Episode", bench.do("episode", name=info["name"]))
    assert set(fields("Statistics")) <= set(bench.do("statistics")["statistics"])


def test_the_commands_are_those_of_the_server(bench) -> None:
    with pytest.raises(UnknownCommandError) as refusal:
        bench.do("none-such")
    assert set(fields("Commands")) == OWN_COMMANDS | set(refusal.value.known)


def test_the_page_knows_how_long_an_instruction_may_be() -> None:
    page = (Path(demo_tool.__file__).parent / "static" / "page.js").read_text(encoding="utf-8")
    assert f"export const LONGEST_INSTRUCTION = {MAX_INSTRUCTION};" in page
