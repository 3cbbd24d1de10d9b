"""From recorded episodes to a policy, in one command that goes on where it stopped."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from cliport_policy import learn
from cliport_policy.learn import Lesson, main

MakeEpisode = Callable[..., object]
MakeCheckpoint = Callable[..., Path]
pytestmark = pytest.mark.usefixtures("one_thread")
FEW = "--batch 2 --phrases 1 --device cpu --steps 2"


def test_what_is_held_out_stays_so_when_more_is_recorded(tmp_path: Path) -> None:
    paths = [tmp_path / f"2026112{n // 10}-1200{n % 10:02d}-abcd" for n in range(40)]
    held_out: set[Path] = set()
    for count in (10, 20, 40):
        lesson = Lesson.of(paths[:count], tmp_path)
        assert set(lesson.learned) | set(lesson.held_out) == set(paths[:count])
        assert not set(lesson.learned) & set(lesson.held_out)
        assert held_out <= set(lesson.held_out)
        held_out = set(lesson.held_out)
    assert 4 <= len(held_out) <= 14
    assert not Lesson.of(paths[:3], tmp_path).held_out
    assert all(Lesson.of(paths[n : n + 4], tmp_path).held_out for n in range(36))
    assert Lesson.of(paths[:4], tmp_path).folder != Lesson.of(paths[:5], tmp_path).folder


def test_a_few_episodes_become_a_policy_and_a_report(
    make_episode: MakeEpisode, tiny_checkpoint: MakeCheckpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for number in range(4):
        make_episode(tmp_path / "set", f"e{number}", seed=number)
    begun, out = tiny_checkpoint("compact"), tmp_path / "out"
    words = ["--from-bags", str(tmp_path / "set"), "--out", str(out), "--init", str(begun), "--train-options", FEW]
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert "pick and place within 20 mm" in shown and "-p checkpoint:=" in shown
    (folder,) = out.iterdir()
    report = json.loads((folder / "learned.json").read_text())
    assert sorted(report["learned"] + report["held_out"]) == ["e0", "e1", "e2", "e3"]
    assert report["held_out"] and report["before"]["steps"] == report["after"]["steps"] > 0
    assert report["before"] != report["after"]
    data = (folder / "data" / "meta.json").stat().st_mtime_ns
    assert main(words) == 0, "it is done already"
    assert (folder / "data" / "meta.json").stat().st_mtime_ns == data
    make_episode(tmp_path / "set", "e4", seed=4)
    assert main(words) == 0
    assert len(list(out.iterdir())) == 2, "what was learned before stays"


def test_it_says_when_it_was_stopped_and_goes_on(
    make_episode: MakeEpisode, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    make_episode(tmp_path / "set", "one")
    asked: list[list[str]] = []

    def stopped(argv: list[str]) -> int:
        asked.append(argv)
        folder = Path(argv[argv.index("--out") + 1])
        folder.mkdir(exist_ok=True)
        card = {"made_by": {"steps_done": 50 * len(asked), "train": {"steps": 100}}}
        (folder / "policy.json").write_text(json.dumps(card))
        return 0

    monkeypatch.setattr(learn.train, "main", stopped)
    words = [
        "--from-bags",
        str(tmp_path / "set"),
        "--out",
        str(tmp_path / "out"),
        "--init",
        "none",
        "--old",
        "data/old",
    ]
    assert main(words) == 130
    assert "stopped before its end; the same command goes on" in capsys.readouterr().err
    assert main(words) == 0
    assert "no episode was held out: record 4 or more" in capsys.readouterr().out
    assert asked[0] == asked[1] and "--init" not in asked[0]
    assert asked[0][1].endswith("/data:0.6") and asked[0][-2:] == ["--data", "data/old:0.4"]


def test_nothing_to_learn_from_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    assert main(["--from-bags", str(tmp_path / "empty"), "--out", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err.startswith("error: ") and not (tmp_path / "out").exists()
