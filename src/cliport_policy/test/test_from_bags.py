"""From recorded episodes to a training set: what is labelled lies where it was done, and what failed is left out."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from cliport_core.action import Primitive
from cliport_core.pose import Pose
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.demonstration import StepRecord
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.mixture import Mixture, Source
from cliport_policy.dataset import main

MakeEpisode = Callable[..., list[StepRecord]]
MISSED = 5


def test_labels_are_where_the_arm_went(make_episode: MakeEpisode, tmp_path: Path) -> None:
    records = make_episode(tmp_path / "set", "one")
    assert main(["--from-bags", str(tmp_path / "set"), "--out", str(tmp_path / "out")]) == 0
    data = load_demonstrations(tmp_path / "out")
    assert [frame.step for frame in data.frames] == [0, 1, 2]
    for frame, record in zip(data.frames, records, strict=False):
        demo, seen = frame.demos[0], data.observation(frame)
        for pixel, pose in ((demo.pick_pixel, record.action.pick), (demo.place_pixel, record.action.place)):
            x, y = data.workspace.pixel_to_xy(*pixel)
            assert max(abs(x - pose.x), abs(y - pose.y)) <= data.workspace.pixel_size / 2 + 1e-9
        red, blue = seen.color[demo.pick_pixel], seen.color[demo.place_pixel]
        assert int(red[0]) - int(red[2]) > 100 and int(blue[2]) - int(blue[0]) > 50
        assert (demo.pick_yaw, demo.place_yaw) == pytest.approx(
            (record.action.pick.yaw, record.action.place.yaw), abs=1e-5
        )
        assert demo.primitive is Primitive.PICK_PLACE
        assert demo.pick_yaw_period == pytest.approx(math.pi) and demo.instruction == record.instruction
    finished = data.frames[-1]
    assert finished.demos[0].done and finished.demos[0].instruction == records[-1].instruction
    assert data.goal_frames() == {0: 2, 1: 2, 2: 2}
    assert len(Mixture([Source(data)])) == 3


def test_the_label_is_in_the_middle_of_what_is_seen(make_episode: MakeEpisode, tmp_path: Path) -> None:
    """Through camera, depth, bag and heightmap: to a pixel."""
    make_episode(tmp_path / "set", "one", outcomes=(0,), seed=3)
    assert main(["--from-bags", str(tmp_path / "set"), "--out", str(tmp_path / "out")]) == 0
    data = load_demonstrations(tmp_path / "out")
    demo, color = data.frames[0].demos[0], data.observation(data.frames[0]).color.astype(int)
    for pixel, mask in (
        (demo.pick_pixel, color[..., 0] - color[..., 2] > 100),
        (demo.place_pixel, color[..., 2] - color[..., 0] > 50),
    ):
        assert np.abs(np.argwhere(mask).mean(axis=0) - pixel).max() <= 1.0


def test_what_failed_is_left_out_and_counted(
    make_episode: MakeEpisode, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_episode(tmp_path / "set", "a", outcomes=(MISSED, 0))
    make_episode(tmp_path / "set", "b", success=False)
    make_episode(tmp_path / "set", "c", success=None, outcomes=(0,))
    counts = {}
    for name, options in (("default", []), ("sure", ["--only-success"]), ("all", ["--with-failed"])):
        out = tmp_path / name
        assert main(["--from-bags", str(tmp_path / "set"), "--out", str(out), *options]) == 0
        counts[name] = json.loads((out / "meta.json").read_text())["counts"]
    assert (counts["default"]["episodes"], counts["default"]["steps"]) == (2, 2)
    assert counts["default"]["steps_left_out"] == {"grasp missed": 1}
    assert counts["default"]["episodes_left_out"] == {"marked as a failure": 1}
    assert counts["default"]["finished_scenes"] == 1  # of the one whose success was judged
    assert (counts["sure"]["episodes"], counts["sure"]["steps"]) == (1, 1)
    assert (counts["all"]["episodes"], counts["all"]["steps"], counts["all"]["finished_scenes"]) == (3, 4, 1)
    assert "left out: 1 step, grasp missed" in capsys.readouterr().out


def test_the_same_bags_give_the_same_bytes(make_episode: MakeEpisode, tmp_path: Path) -> None:
    make_episode(tmp_path / "set", "a")
    make_episode(tmp_path / "set", "b", seed=1)
    for name in ("first", "second"):
        assert main(["--from-bags", str(tmp_path / "set"), "--out", str(tmp_path / name)]) == 0
    episodes = [str(tmp_path / "set" / "episodes" / name) for name in "ab"]
    assert main(["--from-bags", *episodes, "--out", str(tmp_path / "third")]) == 0
    made = [{p.name: p.read_bytes() for p in (tmp_path / n).iterdir()} for n in ("first", "second", "third")]
    assert made[0] == made[1] == made[2] and len(made[0]) == 2


def test_a_camera_that_stands_elsewhere_is_refused_in_words(
    make_episode: MakeEpisode, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_episode(tmp_path / "here", "a", outcomes=(0,))
    setup = CaptureSetup.from_dict(yaml.safe_load((tmp_path / "here" / "dataset.yaml").read_text()))
    moved = Pose(setup.camera_in_base.rotation, setup.camera_in_base.translation + np.array([0.012, 0.0, 0.0]))
    make_episode(tmp_path / "there", "b", outcomes=(0,), setup=replace(setup, camera_in_base=moved))
    out = tmp_path / "out"
    assert main(["--from-bags", str(tmp_path / "here"), str(tmp_path / "there"), "--out", str(out)]) == 1
    error = capsys.readouterr().err.strip()
    assert "the camera stands 12 mm elsewhere" in error and "\n" not in error
    assert not out.exists() and {path.name for path in tmp_path.iterdir()} == {"here", "there"}


def test_an_episode_that_is_left_out_decides_nothing(make_episode: MakeEpisode, tmp_path: Path) -> None:
    make_episode(tmp_path / "here", "a", outcomes=(0,))
    setup = CaptureSetup.from_dict(yaml.safe_load((tmp_path / "here" / "dataset.yaml").read_text()))
    moved = Pose(setup.camera_in_base.rotation, setup.camera_in_base.translation + np.array([0.012, 0.0, 0.0]))
    failed = replace(setup, camera_in_base=moved)
    make_episode(tmp_path / "failed", "b", success=False, outcomes=(0,), setup=failed)
    arguments = ["--from-bags", str(tmp_path / "failed"), str(tmp_path / "here"), "--out", str(tmp_path / "out")]
    assert main(arguments) == 0
    assert json.loads((tmp_path / "out" / "meta.json").read_text())["setup"] == setup.to_dict()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--from-bags", "{tmp}/nowhere"], "neither a data set"),
        (["--from-bags", "{tmp}/set", "{tmp}/set"], "give it once"),
        (["--from-bags", "{tmp}/set", "--out", "{tmp}/set"], "exists: give another --out"),
        (["--from-bags", "{tmp}/set", "--workspace", "{tmp}/none.yaml"], "cannot read workspace file"),
        (["--from-bags", "{tmp}/missed"], "no step of 1 episodes can be learned from"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str],
    message: str,
    make_episode: MakeEpisode,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    make_episode(tmp_path / "set", "a", outcomes=(0,))
    make_episode(tmp_path / "missed", "b", outcomes=(MISSED,))
    given = [argument.format(tmp=tmp_path) for argument in arguments]
    if "--out" not in given:
        given += ["--out", str(tmp_path / "out")]
    assert main(given) == 1
    errors = capsys.readouterr().err.strip().splitlines()
    assert len(errors) == 1 and errors[0].startswith("error: ") and message in errors[0]
    assert not (tmp_path / "out").exists()
