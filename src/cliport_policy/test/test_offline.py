"""A policy on recorded scenes: the same errors every time, also of bags that are no episodes."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from cliport_core.action import PickPlaceAction
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.bags import read_messages
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import StepRecord
from cliport_episodes.message_types import definition_and_hash
from cliport_policy.comparison import action_errors
from cliport_policy.offline import main

MakeEpisode = Callable[..., list[StepRecord]]
MakeCheckpoint = Callable[..., Path]
DEMONSTRATION = "/cliport/demonstration"
pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.mark.parametrize(
    ("predicted", "recorded", "degrees"), [(0.1, 0.1 + math.pi, 0.0), (-1.5, 1.5, 8.1), (math.pi, 0.5, 28.6)]
)
def test_jaws_turned_by_half_a_turn_are_the_same(predicted: float, recorded: float, degrees: float) -> None:
    pick, place = PlanarPose(0.4, 0.0, recorded), PlanarPose(0.5, 0.1, recorded)
    action = PickPlaceAction(PlanarPose(0.403, 0.004, predicted), PlanarPose(0.5, 0.1, predicted + math.pi / 2))
    found = action_errors(action, PickPlaceAction(pick, place), WorkspaceSpec())
    assert found.pick_deg == pytest.approx(degrees, abs=0.1)
    assert (found.pick_mm, found.pick_px) == (5.0, 2.0) and found.place_mm == 0.0
    assert found.turn_deg == 90.0 and found.worst_mm == 5.0


def test_every_step_is_compared_and_the_worst_are_pictured(
    make_episode: MakeEpisode, tiny_checkpoint: MakeCheckpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    records = make_episode(tmp_path / "set", "one") + make_episode(tmp_path / "set", "two", seed=1, outcomes=(0,))
    checkpoint = tiny_checkpoint("compact")
    reports = []
    for name in ("first", "second"):
        arguments = ["--bag", str(tmp_path / "set"), "--checkpoint", str(checkpoint), "--out", str(tmp_path / name)]
        assert main([*arguments, "--worst", "2"]) == 0
        reports.append((tmp_path / name / "offline.json").read_bytes())
    assert reports[0] == reports[1]
    report = json.loads(reports[0])
    assert [(step["source"], step["step"]) for step in report["steps"]] == [("one", 0), ("one", 1), ("two", 0)]
    for step, record in zip(report["steps"], records, strict=True):
        assert step["recorded_pick"][:2] == pytest.approx((record.action.pick.x, record.action.pick.y), abs=1e-4)
        far = 1000 * math.dist(step["predicted_pick"][:2], (record.action.pick.x, record.action.pick.y))
        assert step["errors"]["pick_mm"] == pytest.approx(far, abs=0.2)
        assert step["errors"]["pick_px"] == pytest.approx(far / 12.5, abs=0.02)
    assert [scene["success"] for scene in report["finished_scenes"]] == [True, True]
    assert report["summary"]["steps"] == 3 and report["summary"]["pick_mm"]["worst"] > 0
    pictures = sorted((tmp_path / "first").glob("*.png"))
    worst = max(report["steps"], key=lambda step: max(step["errors"]["pick_mm"], step["errors"]["place_mm"]))
    assert len(pictures) == 2 and pictures[0].name == f"worst_01_{worst['source']}_step_{worst['step']:03d}.png"
    assert cv2.imread(str(pictures[0])).shape[1] > 300
    shown = capsys.readouterr().out
    assert "pick within 20 mm" in shown and "24.0 s of recording" in shown  # 16 s and 8 s


def test_an_instruction_that_the_policy_refuses_is_a_line_of_the_report(
    make_episode: MakeEpisode, tiny_checkpoint: MakeCheckpoint, tmp_path: Path
) -> None:
    make_episode(tmp_path / "set", "one", outcomes=(0,))
    DataSet.open(tmp_path / "set").relabel("one", "qwertz uiop asdf")
    arguments = ["--bag", str(tmp_path / "set"), "--checkpoint", str(tiny_checkpoint("compact"))]
    assert main([*arguments, "--out", str(tmp_path / "out")]) == 0
    report = json.loads((tmp_path / "out" / "offline.json").read_text())
    assert report["summary"]["refused"] == 1 and "unlike anything" in report["steps"][0]["refused"]


def write_plain_bag(
    episode: Path, bag: Path, without: str = "", storage: StoragePlugin = StoragePlugin.SQLITE3, first: bool = True
) -> Path:
    """What an episode holds as another recorder would write it: camera all the time, poses late, no demonstration.

    first: False leaves the first pick pose out, as when the recording began after it.
    """
    with Writer(bag, version=9, storage_plugin=storage) as writer:
        connections = {}
        for raw in read_messages(episode):
            if raw.topic in (DEMONSTRATION, without):
                continue
            if raw.topic == "/cliport/pick_pose" and not first:
                first = True
                continue
            if raw.topic not in connections:
                text, digest = definition_and_hash(raw)
                connections[raw.topic] = writer.add_connection(raw.topic, raw.type, msgdef=text, rihs01=digest)
            late = 300_000_000 if "pose" in raw.topic else 0
            writer.write(connections[raw.topic], raw.stamp_ns + late, raw.data)
    return bag


@pytest.mark.parametrize("storage", StoragePlugin)
def test_a_plain_bag_gives_what_the_episode_gives(
    storage: StoragePlugin, make_episode: MakeEpisode, tiny_checkpoint: MakeCheckpoint, tmp_path: Path
) -> None:
    make_episode(tmp_path / "set", "one")
    episode = tmp_path / "set" / "episodes" / "one"
    bag = write_plain_bag(episode, tmp_path / "plain", storage=storage)
    checkpoint, steps = tiny_checkpoint("compact"), []
    for path in (episode, bag):
        out = tmp_path / f"out_{path.name}"
        assert main(["--bag", str(path), "--checkpoint", str(checkpoint), "--out", str(out), "--worst", "0"]) == 0
        steps.append(json.loads((out / "offline.json").read_text())["steps"])
    assert [{**step, "source": ""} for step in steps[0]] == [{**step, "source": ""} for step in steps[1]]
    assert steps[1][0]["source"] == "plain"


def test_a_pose_without_its_partner_shifts_no_other(
    make_episode: MakeEpisode, tiny_checkpoint: MakeCheckpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    make_episode(tmp_path / "set", "one", outcomes=(0, 0, 0))
    episode, checkpoint, steps = tmp_path / "set" / "episodes" / "one", tiny_checkpoint("compact"), []
    for name in ("whole", "late"):
        bag = write_plain_bag(episode, tmp_path / name, first=name == "whole")
        out = tmp_path / f"out_{name}"
        assert main(["--bag", str(bag), "--checkpoint", str(checkpoint), "--out", str(out), "--worst", "0"]) == 0
        steps.append(json.loads((out / "offline.json").read_text())["steps"])
    assert capsys.readouterr().out.count("poses without a partner of the same stamp") == 1
    assert len(steps[0]) == 3 and len(steps[1]) == 2
    for whole, late in zip(steps[0][1:], steps[1], strict=True):
        assert {**late, "source": "", "step": 0} == {**whole, "source": "", "step": 0}


def test_a_negative_number_of_pictures_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--bag", str(tmp_path), "--worst", "-1"]) == 1
    assert capsys.readouterr().err == "error: --worst is -1: give 0 or more\n"


@pytest.mark.parametrize(
    ("without", "message"),
    [
        ("/camera/color/camera_info", "no camera_info (/camera/color/camera_info)"),
        ("/tf_static", "no transform from 'camera' to 'base'"),
        ("/cliport/instruction", "no instruction"),
        ("/camera/aligned_depth_to_color/image_raw", "no picture on /camera/aligned_depth_to_color/image_raw"),
        ("/cliport/place_pose", "no pick with its place"),
    ],
)
def test_a_bag_that_lacks_something_is_one_line(
    without: str,
    message: str,
    make_episode: MakeEpisode,
    tiny_checkpoint: MakeCheckpoint,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    make_episode(tmp_path / "set", "one", outcomes=(0,))
    bag = write_plain_bag(tmp_path / "set" / "episodes" / "one", tmp_path / "plain", without)
    arguments = ["--bag", str(bag), "--checkpoint", str(tiny_checkpoint("compact")), "--out", str(tmp_path / "out")]
    assert main(arguments) == 1
    errors = capsys.readouterr().err.strip().splitlines()
    assert len(errors) == 1 and errors[0].startswith("error: ") and message in errors[0]


def test_topics_of_other_drivers_can_be_named(
    make_episode: MakeEpisode, tiny_checkpoint: MakeCheckpoint, tmp_path: Path
) -> None:
    make_episode(tmp_path / "set", "one", outcomes=(0,))
    bag = tmp_path / "plain"
    with Writer(bag, version=9) as writer:
        connections = {}
        for raw in read_messages(tmp_path / "set" / "episodes" / "one"):
            raw = replace(raw, topic=raw.topic.replace("/camera/", "/camera/camera/"))
            if raw.topic not in connections:
                text, digest = definition_and_hash(raw)
                connections[raw.topic] = writer.add_connection(raw.topic, raw.type, msgdef=text, rihs01=digest)
            writer.write(connections[raw.topic], raw.stamp_ns, raw.data)
    arguments = ["--bag", str(bag), "--checkpoint", str(tiny_checkpoint("compact")), "--out", str(tmp_path / "out")]
    assert main(arguments) == 1
    arguments += [
        "--color-image",
        "/camera/camera/color/image_raw",
        "--camera-info",
        "/camera/camera/color/camera_info",
    ]
    assert main([*arguments, "--depth-image", "/camera/camera/aligned_depth_to_color/image_raw"]) == 0
