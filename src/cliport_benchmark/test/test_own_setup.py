"""The user's workspace and camera, and scenes that vary: what is seen and recorded, and what is refused."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cliport_benchmark import evaluate_cli, generate_cli
from cliport_benchmark.errors import OptionError
from cliport_benchmark.evaluate import EvaluateConfig, Evaluator
from cliport_benchmark.experiment import Experiment
from cliport_benchmark.generate import GenerateConfig
from cliport_benchmark.observer import Observer
from cliport_benchmark.own_setup import OwnSetup, set_up_words
from cliport_benchmark.record import RecordConfig
from cliport_benchmark.variation import Aspect, Variation
from sim_bridge.objects import block_shape
from sim_bridge.rendering.camera import RgbdFrame
from sim_bridge.rendering.sensor_noise import SensorKind
from sim_bridge.scene import reset_scene, scene_rng
from sim_bridge.world import SimWorld

TASK = "put-blocks-in-bowls-seen-colors"
WORKSPACE = """workspace: {x_min: 0.3, x_max: 0.62, y_min: -0.32, y_max: 0.4, z_min: -0.02, z_max: 0.28,
  pixel_size: 0.004, n_rotations: 36}
"""
CAMERA = """camera: {position: [0.45, 0.75, 0.85], looking_at: [0.45, 0.05, 0.0], width: 640, height: 480, fx: 480.0,
  fy: 480.0, cx: 322.0, cy: 238.0, distortion_model: plumb_bob, distortion: [-0.08, 0.02, 0.001, 0.0, 0.0]}
