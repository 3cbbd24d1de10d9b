"""Training end to end on tiny sets: it learns something, stops, resumes, and what it saves can be used."""

import json
import multiprocessing
import os
import resource
import signal
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy import load_policy
from cliport_policy.checkpoint import ANCHORS, load_checkpoint
from cliport_policy.config import PAPER, NetworkConfig, TrainConfig
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.mixture import Mixture, Source
from cliport_policy.errors import (
    CheckpointError,
    ConfigError,
    DataError,
    InstructionError,
    ObservationError,
    TrainingError,
)
from cliport_policy.language import shared_encoder
from cliport_policy.named_configs import AnyNetworkConfig, load_network_config
from cliport_policy.policy import Policy
from cliport_policy.training.agreement import agreement
from cliport_policy.training.trainer import Progress, Trainer

TINY = NetworkConfig(widths=(8, 12), goal_dim=16, crop_pixels=32, query_cells=9)
TINY_STREAMS = {"width": 0.0625, "crop_pixels": 32, "n_rotations": 8}
CONFIG = TrainConfig(steps=8, batch_size=3, phrases_per_goal=3, warmup_steps=2)
SMALL = 0.0125  # m: pixels of 64 x 32 heightmaps
SENTENCE = "put the red blocks in a blue bowl"
pytestmark = pytest.mark.usefixtures("one_thread")


def _trainer(data: Path, out: Path, config: TrainConfig = CONFIG, network: AnyNetworkConfig = TINY) -> Trainer:
    return Trainer([Source(load_demonstrations(data))], out, network, config, shared_encoder(), {"command": "test"})


def _streams(name: str = "transporter") -> AnyNetworkConfig:
    return load_network_config(name, TINY_STREAMS)


def _observation(workspace: WorkspaceSpec | None = None) -> Heightmap:
    workspace = workspace or WorkspaceSpec()
    shape = workspace.shape
    return Heightmap(
        np.full((*shape, 3), 200, np.uint8), np.zeros(shape, np.float32), np.ones(shape, bool), workspace, 0
    )


def _silent(_: Progress) -> None:
    pass


