"""Names that become paths, and instructions."""

import pytest

from cliport_episodes.errors import BadNameError, InstructionError
from cliport_episodes.names import MAX_INSTRUCTION, check_instruction, check_name


@pytest.mark.parametrize("name", ["blocks", "20261121-131502-ab12", "a.b_c-D9", "_x", "-"])
def test_plain_names_pass(name: str) -> None:
    assert check_name("data set", name) == name


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../x", "a/b", "/etc", ".hidden", "a b", "ä", "a\n", "a\0", "x" * 101, "a\\b"]
)
def test_whatever_could_leave_the_folder_is_refused(name: str) -> None:
    with pytest.raises(BadNameError, match="data set name"):
        check_name("data set", name)


@pytest.mark.parametrize(
    "text", ["put it there", "поставь красный кубик", "把红色方块放进碗里　吧", "می‌خواهم", "é" * MAX_INSTRUCTION]
)
def test_instructions_in_any_script_pass(text: str) -> None:
    assert check_instruction(f"  {text} ") == text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("   ", "empty"),
        ("x" * 10_000, "10000 characters"),
        ("two\nlines", r"U\+000A"),
        ("\x1b[31mred", r"U\+001B"),
        ("turned \u202e round", r"U\+202E"),
        ("half \ud800 a pair", r"U\+D800"),
    ],
)
def test_what_cannot_be_stored_is_refused_in_words(text: str, said: str) -> None:
    with pytest.raises(InstructionError, match=said):
        check_instruction(text)
