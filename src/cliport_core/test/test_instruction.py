"""The rules for an instruction."""

import re
from pathlib import Path

import pytest

from cliport_core.errors import CoreError, InstructionError
from cliport_core.instruction import MAX_INSTRUCTION, asks_to_stop, normalized_instruction

STATIC = Path(__file__).resolve().parents[2] / "demo_tool/demo_tool/static"


@pytest.mark.parametrize(
    "text", ["put it there", "поставь красный кубик", "把红色方块放进碗里 吧", "می‌خواهم", "☃ 😀", "é" * MAX_INSTRUCTION]
)
def test_any_script_passes(text: str) -> None:
    assert normalized_instruction(f"  {text} \n") == text


@pytest.mark.parametrize("text", ["a  b", "a\nb", "a\t\r\n b", "a\u3000b", "a\u2028b", "a\x85b", " a b" + " " * 1000])
def test_white_space_becomes_one_blank(text: str) -> None:
    assert normalized_instruction(text) == "a b"


@pytest.mark.parametrize("text", ["", "   ", "\n\t"])
def test_nothing_but_white_space_means_stop(text: str) -> None:
    assert normalized_instruction(text) == ""


def test_it_is_its_own_normal_form() -> None:
    once = normalized_instruction("  put \u200d the\tblock ")
    assert normalized_instruction(once) == once


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("x" * 10_000, "10000 characters: at most 500"),
        ("é" * (MAX_INSTRUCTION + 1), "501 characters"),
        ("\x1b[31mred", r"U\+001B"),
        ("end\x00", r"U\+0000"),
        ("turned \u202e round", r"U\+202E"),
        ("half \ud800 a pair", r"U\+D800"),
    ],
)
def test_what_cannot_be_taken_is_refused_in_words(text: str, said: str) -> None:
    with pytest.raises(InstructionError, match=said) as caught:
        normalized_instruction(text)
    assert "\n" not in str(caught.value) and isinstance(caught.value, CoreError)


def test_the_page_takes_as_many_characters() -> None:
    scripts = "\n".join(path.read_text() for path in STATIC.rglob("*.js"))
    limits = re.findall(r"LONGEST_INSTRUCTION = (\d+)", scripts)
    assert limits and {int(limit) for limit in limits} == {MAX_INSTRUCTION}


@pytest.mark.parametrize(
    "text", ["", "Stop!", "halt, now", "please stop the arm", "stop moving immediately.", "cancel everything"]
)
def test_words_that_stop(text: str) -> None:
    assert asks_to_stop(text)


@pytest.mark.parametrize("text", ["please", "!", "the arm", "stop the red block", "put it there", "bus stop"])
def test_words_that_do_not_stop(text: str) -> None:
    assert not asks_to_stop(text)
