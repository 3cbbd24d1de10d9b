"""`ros2 run demo_tool episodes`, verb by verb."""

from __future__ import annotations

import errno
import shutil
from pathlib import Path
from unittest.mock import patch

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


@pytest.fixture(scope="module")
def setup() -> CaptureSetup:
    camera = CameraModel(64, 48, 60.0, 60.0, 31.5, 23.5)
    pose = Pose.looking_at((1.0, 0.0, 0.8), (0.45, 0.0, 0.0))
    return CaptureSetup(WorkspaceSpec(), camera, "camera_optical", "panda_link0", pose)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory, setup: CaptureSetup) -> Path:
    return record(tmp_path_factory.mktemp("sets") / "blocks", setup, ("one", "two"))


@pytest.fixture
def path(tmp_path: Path, recorded: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A data set of the test's own, in the folder where it runs."""
    monkeypatch.chdir(tmp_path)
    return Path(shutil.copytree(recorded, tmp_path / "blocks"))


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


def test_the_list_says_what_each_episode_is(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mark", str(path), "failure", "two"]) == 0 and main(["list", str(path)]) == 0
    size = sum(info.bytes for info in DataSet.open(path).episodes()) / 1e6
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if not line.startswith("    !")] == [
        "one    2 steps  unmarked    put the red block in it",
        "two    2 steps  failure     put the red block in it",
        f"2 episodes, 4 steps, {size:.1f} MB",
    ]
    assert main(["list", str(path), "--trash"]) == 0 and capsys.readouterr().out == "the trash is empty\n"
    assert main(["delete", str(path), "one", "two"]) == 0
    said = "2 in the trash: `restore` brings them back, `empty-trash` removes them for good\n"
    assert capsys.readouterr().out == said
    assert main(["empty-trash", str(path)]) == 0 and capsys.readouterr().out == "2 episodes removed for good\n"


def test_each_step_is_printed(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["show", str(path), "one", "--out", "sheet.png"]) == 0
    action = "pick_place, clicked, pick (0.400, -0.100) m, place (0.500, 0.200) m"
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["  0  put the red block in it", f"     {action}, grasp missed: nothing between the fingers"]
    assert lines[2] == "  1  put the red block in it" and lines[-1] == "the steps are on sheet.png"
    assert Path("sheet.png").exists() and not Path("one.png").exists()


def test_statistics_are_counted(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["mark", str(path), "success", "one"]) == 0 and main(["stats", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if not line.startswith("!")] == [
        "4 steps in 2 episodes, 4 of them executed",
        "episodes         1  success",
        "episodes         1  unmarked",
        "primitive        4  pick_place",
        "chosen by        4  clicked",
        "colour word      4  red",
        "instruction      4  put the red block in it",
        "picks in         1  of 32 squares of 10 cm",
        "places in        1  of 32 squares of 10 cm",
        "the picture is blocks_statistics.png",
    ]
    assert Path("blocks_statistics.png").stat().st_size > 1000


def test_a_check_of_all_says_how_many_are_amiss(
    path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = {"one": ["first", "second"], "two": []}
    monkeypatch.setattr("demo_tool.episodes_cli.check_episode", lambda episode, setup: found[episode.name])
    assert main(["check", str(path)]) == 1
    assert capsys.readouterr().out.splitlines() == [
        "one  ", "    ! first", "    ! second", "two  ok", "1 episodes with something amiss",
    ]  # fmt: skip
    assert main(["check", str(path), "two"]) == 0
    assert capsys.readouterr().out.splitlines() == ["two  ok", "nothing is amiss"]


def test_a_split_draws_from_seed_0_and_takes_numbers_or_shares(path: Path, setup: CaptureSetup) -> None:
    record(path.with_name("other"), setup, tuple("abcdef"))
    for seed in ([], ["--seed", "0"]):
        assert main(["split", "other", f"n{len(seed)}=3", *seed]) == 0
    parts = [[info.name for info in DataSet.open(Path(f"other_n{n}")).episodes()] for n in (0, 2)]
    assert parts[0] == parts[1] and len(parts[0]) == 3
    with pytest.raises(SystemExit) as refusal:
        main(["split", "other", "x=half"])
    assert refusal.value.code == 2


@pytest.mark.parametrize(("raised", "code"), [(BrokenPipeError(), 1), (KeyboardInterrupt(), 130)])
def test_an_interrupted_list_ends_without_a_trace(path: Path, raised: BaseException, code: int) -> None:
    with patch.object(DataSet, "episodes", side_effect=raised), patch("sys.stderr") as errors:
        assert main(["list", str(path)]) == code
    assert errors.close.called is (code == 1)


def test_an_error_without_a_file_names_the_data_set(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with patch.object(DataSet, "episodes", side_effect=OSError("no luck")):
        assert main(["list", str(path)]) == 1
    assert capsys.readouterr().err == f"error: {path}: no luck\n"


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
