"""Training end to end on a tiny set: it learns something, stops, resumes, and what it saves can be used."""

import json
from pathlib import Path

import numpy as np
import pytest

from cliport_perception.heightmap import Heightmap
from cliport_perception.workspace import WorkspaceSpec
from cliport_policy import load_policy
from cliport_policy.config import NetworkConfig, TrainConfig
from cliport_policy.demonstrations import load_demonstrations
from cliport_policy.errors import CheckpointError, DataError, InstructionError, ObservationError
from cliport_policy.language import shared_encoder
from cliport_policy.train import main
from cliport_policy.training import Trainer

TINY = NetworkConfig(widths=(8, 12), goal_dim=16, crop_pixels=32, query_cells=9)
CONFIG = TrainConfig(steps=8, batch_size=3, phrases_per_goal=3, warmup_steps=2)


def _trainer(data: Path, out: Path, config: TrainConfig = CONFIG) -> Trainer:
    return Trainer(load_demonstrations(data), out, TINY, config, shared_encoder(), {"command": "test"})


def _observation(workspace: WorkspaceSpec | None = None) -> Heightmap:
    workspace = workspace or WorkspaceSpec()
    shape = workspace.shape
    return Heightmap(
        np.full((*shape, 3), 200, np.uint8), np.zeros(shape, np.float32), np.ones(shape, bool), workspace, 0
    )


def test_train_stop_resume_and_use(flat_set: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    trainer = _trainer(flat_set, out)
    trainer.run(lambda _: None, should_stop=lambda: trainer.step >= 4)
    assert trainer.step == 4
    resumed = _trainer(flat_set, out)
    assert resumed.step == 4
    resumed.run(lambda _: None)
    assert resumed.step == CONFIG.steps

    policy = load_policy(out)
    action = policy.infer(_observation(), "put the red blocks in a blue bowl", with_maps=True)
    assert 0 <= action.done_probability <= 1 and 0 <= action.pick_confidence <= 1
    assert policy.workspace.contains_xy(action.pick.x, action.pick.y)
    assert action.maps is not None and action.maps.pick.shape == policy.workspace.shape
    assert float(action.maps.place.sum()) == pytest.approx(1, abs=1e-3)
    card = json.loads((out / "policy.json").read_text())
    assert card["made_by"]["steps_done"] == CONFIG.steps


def test_a_resumed_run_is_the_uninterrupted_run(flat_set: Path, tmp_path: Path) -> None:
    whole = _trainer(flat_set, tmp_path / "a")
    whole.run(lambda _: None)
    halves = _trainer(flat_set, tmp_path / "b")
    halves.run(lambda _: None, should_stop=lambda: halves.step >= 4)
    resumed = _trainer(flat_set, tmp_path / "b")
    resumed.run(lambda _: None)
    a, b = whole.average.locator.null_score, resumed.average.locator.null_score
    assert float(a) == pytest.approx(float(b), abs=1e-4)


def test_a_policy_refuses_what_it_cannot_use(flat_set: Path, tmp_path: Path) -> None:
    trainer = _trainer(flat_set, tmp_path / "run")
    trainer.save()
    policy = load_policy(tmp_path / "run" / "policy.safetensors")
    for text in ("", "   ", "x" * 1_000_000, "what is the weather today"):
        with pytest.raises(InstructionError) as caught:
            policy.check_instruction(text)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 400
    with pytest.raises(ObservationError, match="workspace"):
        policy.infer(_observation(WorkspaceSpec(y_max=0.3)), "put the red blocks in a blue bowl")
    blind = _observation()
    object.__setattr__(blind, "valid", np.zeros(blind.workspace.shape, bool))
    with pytest.raises(ObservationError, match="no valid cell"):
        policy.infer(blind, "put the red blocks in a blue bowl")


def test_damaged_checkpoints_are_named(flat_set: Path, tmp_path: Path) -> None:
    trainer = _trainer(flat_set, tmp_path / "run")
    trainer.save()
    weights, card = tmp_path / "run" / "policy.safetensors", tmp_path / "run" / "policy.json"
    good_weights, good_card = weights.read_bytes(), card.read_text()
    cases = {
        "damaged": lambda: weights.write_bytes(good_weights[: len(good_weights) // 2]),
        "does not fit": lambda: card.write_text(good_card.replace('"goal_dim": 16', '"goal_dim": 24')),
        "card .* is damaged": lambda: card.write_text(good_card[:100]),
        "format": lambda: card.write_text(good_card.replace('"version": 1', '"version": 99')),
        "no card": card.unlink,
        "no checkpoint": weights.unlink,
    }
    for message, damage in cases.items():
        weights.write_bytes(good_weights)
        card.write_text(good_card)
        damage()
        with pytest.raises(CheckpointError, match=message) as caught:
            load_policy(weights)
        assert "\n" not in str(caught.value)


def test_other_settings_do_not_resume(flat_set: Path, tmp_path: Path) -> None:
    _trainer(flat_set, tmp_path / "run").save()
    with pytest.raises(DataError, match="can't be resumed"):
        Trainer(
            load_demonstrations(flat_set),
            tmp_path / "run",
            NetworkConfig(widths=(8, 16)),
            CONFIG,
            shared_encoder(),
            {},
        )


def test_a_missing_data_set_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--data", str(tmp_path / "none"), "--out", str(tmp_path / "out")]) == 1
    error = capsys.readouterr().err.strip()
    assert error.startswith("error: no data set at") and "\n" not in error


def test_a_damaged_part_is_named(flat_set: Path) -> None:
    part = flat_set / "part-00000.parquet"
    part.write_bytes(part.read_bytes()[:200])
    with pytest.raises(DataError, match=r"part-00000\.parquet"):
        load_demonstrations(flat_set)
