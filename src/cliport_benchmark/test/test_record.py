"""The expert's demonstrations as bags: whole images, true poses, and errors of one line."""

from pathlib import Path

import numpy as np
import pytest

from cliport_benchmark.record_cli import main
from cliport_episodes.bags import decode, read_messages
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import Source
from cliport_episodes.reader import Episode
from cliport_perception import WorkspaceSpec
from cliport_policy.data.from_bags import demo_of
from sim_bridge.colors import COLORS

TASK = "put-blocks-in-bowls-full"
SENTENCE = "put the orange blocks in a purple bowl"


@pytest.fixture(scope="module")
def episode(tmp_path_factory: pytest.TempPathFactory) -> Episode:
    folder = tmp_path_factory.mktemp("record")
    (folder / "sentences.txt").write_text(f"{SENTENCE}\n")
    arguments = ["--task", TASK, "--episodes", "1", "--instructions", str(folder / "sentences.txt")]
    assert main([*arguments, "--out", str(folder / "set")]) == 0
    data_set = DataSet.open(folder / "set")
    (info,) = data_set.episodes()
    return data_set.episode(info.name)


def test_an_episode_shows_what_was_done(episode: Episode) -> None:
    assert episode.success is True and episode.complaints == () and episode.final is not None
    workspace = WorkspaceSpec()
    assert episode.setup.workspace == workspace
    for step in episode.steps:
        record, seen = step.record, step.observation()
        assert (record.instruction, record.source) == (SENTENCE, Source.EXPERT)
        assert record.executed and record.outcome == 0 and record.grasp_centroid is not None
        assert record.grasp_centroid[:2] == pytest.approx((record.pick.x, record.pick.y), abs=0.01)
        assert seen.color.shape == (540, 960, 3) and np.isfinite(seen.depth_m).mean() > 0.9
        assert len(seen.joint_positions) == 9
        heightmap, demo = seen.heightmap(workspace), demo_of(record, workspace)
        color = heightmap.color[demo.pick_row, demo.pick_col].astype(float)
        assert nearest(color) == "orange"
        assert heightmap.height[demo.pick_row, demo.pick_col] == pytest.approx(0.04, abs=0.01)
        assert record.stamp_ns == seen.stamp_ns
    stamps = [step.record.stamp_ns for step in episode.steps]
    assert stamps == sorted(stamps) and episode.final.stamp_ns - stamps[-1] > 3e9  # the arm needs its time


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
    assert "/tf_static" in messages and "/joint_states" in messages
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
