"""Names that become paths, and instructions."""

import pytest

from cliport_episodes.errors import BadNameError, InstructionError
from cliport_episodes.names import check_instruction, check_name


@pytest.mark.parametrize("name", ["blocks", "20261121-131502-ab12", "a.b_c-D9", "_x", "-"])
def test_plain_names_pass(name: str) -> None:
    assert check_name("data set", name) == name


@pytest.mark.parametrize(
    "name", ["", ".", "..", "../x", "a/b", "/etc", ".hidden", "a b", "ä", "a\n", "a\0", "x" * 101, "a\\b"]
)
def test_whatever_could_leave_the_folder_is_refused(name: str) -> None:
    with pytest.raises(BadNameError, match="data set name"):
        check_name("data set", name)


def test_an_instruction_is_stored_in_one_line() -> None:
    assert check_instruction("  把红色方块\n 放进碗里 ") == "把红色方块 放进碗里"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("   ", "empty"),
        ("x" * 10_000, "10000 characters"),
        ("\x1b[31mred", r"U\+001B"),
    ],
)
def test_what_cannot_be_stored_is_refused_in_words(text: str, said: str) -> None:
    with pytest.raises(InstructionError, match=said):
        check_instruction(text)
