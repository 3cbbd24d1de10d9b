"""Arguments of commands at their limits, and what is said beyond them."""

from __future__ import annotations

import pytest
from overhead_camera import CAMERA

from cliport_core.action import Primitive
from cliport_episodes.demonstration import PixelBox
from demo_tool.arguments import box_of, instruction_of, number_of, primitive_of, text_of, verdict_of
from demo_tool.errors import CommandError


@pytest.mark.parametrize(("value", "number"), [(2, 2), (5, 5), (3.0, 3)])
def test_whole_numbers_within_the_limits(value: float, number: int) -> None:
    found = number_of({"n": value}, "n", 2, 5)
    assert found == number and type(found) is int


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (1, "'n' must be 2 to 5, got 1"),
        (6, "'n' must be 2 to 5, got 6"),
        (2.5, "'n' must be a whole number, got 2.5"),
        (True, "'n' must be a whole number, got True"),
        ("3", "'n' must be a whole number, got '3'"),
        ("x" * 38, f"'n' must be a whole number, got '{'x' * 38}'"),
        ("x" * 39, f"'n' must be a whole number, got '{'x' * 36}..."),
    ],
)
def test_other_numbers_are_refused(value: object, words: str) -> None:
    with pytest.raises(CommandError) as refusal:
        number_of({"n": value}, "n", 2, 5)
    assert str(refusal.value) == words


@pytest.mark.parametrize(
    ("given", "box"),
    [
        ([0, 0, 100, 120], PixelBox(0, 0, 100, 120)),
        ((10.4, 20.6, 30.4, 40.6), PixelBox(10, 21, 30, 41)),
        ([5, 6, 6, 7], PixelBox(5, 6, 6, 7)),
    ],
)
def test_boxes_of_whole_pixels_within_the_picture(given: object, box: PixelBox) -> None:
    assert box_of({"box": given}, CAMERA) == box


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ([10, 20, 10, 20], "the box is empty: 0 pixels wide and 0 high; draw it larger"),
        ([10, 20, 15, 19], "the box is empty: -1 pixels wide and 5 high; draw it larger"),
        ([12, 20, 10, 30], "the box is empty: 10 pixels wide and -2 high; draw it larger"),
        (
            [0, -1, 9, 9],
            "the box (rows 0 to 9, columns -1 to 9) reaches out of the picture of 100 rows and 120 columns",
        ),
        (
            [0, 0, 101, 9],
            "the box (rows 0 to 101, columns 0 to 9) reaches out of the picture of 100 rows and 120 columns",
        ),
        (
            [0, 0, 9, 121],
            "the box (rows 0 to 9, columns 0 to 121) reaches out of the picture of 100 rows and 120 columns",
        ),
        ([0, 0, 9, 1e6], "'box' must be [top, left, bottom, right] in pixels, got [0, 0, 9, 1000000.0]"),
        ([0, 0, 9, 9, 9], "'box' must be [top, left, bottom, right] in pixels, got [0, 0, 9, 9, 9]"),
    ],
)
def test_other_boxes_are_refused(given: object, words: str) -> None:
    with pytest.raises(CommandError) as refusal:
        box_of({"box": given}, CAMERA)
    assert str(refusal.value) == words


def test_texts_verdicts_and_primitives() -> None:
    assert text_of({"name": ""}, "name") == "" and instruction_of({"text": " put  it\tthere "}) == "put it there"
    assert [verdict_of({"success": value}) for value in (True, False, None)] == [True, False, None]
    assert verdict_of({}) is None and primitive_of({"name": "fold"}) is Primitive.FOLD
    with pytest.raises(CommandError, match="'success' must be true, false or null, got 1"):
        verdict_of({"success": 1})
    with pytest.raises(CommandError, match="'name' must be one of pick_place, sweep, fold, got 'throw'"):
        primitive_of({"name": "throw"})