def test_train_and_use(flat_set: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    seen: list[Progress] = []
    _trainer(flat_set, out).run(seen.append, keep_steps={2, 5})
    assert [progress.step for progress in seen] == list(range(1, 9))
    assert seen[-1].minutes_left == 0 and seen[-1].samples_per_s > 0
    kept = sorted(path.name for path in (out / "checkpoints").glob("*.safetensors"))
    assert kept == ["step-0000002.safetensors", "step-0000005.safetensors"]
    assert load_checkpoint(out / "checkpoints" / kept[0])[1].made_by["steps_done"] == 2

    policy = load_policy(out)
    inference = policy.infer(_observation(), SENTENCE, with_maps=True)
    action = inference.action
    assert 0 <= inference.done_probability <= 1 and 0 <= inference.pick_confidence <= 1
    assert policy.workspace.contains_xy(action.pick.x, action.pick.y)
    assert inference.maps is not None and inference.maps.pick.shape == policy.workspace.shape
    assert float(inference.maps.place.sum()) == pytest.approx(1, abs=1e-3)
    card = json.loads((out / "policy.json").read_text())
    assert card["made_by"]["steps_done"] == CONFIG.steps


@pytest.mark.parametrize("kind", ["compact", "streams", "streams, no average"])
def test_a_resumed_run_is_the_uninterrupted_run(kind: str, make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    """To the last bit of weights, averages and optimiser."""
    data = make_flat_set(tmp_path / "data", 6, pixel_size=SMALL)
    network = replace(TINY, crop_pixels=16) if kind == "compact" else _streams()
    config = replace(CONFIG, steps=6, ema_decay=0.0) if "no average" in kind else replace(CONFIG, steps=6)
    _trainer(data, tmp_path / "a", config, network).run(_silent)
    halves = _trainer(data, tmp_path / "b", config, network)
    halves.run(_silent, should_stop=lambda: halves.step >= 3)
    assert halves.step == 3
    resumed = _trainer(data, tmp_path / "b", config, network)
    assert resumed.step == 3
    resumed.run(_silent)
    for name in ("policy.safetensors", "training_state.safetensors"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


def test_accumulated_parts_are_the_large_batch(make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    """Tolerance 1e-5, in float32, for a network without batch norm; parts of 1 to 2 samples, some without an action."""
    data = make_flat_set(tmp_path / "data", 6, pixel_size=SMALL)
    results = []
    for accumulate in (1, 4):
        config = replace(CONFIG, steps=3, batch_size=6, accumulate=accumulate, precision="float32")
        losses: list[Progress] = []
        trainer = _trainer(data, tmp_path / str(accumulate), config, _streams())
        trainer.run(losses.append)
        results.append(([p.losses for p in losses], trainer.network.state_dict()))
    (whole, weights), (parts, other) = results
    for a, b in zip(whole, parts, strict=True):
        assert a == pytest.approx(b, rel=1e-4)
    assert all(torch.allclose(weights[name], other[name], atol=1e-5) for name in weights)


def test_the_papers_recipe_trains_any_network(make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    data = make_flat_set(tmp_path / "data", 3, actions=2, pixel_size=SMALL)
    config = replace(PAPER, steps=3, batch_size=2)
    for name in ("transporter", "image_goal"):
        trainer = _trainer(data, tmp_path / name, config, _streams(name))
        seen: list[Progress] = []
        trainer.run(seen.append)
        assert trainer.average is trainer.network
        assert all(p.learning_rate == 1e-4 and p.losses["rotator"] == 0 for p in seen)
        assert agreement(trainer.network, trainer.data, range(4)).n == 4
        assert load_policy(tmp_path / name, "float32").card.network == _streams(name)


def test_a_goal_image_is_not_falsified(make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    data = make_flat_set(tmp_path / "data", 3, actions=2, pixel_size=SMALL)
    for setting in ("rearrange_probability", "absent_share"):
        with pytest.raises(ConfigError, match=rf"{setting}=0\.5 .* leave it 0"):
            _trainer(data, tmp_path / "run", replace(PAPER, **{setting: 0.5}), _streams("image_goal"))


def test_it_learns(make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    data = make_flat_set(tmp_path / "data", 6, pixel_size=SMALL)
    config = replace(CONFIG, steps=40, batch_size=4, learning_rate=5e-3, ema_decay=0.5)
    seen: list[Progress] = []
    _trainer(data, tmp_path / "run", config, replace(TINY, crop_pixels=16)).run(seen.append)
    first, last = (sum(sum(p.losses.values()) for p in part) for part in (seen[:8], seen[-8:]))
    assert last < 0.7 * first


def test_a_full_disk_keeps_the_last_good_checkpoint(flat_set: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    first = _trainer(flat_set, out)
    first.run(_silent, should_stop=lambda: first.step >= 2)
    files = {path.name: path.read_bytes() for path in out.iterdir()}
    again = _trainer(flat_set, out)
    again.step += 1

    def save() -> None:
        """Runs in a process of its own, whose files can't grow beyond 20 kB: pytest's may."""
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
        with pytest.raises(CheckpointError, match=r"can't write .*policy\.safetensors") as caught:
            again.save()
        os._exit(7 if "\n" not in str(caught.value) else 1)

    child = multiprocessing.get_context("fork").Process(target=save)
    child.start()
    child.join()
    assert child.exitcode == 7
    assert {path.name: path.read_bytes() for path in out.iterdir()} == files
    assert load_policy(out).card.made_by["steps_done"] == 2


def test_what_is_saved_are_the_averaged_weights(make_flat_set: Callable[..., Path], tmp_path: Path) -> None:
    data = make_flat_set(tmp_path / "data", 3, pixel_size=SMALL)
    config = replace(CONFIG, steps=3, ema_decay=0.5)
    trainer = _trainer(data, tmp_path / "run", config, replace(TINY, crop_pixels=16))
    seen: list[Policy] = []
    trainer.run(lambda _: seen.append(trainer.policy()), keep_steps={3})  # which leaves the weights as they are
    average, raw = trainer.average.state_dict(), trainer.network.state_dict()
    assert average.keys() == raw.keys() and len(seen) == 3
    assert not any(torch.equal(average[name], raw[name]) for name in average if name.endswith("weight"))
    for path in ("policy.safetensors", "checkpoints/step-0000003.safetensors"):
        saved = load_file(tmp_path / "run" / path)
        assert saved.keys() - {ANCHORS} == average.keys()
        assert all(torch.equal(saved[name], average[name]) for name in average)


def test_a_loss_that_is_no_number_is_not_saved(flat_set: Path, tmp_path: Path) -> None:
    trainer = _trainer(flat_set, tmp_path / "run")
    with torch.no_grad():
        trainer.network.locator.null_score.fill_(float("nan"))  # type: ignore[union-attr]
    with pytest.raises(TrainingError, match="lower --learning-rate"):
        trainer.run(_silent)
    assert not (tmp_path / "run").exists()


def test_a_policy_refuses_what_it_cannot_use(flat_set: Path, tmp_path: Path) -> None:
    trainer = _trainer(flat_set, tmp_path / "run")
    trainer.save()
    policy = load_policy(tmp_path / "run" / "policy.safetensors")
    for text in ("", "   ", "x" * 1_000_000, "what is the weather today"):
        with pytest.raises(InstructionError) as caught:
            policy.check_instruction(text)
        assert "\n" not in str(caught.value) and len(str(caught.value)) < 400
    with pytest.raises(ObservationError, match="workspace"):
        policy.infer(_observation(WorkspaceSpec(y_max=0.3)), SENTENCE)
    blind = _observation()
    object.__setattr__(blind, "valid", np.zeros(blind.workspace.shape, bool))
    with pytest.raises(ObservationError, match="no valid cell"):
        policy.infer(blind, SENTENCE)


def test_damaged_checkpoints_are_named(flat_set: Path, tmp_path: Path) -> None:
    trainer = _trainer(flat_set, tmp_path / "run")
    trainer.save()
    weights, card = tmp_path / "run" / "policy.safetensors", tmp_path / "run" / "policy.json"
    good_weights, good_card = weights.read_bytes(), card.read_text()
    cases = {
        "damaged": lambda: weights.write_bytes(good_weights[: len(good_weights) // 2]),
        "needs the text encoder 'another'": lambda: card.write_text(
            json.dumps(json.loads(good_card) | {"encoder": "another"})
        ),
        "does not fit": lambda: card.write_text(good_card.replace('"goal_dim": 16', '"goal_dim": 24')),
        "card .* is damaged": lambda: card.write_text(good_card[:100]),
        "format": lambda: card.write_text(good_card.replace('"version": 1,', '"version": 99,', 1)),
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
    with pytest.raises(DataError, match=r"can't be resumed.*network\.crop_pixels was 32, not 64"):
        _trainer(flat_set, tmp_path / "run", network=replace(TINY, crop_pixels=64))
    with pytest.raises(DataError, match=r"train\.batch_size was 3, not 4"):
        _trainer(flat_set, tmp_path / "run", replace(CONFIG, batch_size=4))
    fewer = load_demonstrations(flat_set).first_episodes(2)
    with pytest.raises(DataError, match=r"data\.demonstrations was 6, not 2"):
        Trainer([Source(fewer)], tmp_path / "run", TINY, CONFIG, shared_encoder(), {})
    _trainer(flat_set, tmp_path / "run", replace(CONFIG, steps=9))  # longer is allowed


def test_what_an_earlier_version_began_is_resumed(flat_set: Path, tmp_path: Path) -> None:
    _trainer(flat_set, tmp_path / "run").save()
    path = tmp_path / "run" / "training_config.json"
    begun = json.loads(path.read_text())
    del begun["network"]["mask"], begun["primitive"]
    del begun["train"]["absent_share"], begun["train"]["mirror_probability"]
    del begun["train"]["stretch_sigma"], begun["train"]["bend_sigma_px"]
    begun["train"]["turn_weight"] = 0.0
    path.write_text(json.dumps(begun))
    _trainer(flat_set, tmp_path / "run")
    with pytest.raises(DataError, match=r"network\.mask was True, not False"):
        _trainer(flat_set, tmp_path / "run", network=replace(TINY, mask=False))


@pytest.mark.parametrize(
    "changes", [{"steps": 0}, {"learning_rate": float("nan")}, {"targets": "sfot"}, {"batch_size": 1.5}]
)
def test_settings_that_cannot_be(changes: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match=next(iter(changes))):
        replace(CONFIG, **changes)  # type: ignore[arg-type]


def test_agreement_is_of_mixtures(flat_set: Path, tmp_path: Path) -> None:
    trainer = _trainer(flat_set, tmp_path / "run")
    found = agreement(trainer.average, Mixture([Source(load_demonstrations(flat_set))]), range(3))
    assert found.n == 3 and 0 <= found.pick <= 1
