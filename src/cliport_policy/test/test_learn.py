"""From recorded episodes to a policy, in one command that goes on where it stopped."""

import json
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cliport_core.action import Primitive
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.data_set import DataSet
from cliport_policy import learn
from cliport_policy.learn import Lesson, main
from cliport_policy.training.initial import Initial
from cliport_policy.training.pace import LEAST_STEPS, MOST_STEPS, steps_within
from cliport_policy.training.trainer import Trainer

MakeEpisode = Callable[..., object]
MakeCheckpoint = Callable[..., Path]
pytestmark = pytest.mark.usefixtures("one_thread")
FEW = "--batch 2 --phrases 1 --device cpu --steps 2"


def test_what_is_held_out_stays_so_when_more_is_recorded(tmp_path: Path) -> None:
    paths = [tmp_path / f"2026112{n // 10}-1200{n % 10:02d}-abcd" for n in range(40)]
    for path in paths:
        path.mkdir()
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


def _with_a_stop_in_the_first(trainer: Trainer, batches: Any, step: Any = Trainer._train_step) -> Any:
    if trainer.step == 0:
        signal.raise_signal(signal.SIGINT)
    return step(trainer, batches)


def test_a_few_episodes_become_a_policy_and_a_report(
    make_episode: MakeEpisode, tiny_checkpoint: MakeCheckpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    for number in range(4):
        make_episode(tmp_path / "set", f"e{number}", seed=number)
    begun, out = tiny_checkpoint("compact"), tmp_path / "out"
    words = ["--from-bags", str(tmp_path / "set"), "--out", str(out), "--init", str(begun), "--train-options", FEW]
    with monkeypatch.context() as patched:
        patched.setattr(Trainer, "_train_step", _with_a_stop_in_the_first)
        assert main([*words, "--report", str(tmp_path / "report.json")]) == 130
    stopped = json.loads((tmp_path / "report.json").read_text())
    assert (stopped["steps_done"], stopped["steps"]) == (1, 2)
    assert stopped["before"] != stopped["after"] and Path(stopped["policy"], "policy.safetensors").is_file()
    (data,) = (path.stat().st_mtime_ns for path in out.glob("*/data/meta.json"))
    assert "stopped after 1 of 2 steps; the same command goes on" in capsys.readouterr().err
    assert main(words) == 0
    shown = capsys.readouterr().out
    assert "pick and place within 20 mm" in shown and "-p checkpoint:=" in shown
    (folder,) = out.iterdir()
    report = json.loads((folder / "learned.json").read_text())
    assert sorted(report["learned"] + report["held_out"]) == ["e0", "e1", "e2", "e3"]
    assert report["held_out"] and report["before"]["steps"] == report["after"]["steps"] > 0
    assert report["before"] != report["after"] and report["init"] == str(begun)
    assert [row[0] for row in report["table"]] == ["pick and place within 20 mm", "pick, median", "place, median"]
    assert all(before.endswith(("%", "mm")) and after.endswith(("%", "mm")) for _, before, after in report["table"])
    assert (folder / "data" / "meta.json").stat().st_mtime_ns == data, "it went on with what was made"
    make_episode(tmp_path / "set", "e4", seed=4)
    assert main(words) == 0
    DataSet.open(tmp_path / "set").relabel("e4", "put the blue blocks in a green bowl")
    (tmp_path / "set" / "dataset.yaml").unlink()  # which is made again
    assert main(words) == 0
    assert len(list(out.iterdir())) == 3, "what was learned before stays"


def test_it_says_when_it_was_stopped_and_goes_on(
    make_episode: MakeEpisode, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    make_episode(tmp_path / "set", "one")
    asked: list[list[str]] = []
    card = SimpleNamespace(made_by={"steps_done": 50, "train": {"steps": 100}})
    monkeypatch.setattr(learn.train, "main", lambda argv: asked.append(argv))
    monkeypatch.setattr(learn, "load_card", lambda _: card)
    monkeypatch.setattr(learn, "measured_pace", lambda *_: 0.5)
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
    assert main([*words, "--train-options", "--steps 100"]) == 130
    assert "stopped after 50 of 100 steps; the same command goes on" in capsys.readouterr().err
    card.made_by["steps_done"] = 0
    assert main([*words, "--train-options", "--steps 100"]) == 130
    assert "interrupted; the same command goes on" in capsys.readouterr().err
    card.made_by["steps_done"] = 100
    assert main(words) == 0
    assert "no episode was held out: record 4 or more" in capsys.readouterr().out
    (folder,) = (tmp_path / "out").iterdir()
    begun = ["--data", f"{folder}/data:0.6", "--data", "data/old:0.4", "--out", f"{folder}/training"]
    by_pace = ["--steps", "900", "--set", "train.warmup_steps=90"]  # half an hour
    assert asked == [*2 * [[*begun, "--steps", "100"]], [*begun, *by_pace]]
    assert main([*words, "--with-failed"]) == 0 and main([*words[:-2], "--init", "default"]) == 0
    assert len(list((tmp_path / "out").iterdir())) == 3, "other ways are learned beside"


@pytest.mark.parametrize("primitive", [Primitive.PICK_PLACE, Primitive.SWEEP])
def test_it_begins_with_the_default_whatever_was_shown(
    make_episode: MakeEpisode, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    primitive: Primitive,
) -> None:  # fmt: skip
    make_episode(tmp_path / "set", "one", primitive=primitive)
    asked: list[list[str]] = []
    card = SimpleNamespace(made_by={"steps_done": 1, "train": {"steps": 1}})
    monkeypatch.setattr(learn.train, "main", lambda argv: asked.append(argv))
    monkeypatch.setattr(learn, "load_card", lambda _: card)
    report = tmp_path / "report.json"
    monkeypatch.setattr(Initial, "check_workspace", lambda *_: None)  # an episode here has a small one
    assert main(["--from-bags", str(tmp_path / "set"), "--out", str(tmp_path / "out"), "--report", str(report)]) == 0
    assert asked[0][-2:] == ["--init", "default"]
    assert "it begins with default" in capsys.readouterr().out
    found = json.loads(report.read_text())
    assert found["init"] == "default" and found["policy"] == str(next((tmp_path / "out").iterdir()) / "training")
    assert [row[1:] for row in found["table"]] == 3 * [["", ""]]


def test_in_another_workspace_it_begins_from_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    other = SimpleNamespace(workspace=replace(WorkspaceSpec(), x_max=0.7))
    monkeypatch.setattr(learn, "load_demonstrations", lambda _: other)
    assert learn._beginning("auto", tmp_path) is None
    said = capsys.readouterr().out
    assert said.startswith("it begins from nothing: ") and said.count("x_max 0.7 not 0.65") == 1


def test_it_takes_the_minutes_that_it_is_given(
    make_episode: MakeEpisode, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
    tiny_checkpoint: MakeCheckpoint,
) -> None:  # fmt: skip
    make_episode(tmp_path / "set", "one")
    asked: list[list[str]] = []
    card = SimpleNamespace(made_by={"steps_done": 1, "train": {"steps": 1}})
    monkeypatch.setattr(learn.train, "main", lambda argv: asked.append(argv))
    monkeypatch.setattr(learn, "load_card", lambda _: card)
    words = ["--from-bags", str(tmp_path / "set"), "--out", str(tmp_path / "out"), "--init"]
    words += [str(tiny_checkpoint("compact")), "--train-options", "--batch 2 --device cpu"]
    assert main([*words, "--minutes", "1e-6"]) == 0
    (folder,) = (tmp_path / "out").iterdir()
    length = json.loads((folder / "length.json").read_text())
    assert length["steps"] == LEAST_STEPS and length["pace"] > 0.0 and not (folder / "pace").exists()
    (folder / "length.json").write_text('{"steps": 77}')
    assert main([*words, "--minutes", "1e-6"]) == 0, "it goes on with the length that it has"
    assert "it takes 77 steps" in capsys.readouterr().out
    assert [words[words.index("--steps") + 1] for words in asked] == [str(LEAST_STEPS), "77"]
    assert main(words) == 0
    assert "--steps" not in asked[2], "the recipe knows"
    for text in ("0", "-3", "inf", "soon"):
        with pytest.raises(SystemExit):
            main([*words, "--minutes", text])
        assert "minutes" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("minutes", "pace", "steps"), [(10.0, 0.5, 300), (0.1, 0.5, LEAST_STEPS), (600.0, 0.5, 6000), (1.0, 1.0, 60)]
)
def test_steps_fit_into_the_minutes(minutes: float, pace: float, steps: int) -> None:
    assert steps_within(minutes, pace, MOST_STEPS) == steps


def test_a_folder_that_cannot_be_written_to_is_one_line(
    make_episode: MakeEpisode, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_episode(tmp_path / "set", "one")
    (tmp_path / "out").write_text("a file")
    assert main(["--from-bags", str(tmp_path / "set"), "--out", str(tmp_path / "out"), "--init", "none"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: cannot write ") and error.count("\n") == 1


def test_nothing_to_learn_from_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    assert main(["--from-bags", str(tmp_path / "empty"), "--out", str(tmp_path / "out")]) == 1
    assert capsys.readouterr().err.startswith("error: ") and not (tmp_path / "out").exists()
