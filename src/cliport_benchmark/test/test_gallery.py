"""The contact sheet and the videos: every scene has its cell, words are broken where they must be."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from cliport_benchmark import film, gallery_cli
from cliport_benchmark.contact_sheet import Captioned, contact_sheet, wrapped
from cliport_benchmark.errors import DataFolderError
from cliport_benchmark.gallery_cli import main
from cliport_benchmark.task_names import task_names
from sim_bridge.tasks import DEMO_TASKS, LANGUAGE_SPLITS

BOWLS = "put-blocks-in-bowls-seen-colors"


def test_names_are_lists_aliases_and_groups_each_once() -> None:
    assert task_names("all") == list(LANGUAGE_SPLITS) and len(LANGUAGE_SPLITS) == 18
    assert task_names("demo, packing-shapes,packing-unseen-shapes") == [*DEMO_TASKS, "packing-unseen-shapes"]


def test_a_sheet_holds_every_picture_and_whole_sentences() -> None:
    pictures = [Captioned(f"task {i}", np.full((90, 160, 3), 40 * i, np.uint8), "put it there") for i in range(5)]
    short = contact_sheet(pictures, columns=2)
    for i in range(5):
        assert (short == 40 * i).all(axis=-1).sum() >= 90 * 160
    sentence = "put the letter R shape in the left letter R shape hole of the brown kit"
    assert " ".join(wrapped(sentence, 160)) == sentence and len(wrapped(sentence, 160)) > 2
    long = contact_sheet([*pictures, Captioned("t", pictures[0].picture, sentence)], columns=2)
    assert long.shape[0] > short.shape[0] and long.shape[1] == short.shape[1]


def test_command_line_writes_sheet_and_video(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(film, "EVERY", 0.5)
    out, videos = tmp_path / "docs" / "sheet.png", tmp_path / "videos"
    assert main(["--out", str(out), "--videos", str(videos), "--tasks", BOWLS, "--seed", "1"]) == 0
    picture = np.asarray(Image.open(out))
    assert picture.shape[0] > 338 and picture[180, 300].max() < 255
    (path,) = videos.iterdir()
    video = cv2.VideoCapture(str(path))
    assert path.name == f"{BOWLS}.mp4" and video.get(cv2.CAP_PROP_FRAME_COUNT) > 12
    first = video.read()[1].astype(int)
    video.set(cv2.CAP_PROP_POS_FRAMES, 6)
    assert (np.abs(video.read()[1].astype(int) - first) > 60).sum() > 500  # the arm has come into view


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--tasks", "packing-boxs"], "did you mean packing-boxes"),
        (["--split", "tset"], "did you mean test"),
        (["--seed", "-1"], "seed must be 0"),
        (["--out", "/proc/none/sheet.png"], "cannot make the folder /proc/none"),
        (["--out", "sheet.what"], "cannot write --out sheet.what"),
    ],
)
def test_bad_input_is_one_clear_line(
    extra: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["--tasks", BOWLS, "--out", str(tmp_path / "s.png"), *extra]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and message in error and error.count("\n") == 1


def test_the_folder_of_videos_is_made_with_those_above_it(tmp_path: Path) -> None:
    for _ in range(2):
        gallery_cli._make_folder(tmp_path / "one" / "two")
    assert (tmp_path / "one" / "two").is_dir()
    (tmp_path / "file").write_text("")
    with pytest.raises(DataFolderError, match=r"cannot make the folder .*/file/two: Not a directory"):
        gallery_cli._make_folder(tmp_path / "file" / "two")
