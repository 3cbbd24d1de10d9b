"""`ros2 run demo_tool episodes`, verb by verb."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from cliport_core.action import PickPlaceAction
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import PixelBox, Source, StepRecord
from cliport_episodes.writer import EpisodeWriter
from cliport_perception.camera_model import CameraModel
from demo_tool.episodes_cli import main


@pytest.fixture
def setup() -> CaptureSetup:
    camera = CameraModel(64, 48, 60.0, 60.0, 31.5, 23.5)
    pose = Pose.looking_at((1.0, 0.0, 0.8), (0.45, 0.0, 0.0))
    return CaptureSetup(WorkspaceSpec(), camera, "camera_optical", "panda_link0", pose)


@pytest.fixture
def path(tmp_path: Path, setup: CaptureSetup, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return record(tmp_path / "blocks", setup, ("one", "two"))


def record(path: Path, setup: CaptureSetup, names: tuple[str, ...], text: str = "put the red block in it") -> Path:
    step = StepRecord(
        step=0,
        stamp_ns=1_700_000_000_000_000_000,
        frame_id="panda_link0",
        instruction=text,
        source=Source.CLICKED,
        pick_box=PixelBox(10, 20, 18, 30),
        place_box=None,
        pick_rotation=3,
        place_rotation=0,
        n_rotations=36,
        action=PickPlaceAction(PlanarPose(0.4, -0.1, 0.5), PlanarPose(0.5, 0.2, 0.0)),
        result=ActionResult(Outcome.GRASP_MISSED, "nothing between the fingers"),
    )
    DataSet.create(path, setup)
    for name in names:
        writer = EpisodeWriter.create(path, setup, name)
        writer.add_step([], step)
        writer.add_step([], step)
        writer.finish([], None)
    return path


def test_every_edit_is_done(path: Path, setup: CaptureSetup, capsys: pytest.CaptureFixture[str]) -> None:
    data_set = DataSet.open(path)
    at = str(path)
    for words in (
        ["relabel", at, "one", "sweep the 红色 blocks", "--step", "1"],
        ["mark", at, "success", "one", "two"],
        ["trim", at, "one", "--first", "1"],
        ["delete", at, "two"],
    ):
        assert main(words) == 0
    (info,) = data_set.episodes()
    assert (info.n_steps, info.success, info.instructions) == (1, True, ("sweep the 红色 blocks",))
    assert main(["list", at]) == 0 and main(["list", at, "--trash"]) == 0
    printed = capsys.readouterr().out
    assert "one    1 steps  success     sweep the 红色 blocks" in printed and printed.endswith("two\n")
    assert main(["restore", at, "two"]) == 0 and len(data_set.episodes()) == 2
    assert main(["delete", at, "two"]) == 0 and main(["empty-trash", at]) == 0 and data_set.trashed() == []
    record(path.with_name("other"), setup, ("three", "one"), "push it")
    assert main(["merge", at, "other"]) == 0
    assert [info.name for info in data_set.episodes()] == ["one", "one-2", "three"]
    assert main(["split", at, "train=2", "val=1", "--seed", "4"]) == 0
    assert "blocks_train: 2 episodes\nblocks_val: 1 episodes" in capsys.readouterr().out
    assert main(["rebuild", at]) == 0 and "index of 3 episodes" in capsys.readouterr().out


def test_what_was_recorded_is_shown(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(path), "one"]) == 0 and main(["stats", str(path), "--out", "bias.png"]) == 0
    printed = capsys.readouterr().out
    assert "pick (0.400, -0.100) m" in printed and "grasp missed: nothing between the fingers" in printed
    assert "instruction      4  put the red block in it" in printed and "1  of 32 squares" in printed
    assert Path("one.png").stat().st_size > 1000 and Path("bias.png").stat().st_size > 1000


def test_a_check_finds_what_is_amiss(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(path), "one"]) == 1
    assert "step 0 of episode 'one' has no message on /camera/color/image_raw" in capsys.readouterr().out


def test_a_bag_cannot_command_the_terminal(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    metadata = path / "episodes" / "one" / "metadata.yaml"
    label = """    instructions: '{"0": "\\\\u001b[31mred"}'\n"""
    metadata.write_text(metadata.read_text().replace("  custom_data:\n", f"  custom_data:\n{label}"))
    assert main(["list", str(path)]) == 0
    printed = capsys.readouterr().out
    assert "[31mred" in printed and "\x1b" not in printed


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["list", "nowhere"], "no data set"),
        (["show", "blocks", "gone"], "no episode 'gone'"),
        (["show", "blocks", "../one"], "cannot be used"),
        (["relabel", "blocks", "one", "x" * 10_000], "10000 characters"),
        (["trim", "blocks", "one", "--first", "5"], "leave no step"),
        (["trim", "blocks", "one", "--first", "-1"], "has no step -1: it has 0..1"),
        (["relabel", "blocks", "one", "x", "--step", "-1"], "has no step -1: it has 0..1"),
        (["merge", "blocks", "blocks"], "itself"),
        (["split", "blocks", "train=9"], "too few"),
        (["split", "blocks", "train=nan"], "give shares"),
        (["split", "blocks", "train=inf"], "give shares"),
        (["split", "blocks", "train=0.5", "val=nan"], "give shares"),
        (["split", "blocks", "train=1", "--seed", "-1"], "seed of a split is -1: give 0 or more"),
        (["split", "blocks", "train=0.8", "train=0.2"], "two parts have the name 'train'"),
        (["stats", "blocks", "--out", "no/where.png"], "cannot write"),
    ],
)
def test_a_mistake_is_one_line(path: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str) -> None:
    assert main(words) == 1
    error = capsys.readouterr().err
    assert error.startswith("error: ") and said in error and error.count("\n") == 1


def test_a_merge_says_whether_all_were_added(
    path: Path, setup: CaptureSetup, capsys: pytest.CaptureFixture[str]
) -> None:
    record(path.with_name("other"), setup, ("three",), "push it")
    assert main(["merge", str(path), "other"]) == 0 and main(["merge", str(path), "other"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "1 of the 1 episodes of other are added",
        "0 of the 1 episodes of other are added; the others were here already",
    ]


def test_what_cannot_be_read_is_one_line(
    path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(*_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(path / "episodes" / "one"))

    monkeypatch.setattr(DataSet, "episodes", refused)
    assert main(["list", str(path)]) == 1
    error = capsys.readouterr().err
    assert error == f"error: {path}/episodes/one: Permission denied\n"