"""


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    (tmp_path / "workspace.yaml").write_text(WORKSPACE)
    (tmp_path / "camera.yaml").write_text(CAMERA)
    return ["--workspace", str(tmp_path / "workspace.yaml"), "--camera", str(tmp_path / "camera.yaml")]


def look(variation: Variation | None) -> tuple[RgbdFrame, np.ndarray, int]:
    """The frame, the heights that are made of it, and how many things there are."""
    world = SimWorld()
    observer = Observer(world.config, n_threads=1, variation=variation)
    task = reset_scene(world, TASK, "test", 3)
    layout = [world.object_pose(thing).as_matrix() for thing in world.objects]
    if variation is not None:
        variation.add_to(world, task, 3)
    moved = [world.object_pose(thing).as_matrix() - pose for thing, pose in zip(world.objects, layout)]
    assert np.abs(moved).max() < 5e-4
    observer.new_scene(scene_rng(task.name, task.split, 3, 4))
    frame, count = observer.frame(world), len(world.objects)
    world.close()
    return frame, observer.heightmap(frame).height, count


def test_each_aspect_changes_its_own_and_nothing_else() -> None:
    plain, heights, count = look(None)
    again, same, _ = look(Variation())
    np.testing.assert_array_equal(plain.color, again.color)
    np.testing.assert_array_equal(plain.depth, again.depth)
    np.testing.assert_array_equal(heights, same)
    lit, _, _ = look(Variation.parse("light"))
    laid, _, _ = look(Variation.parse("texture"))
    for frame in (lit, laid):
        np.testing.assert_array_equal(frame.depth, plain.depth)
        assert (frame.color != plain.color).mean() > 0.1
    both, _, _ = look(Variation.parse("light,texture"))
    assert (both.color != lit.color).mean() > 0.1 and (both.color != laid.color).mean() > 0.1
    _, shifted, n_shifted = look(Variation.parse("mounting", (10.0, 0.0)))
    assert n_shifted == count and np.abs(shifted - heights).max() > 0.01
    _, _, n_cluttered = look(Variation.parse("clutter"))
    assert n_cluttered > count


def test_a_variation_is_read_from_words_and_says_what_it_is() -> None:
    assert Variation.parse(None).settings() == {}
    assert list(Variation.parse("all").settings()) == [aspect.value for aspect in Aspect]
    settings = Variation.parse("clutter, mounting", (3.0, 0.5)).settings()
    assert settings["mounting"] == {"shift": 0.003, "turn": pytest.approx(np.radians(0.5))}
    assert settings["clutter"]["most"] == 5 and len(settings) == 2
    with pytest.raises(OptionError, match="unknown 'dust'; choose from light, texture, clutter, mounting, or all"):
        Variation.parse("light,dust")
    with pytest.raises(OptionError, match="needs --randomize mounting"):
        Variation.parse("light", (1.0, 1.0))
    with pytest.raises(OptionError, match="zero or more"):
        Variation.parse("mounting", (-1.0, 1.0))
    with pytest.raises(OptionError, match="unknown 'dust'"):
        Experiment(TASK, "compact", 1, 1, (1,), randomize_scores="dust")


def test_an_experiment_scores_in_the_same_setup(files: list[str]) -> None:
    chosen = Experiment(TASK, "compact", 1, 1, (1,), workspace=files[1], camera=files[3], randomize_scores="light")
    assert chosen.setup_options == files and chosen.score_options == [*files, "--randomize", "light"]
    assert Experiment(TASK, "compact", 1, 1, (1,)).score_options == []


def test_scenes_are_made_for_the_workspace_and_seen_by_the_camera(files: list[str]) -> None:
    setup = OwnSetup.load(Path(files[1]), Path(files[3]))
    config = EvaluateConfig("expert", TASK, "test", 0, 1, setup=setup, variation=Variation.parse("clutter"))
    evaluator = Evaluator(replace(config, without_arm=True))
    assert evaluator.observer.observe(evaluator.world).valid.mean() > 0.99
    task = reset_scene(evaluator.world, TASK, "test", 0)
    for thing in task.objects:
        assert setup.workspace.contains_xy(*map(float, evaluator.world.object_xy(thing)))
    heightmap = evaluator.observer.observe(evaluator.world)
    assert heightmap.workspace == setup.workspace
    blocks = [thing for thing in task.objects if thing.shape is block_shape()]
    for block in blocks:
        at = setup.workspace.xy_to_pixel(*map(float, evaluator.world.object_xy(block)))
        assert heightmap.height[at] == pytest.approx(0.04, abs=0.01)
    evaluator.world.close()
    settings = config.settings()
    assert settings["workspace"]["pixel_size"] == 0.004 and list(settings["randomize"]) == ["clutter"]
    assert settings["camera"]["width"] == 640 and settings["camera"]["distortion"][0] == -0.08
    assert set_up_words(settings) == ", own set-up, randomized: clutter"
    made = GenerateConfig(TASK, "train", 0, 1, setup=setup).settings()
    assert (made["workspace"], made["camera"], made["randomize"]) == (settings["workspace"], settings["camera"], False)
    plain = EvaluateConfig("expert", TASK, "test", 0, 1).settings()
    assert set_up_words(plain) == "" and plain["randomize"] is False
    varied = RecordConfig(TASK, "train", 0, 1, variation=Variation.parse("light,clutter"))
    assert varied.name(0) == f"{TASK}-train-000000-light-clutter" != replace(varied, variation=Variation()).name(0)


def test_the_kind_of_camera_is_what_the_agent_sees_and_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    depths = {}
    for kind in (SensorKind.PERFECT, SensorKind.PLAIN, SensorKind.STEREO):
        setup = OwnSetup(camera_kind=kind)
        evaluator = Evaluator(EvaluateConfig("expert", TASK, "test", 0, 1, without_arm=True, setup=setup))
        task = reset_scene(evaluator.world, TASK, "test", 0)
        evaluator.observer.new_scene(scene_rng(task.name, task.split, 0, 4))
        depths[kind.value] = evaluator.observer.frame(evaluator.world).depth
        evaluator.world.close()
    known = np.isfinite(depths["perfect"]) & np.isfinite(depths["plain"]) & np.isfinite(depths["stereo"])
    off = {kind: (depths[kind] - depths["perfect"])[known] for kind in ("plain", "stereo")}
    assert abs(off["plain"].mean()) < 2e-4 and off["plain"].std() > 5e-4
    assert off["stereo"].mean() > 1e-3, "a stereo camera is biased"
    assert np.isfinite(depths["stereo"]).mean() < np.isfinite(depths["plain"]).mean()
    setup = OwnSetup(camera_kind=SensorKind.STEREO)
    stereo = EvaluateConfig("expert", TASK, "test", 0, 1, setup=setup).settings()
    assert stereo["camera_kind"] == "stereo" and set_up_words(stereo) == ", stereo camera"
    assert "camera_kind" not in EvaluateConfig("expert", TASK, "test", 0, 1).settings()
    made = GenerateConfig(TASK, "train", 0, 1, setup=setup).settings()
    assert made["noise"]["bias"] == 0.002 and made["camera_kind"] == "stereo"
    assert RecordConfig(TASK, "train", 0, 1, setup=setup).name(0) == f"{TASK}-train-000000-stereo"
    arguments = ["--checkpoint", "expert", "--task", TASK, "--out", str(tmp_path / "out.json")]
    with pytest.raises(SystemExit):
        evaluate_cli.main([*arguments, "--camera-kind", "lidar"])
    line = capsys.readouterr().err.splitlines()[-1]
    assert line.startswith("evaluate: error:") and "'lidar'" in line and all(kind.value in line for kind in SensorKind)


@pytest.mark.parametrize(
    ("task", "text", "words"),
    [
        (TASK, WORKSPACE.replace("0.62", "0.4"), "has no room in this workspace: no free place for another"),
        ("palletizing-boxes", WORKSPACE.replace("-0.32", "-0.2"), "puts its .* outside the workspace's"),
        (TASK, "workspace: {x_min: far}", "--workspace: workspace values must be numbers"),
        (TASK, WORKSPACE.replace("0.3,", "1.3,").replace("0.62", "1.62"), "sees 0 % of the workspace"),
    ],
)
def test_a_workspace_that_cannot_be_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], task: str, text: str, words: str
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    for program, own in ((generate_cli.main, []), (evaluate_cli.main, ["--checkpoint", "expert"])):
        arguments = ["--task", task, "--episodes", "1", "--out", str(tmp_path / "out"), "--workspace", str(file)]
        assert program([*arguments, *own]) == 1
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("error: ")
        assert re.search(words, line), line
    assert not (tmp_path / "out").exists()


def test_a_policy_of_another_workspace_and_a_missing_camera_are_one_line(
    files: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["--checkpoint", "default", "--task", TASK, "--episodes", "1", "--processes", "1"]
    arguments += ["--out", str(tmp_path / "out.json")]
    assert evaluate_cli.main([*arguments, *files]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "default was trained for WorkspaceSpec(x_min=0.25" in line and "train a policy on data of yours" in line
    assert evaluate_cli.main([*arguments, "--camera", str(tmp_path / "none.yaml")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "cannot read the camera's mounting" in line
