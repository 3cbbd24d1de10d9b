"""The page reads how far a training is from the line that `train` writes."""

import io

import pytest

from cliport_policy import learn
from cliport_policy.training.log import ProgressLine
from cliport_policy.training.trainer import Progress
from demo_tool.teach_now import _STOPPED, _TRAINED, BEGINNINGS


@pytest.mark.parametrize("step", [1, 150, 200])
def test_the_page_understands_the_trainings_line(step: int) -> None:
    out = io.StringIO()
    ProgressLine(out)(Progress(step, 200, {"locator": 2.31}, 1e-3, 31.0, 4.0))
    line = out.getvalue().rstrip("\n")
    found = _TRAINED.match(line)
    assert found is not None and (int(found[1]), int(found[2])) == (step, 200)
    assert line[found.end() :].strip().startswith("locator 2.310")


def test_the_page_offers_what_a_lesson_can_begin_with() -> None:
    assert BEGINNINGS == (learn.AUTO, learn.FROM_NOTHING)
    assert _STOPPED == learn.STOPPED
