"""What was demonstrated as a sweep is never learned nor carried out as a pick and place."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from server_world import World

from cliport_core.action import Primitive
from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.checkpoint import load_checkpoint
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.dataset import main as dataset
from cliport_policy.errors import CheckpointError, DataError
from cliport_policy.policy import Policy, load_policy
from cliport_policy.train import main

SMALL = 0.0125  # m: pixels of 64 x 32 heightmaps, as tiny_checkpoint's
KINDS = ("sweep", "pick_place")
SENTENCE = "put the red blocks in a blue bowl"
MakeSet = Callable[..., Path]
MakeCheckpoint = Callable[..., Path]
pytestmark = pytest.mark.usefixtures("one_thread")


def train(*arguments: str | Path) -> int:
    few = ["--batch", "2", "--phrases", "1", "--device", "cpu"]
    return main([*few, *(str(argument) for argument in arguments)])


def errors(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]


def primitive_chosen(policy: Policy) -> Primitive:
    workspace = WorkspaceSpec(pixel_size=SMALL)
    color = np.full((*workspace.shape, 3), 200, np.uint8)
    seen = Heightmap(color, np.zeros(workspace.shape, np.float32), np.ones(workspace.shape, bool), workspace, 0)
    return policy.infer(seen, SENTENCE).action.primitive


@pytest.fixture
def taught_sweep(make_episode: Callable[..., object], tmp_path: Path) -> Path:
    """A training set of three sweeps, as they are taught on the page."""
    make_episode(tmp_path / "set", "one", primitive=Primitive.SWEEP)
    make_episode(tmp_path / "set", "two", outcomes=(0,), seed=1, primitive=Primitive.SWEEP)
    out = tmp_path / "sweeps"
    assert dataset(["--from-bags", str(tmp_path / "set"), "--out", str(out)]) == 0
    return out


def test_the_primitive_travels_with_the_demonstration(taught_sweep: Path) -> None:
    demos = [demo for frame in load_demonstrations(taught_sweep).frames for demo in frame.demos]
    assert {demo.primitive for demo in demos} == {Primitive.SWEEP}
    assert [demo.done for demo in demos].count(False) == 3


def test_a_set_that_does_not_say_is_of_pick_place(make_flat_set: MakeSet, tmp_path: Path) -> None:
    demo = load_demonstrations(make_flat_set(tmp_path / "old", 1)).frames[0].demos[0]
    assert demo.primitive is Primitive.PICK_PLACE


def test_a_primitive_that_is_not_known_is_refused(make_flat_set: MakeSet, tmp_path: Path) -> None:
    data = make_flat_set(tmp_path / "data", 1, primitives=("push",))
    with pytest.raises(DataError, match="unknown primitive 'push': known are pick_place, sweep, fold"):
        load_demonstrations(data)


def test_a_taught_sweep_is_not_trained_into_a_policy_that_picks(
    taught_sweep: Path, tiny_checkpoint: MakeCheckpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun, out = tiny_checkpoint("compact"), tmp_path / "out"
    assert train("--init", begun, "--data", taught_sweep, "--out", out, "--steps", "1") == 1
    (line,) = errors(capsys)
    assert f"{taught_sweep} holds 3 demonstrations of sweep" in line and f"{begun} acts with pick_place only" in line
    assert "train on these without --init" in line
    assert not out.exists()


def test_a_policy_of_sweeps_sweeps(
    taught_sweep: Path, tiny_checkpoint: MakeCheckpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun, out = tiny_checkpoint("compact", Primitive.SWEEP), tmp_path / "out"
    assert train("--init", begun, "--data", taught_sweep, "--out", out, "--steps", "1") == 0
    assert load_checkpoint(out / "policy.safetensors")[1].primitive is Primitive.SWEEP
    assert primitive_chosen(load_policy(out)) is Primitive.SWEEP


def test_one_primitive_from_the_beginning_is_learned(make_flat_set: MakeSet, tmp_path: Path) -> None:
    data, out = make_flat_set(tmp_path / "data", 3, pixel_size=SMALL, primitives=("fold",)), tmp_path / "out"
    small = ["--config", "transporter", "--set", "width=0.0625", "--set", "crop_pixels=32", "--set", "n_rotations=8"]
    assert train(*small, "--data", data, "--out", out, "--steps", "1") == 0
    assert json.loads((out / "policy.json").read_text())["primitive"] == "fold"
    assert primitive_chosen(load_policy(out)) is Primitive.FOLD


def test_a_training_is_not_resumed_with_another_primitive(
    make_flat_set: MakeSet, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folds = make_flat_set(tmp_path / "folds", 2, pixel_size=SMALL, primitives=("fold",))
    picks = make_flat_set(tmp_path / "picks", 2, pixel_size=SMALL)
    small = ["--config", "transporter", "--set", "width=0.0625", "--set", "crop_pixels=32", "--set", "n_rotations=8"]
    out = tmp_path / "out"
    assert train(*small, "--data", picks, "--out", out, "--steps", "1") == 0
    assert train(*small, "--data", folds, "--out", out, "--steps", "2") == 1
    assert "primitive was 'pick_place', not 'fold'" in errors(capsys)[0]
    config = json.loads((out / "training_config.json").read_text())
    assert config.pop("primitive") == "pick_place"
    (out / "training_config.json").write_text(json.dumps(config))  # as earlier versions left it
    assert train(*small, "--data", picks, "--out", out, "--steps", "2") == 0


@pytest.mark.parametrize("together", [True, False], ids=["in one set", "of two sets"])
def test_mixed_primitives_are_refused_in_words(
    make_flat_set: MakeSet, tmp_path: Path, capsys: pytest.CaptureFixture[str], together: bool
) -> None:
    if together:
        sets = [make_flat_set(tmp_path / "both", 4, actions=1, pixel_size=SMALL, primitives=("sweep", "pick_place"))]
        words = [f"{sets[0]} holds 2 demonstrations of pick_place and 2 of sweep"]
    else:
        sets = [make_flat_set(tmp_path / name, 2, actions=1, pixel_size=SMALL, primitives=(name,)) for name in KINDS]
        words = [f"{folder} holds 2 demonstrations of {name}" for folder, name in zip(sets, KINDS, strict=True)]
    given = [argument for folder in sets for argument in ("--data", folder)]
    assert train(*given, "--out", tmp_path / "out", "--steps", "1") == 1
    (line,) = errors(capsys)
    assert all(word in line for word in words) and "make a data set of each" in line
    assert not (tmp_path / "out").exists()


def test_a_checkpoint_that_does_not_say_is_of_pick_place(tiny_checkpoint: MakeCheckpoint) -> None:
    path = tiny_checkpoint("compact", Primitive.SWEEP)
    card = json.loads(path.with_suffix(".json").read_text())
    assert card.pop("primitive") == "sweep"
    path.with_suffix(".json").write_text(json.dumps(card))
    assert load_checkpoint(path)[1].primitive is Primitive.PICK_PLACE
    path.with_suffix(".json").write_text(json.dumps(card | {"primitive": "push"}))
    with pytest.raises(CheckpointError, match="unknown primitive 'push'"):
        load_checkpoint(path)


@pytest.mark.parametrize("primitive", list(Primitive))
def test_the_executor_is_asked_for_what_the_checkpoint_learned(
    tiny_checkpoint: MakeCheckpoint, primitive: Primitive
) -> None:
    pytest.importorskip("cliport_interfaces.msg")
    from cliport_core.messages import goal_to_msg
    from cliport_interfaces.action import PickPlace

    policy, world = load_policy(tiny_checkpoint("compact", primitive)), World()
    world.say()
    world.see()
    color = np.full((*policy.workspace.shape, 3), 200, np.uint8)
    flat, seen = np.zeros(policy.workspace.shape, np.float32), np.ones(policy.workspace.shape, bool)
    inferred = policy.infer(Heightmap(color, flat, seen, policy.workspace, 0), SENTENCE)
    sure = replace(inferred, done_probability=0.0, pick_confidence=1.0, place_confidence=1.0)
    world.server.on_proposal(world.inferences[-1][0], sure, world.now)
    assert world.server.status.primitive is primitive
    message = goal_to_msg(world.goals[-1][1], "panda_link0")
    assert message.primitive == getattr(PickPlace.Goal, f"PRIMITIVE_{primitive.name}")
