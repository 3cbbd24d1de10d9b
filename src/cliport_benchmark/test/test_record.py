"""The expert's demonstrations as bags: whole images, true poses, none made twice, and errors of one line."""

from pathlib import Path

import numpy as np
import pytest

from cliport_benchmark.record import RecordConfig
from cliport_benchmark.record_cli import main
from cliport_benchmark.variation import Variation
from cliport_core import WorkspaceSpec
from cliport_episodes.bags import decode, read_messages
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import Source
from cliport_episodes.reader import Episode
from cliport_episodes.writer import EpisodeWriter
from cliport_policy.data.from_bags import demo_of
from sim_bridge.colors import COLORS

TASK = "put-blocks-in-bowls-full"
SENTENCE = "put the orange blocks in a purple bowl"


@pytest.fixture(scope="module")
def command(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Return the command that makes the one episode."""
    folder = tmp_path_factory.mktemp("record")
    (folder / "sentences.txt").write_text(f"{SENTENCE}\n")
    arguments = ["--task", TASK, "--episodes", "1", "--instructions", str(folder / "sentences.txt")]
    return [*arguments, "--out", str(folder / "set")]


@pytest.fixture(scope="module")
def episode(command: list[str]) -> Episode:
    assert main(command) == 0
    data_set = DataSet.open(Path(command[-1]))
    (info,) = data_set.episodes()
    return data_set.episode(info.name)


def test_an_episode_shows_what_was_done(episode: Episode) -> None:
    assert episode.success is True and episode.complaints == () and episode.final is not None
    workspace = WorkspaceSpec()
    assert episode.setup.workspace == workspace
    for step in episode.steps:
        record, seen = step.record, step.observation()
        assert (record.instruction, record.source) == (SENTENCE, Source.EXPERT)
        assert record.result is not None and record.result.outcome == 0 and record.result.grasp_centroid is not None
        assert record.result.grasp_centroid[:2] == pytest.approx((record.action.pick.x, record.action.pick.y), abs=0.01)
        assert seen.color.shape == (540, 960, 3) and np.isfinite(seen.depth_m).mean() > 0.9
        assert len(seen.joint_positions) == 9
        heightmap, demo = seen.heightmap(workspace), demo_of(record, workspace)
        color = heightmap.color[demo.pick_row, demo.pick_col].astype(float)
        assert nearest(color) == "orange"
        assert heightmap.height[demo.pick_row, demo.pick_col] == pytest.approx(0.04, abs=0.01)
        assert record.stamp_ns == seen.stamp_ns
    stamps = [step.record.stamp_ns for step in episode.steps]
    assert stamps == sorted(stamps) and episode.final.stamp_ns - stamps[-1] > 3e9  # the arm needs its time


def test_what_is_there_is_not_made_again(
    command: list[str], episode: Episode, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {path: path.stat().st_mtime_ns for path in episode.path.iterdir()}
    assert main(command) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[0] == "1 of 1 episodes are there already: skipped" and len(said) == 2
    assert {path: path.stat().st_mtime_ns for path in episode.path.iterdir()} == before
    assert list(episode.path.parent.iterdir()) == [episode.path]


def test_other_seeds_splits_and_sentences_are_other_episodes() -> None:
    config = RecordConfig(TASK, "train", 7, 2)
    assert [config.name(i) for i in range(2)] == [f"{TASK}-train-000007", f"{TASK}-train-000008"]
    names = {config.name(0), RecordConfig(TASK, "val", 7, 1).name(0)}
    for sentence in (SENTENCE, "put the red blocks in a green bowl"):
        names.add(RecordConfig(TASK, "train", 7, 1, (sentence,)).name(0))
    varied = [None, (10.0, 1.0), (20.0, 1.0)]
    for errors in varied:
        variation = Variation.parse("mounting", errors)
        names.add(RecordConfig(TASK, "train", 7, 1, variation=variation).name(0))
    assert len(names) == 4 + len(varied) and f"{TASK}-train-000007-mounting" in names
    assert RecordConfig(TASK, "train", 6, 2).name(1) in names


def test_what_was_interrupted_is_made_anew_and_nothing_else_is_touched(
    command: list[str],
    episode: Episode,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    data_set = DataSet.create(tmp_path / "set", episode.setup)
    for name in ("by-hand", episode.name):  # the latter as a killed process leaves it
        writer = EpisodeWriter.create(data_set.path, episode.setup, name)
        writer.add_step([], episode.steps[0].record)
        writer.close()
    arguments = [*command[:-1], str(data_set.path)]
    with monkeypatch.context() as patched:
        patched.setattr(EpisodeWriter, "finish", press_ctrl_c)  # its last step is done
        assert main(arguments) == 130
    errors = capsys.readouterr().err.splitlines()
    assert errors == ["error: interrupted; the same command continues where this one stopped"]
    assert [info.name for info in data_set.episodes()] == ["by-hand"]
    assert data_set.trashed() == [episode.name, f"{episode.name}-2"]
    assert main(arguments) == 0
    found = {info.name: info for info in data_set.episodes()}
    assert found.keys() == {"by-hand", episode.name} and not found["by-hand"].finished
    assert found[episode.name].finished and found[episode.name].n_steps == len(episode.steps)


def press_ctrl_c(*_: object) -> None:
    raise KeyboardInterrupt


def nearest(color: np.ndarray) -> str:
    """The colour of the same hue and saturation, whatever the light."""
    unit = color / np.linalg.norm(color)
    return max(COLORS, key=lambda name: float(unit @ np.array(COLORS[name]) / np.linalg.norm(COLORS[name])))


def test_the_bag_is_as_a_camera_driver_writes_it(episode: Episode) -> None:
    messages = {raw.topic: raw for raw in read_messages(episode.path / "step_000.mcap")}
    depth = decode(messages["/camera/aligned_depth_to_color/image_raw"])
    assert (depth.encoding, depth.width, depth.height) == ("16UC1", 960, 540)
    info = decode(messages["/camera/color/camera_info"])
    assert info.header.frame_id == depth.header.frame_id and info.k[0] == pytest.approx(540.0)
    joints = decode(messages["/joint_states"])
    assert "/tf_static" in messages and len(joints.name) == len(joints.velocity) == len(joints.effort) == 9
    assert list(joints.effort[-2:]) == [0.0, 0.0]  # the hand measures none
    assert messages["/camera/color/camera_info"].stamp_ns < messages["/camera/color/image_raw"].stamp_ns


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--task", "put-block"], "put-block"),
        (["--task", TASK, "--episodes", "0"], "--episodes must be 1 or more"),
        (["--task", TASK, "--instructions", "{tmp}/none.txt"], "cannot read --instructions"),
        (["--task", TASK, "--instructions", "{tmp}/empty.txt"], "holds no sentence"),
        (["--task", TASK, "--instructions", "{tmp}/odd.txt"], "names no"),
        (["--task", TASK, "--out", "{tmp}"], "not an empty folder"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty.txt").write_text("\n")
    (tmp_path / "odd.txt").write_text("tidy up\n")
    given = [argument.format(tmp=tmp_path) for argument in arguments]
    assert main(["--episodes", "1", "--out", str(tmp_path / "set"), *given]) == 1
    errors = capsys.readouterr().err.strip().splitlines()
    assert len(errors) == 1 and errors[0].startswith("error: ") and message in errors[0]
