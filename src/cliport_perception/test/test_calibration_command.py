"""The command line of calibrate: what cannot work is refused in one line, before a person does the work."""

from __future__ import annotations

from pathlib import Path

import pytest

from cliport_perception.calibration.cli import main
from cliport_perception.calibration.saving import check_writable
from cliport_perception.errors import CalibrationError


def test_a_place_that_cannot_be_written_is_refused_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    for out in (tmp_path / "file" / "camera.yaml", tmp_path):
        with pytest.raises(CalibrationError, match="cannot write"):
            check_writable(out)
        assert main(["--out", str(out)]) == 1
        assert "cannot write" in capsys.readouterr().err
    check_writable(tmp_path / "deep" / "camera.yaml")
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    "arguments",
    [["--static", "nan", "0", "0", "0", "0", "0", "1"], ["--board-at", "0", "0", "0", "0", "0", "nan"],
     ["--intrinsics", "nan", "1", "1", "1", "1", "1"], ["--outliers", "inf"], ["--print-scale", "much"]],
)  # fmt: skip
def test_options_that_are_no_numbers_are_refused(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as caught:
        main(arguments)
    assert caught.value.code == 2 and "is not a finite number" in capsys.readouterr().err


def test_too_few_samples_are_refused_before_the_work(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--samples", "9"]) == 1
    assert "--samples must be 10 or more, got 9" in capsys.readouterr().err
    assert main(["--board-at", *"000000", "--samples", "0"]) == 1
    assert "--samples must be 1 or more, got 0" in capsys.readouterr().err


def test_a_base_frame_of_two_words_is_refused_before_the_work(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--base-frame", "my base"]) == 1
    assert "--base-frame is 'my base'" in capsys.readouterr().err
