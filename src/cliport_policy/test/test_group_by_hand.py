"""Processes that train together, without processes: what is summed, and what a training begins with."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from cliport_core.workspace import WorkspaceSpec
from cliport_policy.card import Card
from cliport_policy.checkpoint import ANCHORS
from cliport_policy.config import NetworkConfig
from cliport_policy.encoders.bert_modules import BertShape, untrained_bert
from cliport_policy.errors import CheckpointError, ConfigError, DataError, TrainingError
from cliport_policy.training import distributed
from cliport_policy.training.distributed import Group, join_group
from cliport_policy.training.initial import Initial, in_brief
from cliport_policy.training.state import resume_state, save_state

CARD = Card(NetworkConfig(), WorkspaceSpec(), "e", 0.45, {"command": "x"})


@pytest.fixture
def twins(monkeypatch: pytest.MonkeyPatch) -> list[Tensor]:
    """Two processes that are alike: a sum over them is twice one's own value."""
    summed: list[Tensor] = []

    def reduce(values: Tensor) -> None:
        summed.append(values.clone())
        values *= 2

    monkeypatch.setattr(distributed.dist, "all_reduce", reduce)
    return summed


def test_gradients_are_summed_and_an_absent_one_is_none_at_all(twins: list[Tensor]) -> None:
    weights = [nn.Parameter(torch.zeros(2)), nn.Parameter(torch.zeros(1, 3)), nn.Parameter(torch.zeros(1))]
    weights[2].requires_grad_(False)
    weights[0].grad = torch.tensor([1.0, 2.0])
    Group(1, 2).sum_gradients(weights)
    assert twins[0].tolist() == [1, 2, 0, 0, 0] and weights[2].grad is None
    assert [w.grad.tolist() for w in weights[:2] if w.grad is not None] == [[2, 4], [[0, 0, 0]]]
    Group().sum_gradients(weights)
    assert len(twins) == 1 and weights[0].grad.tolist() == [2, 4]


def test_one_that_stops_stops_all(twins: list[Tensor]) -> None:
    pair = Group(0, 2)
    assert pair.any(True) is True and pair.any(False) is False and [float(each) for each in twins] == [1, 0]
    assert Group().any(True) is True and Group().any(False) is False
    assert pair.sum(torch.tensor([3.0])).tolist() == [6] and Group().sum(torch.tensor([3.0])).tolist() == [3]
    assert len(twins) == 3 and pair.is_first and not Group(1, 2).is_first


def test_another_process_that_ended_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(_: Tensor) -> None:
        raise RuntimeError("connection closed")

    monkeypatch.setattr(distributed.dist, "all_reduce", fail)
    with pytest.raises(TrainingError, match="another process of this training has ended"):
        Group(0, 2).sum(torch.zeros(1))


def test_a_group_is_joined_shared_and_left(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[Any] = []
    fake = SimpleNamespace(
        init_process_group=lambda backend: done.append(backend),
        destroy_process_group=lambda: done.append("left"),
        broadcast=lambda value, source: done.append((tuple(value.shape), source)),
    )
    monkeypatch.setattr(distributed, "dist", fake)
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    for name in ("RANK", "WORLD_SIZE"):
        monkeypatch.delenv(name, raising=False)
    alone = join_group()
    alone.share(nn.Linear(2, 1))
    alone.leave()
    assert (alone.rank, alone.size, alone.device.type, done) == (0, 1, "cpu", [])
    monkeypatch.setenv("RANK", "1")
    monkeypatch.setenv("WORLD_SIZE", "2")
    pair = join_group("cpu")
    pair.share(nn.Linear(2, 1))
    pair.leave()
    assert (pair.rank, pair.size) == (1, 2) and done == ["gloo", ((1, 2), 0), ((1,), 0), "left"]
    with pytest.raises(TrainingError, match="no CUDA device is here: give --device cpu"):
        join_group("cuda")


def test_a_training_begins_with_what_fits() -> None:
    network = nn.Linear(2, 1)
    network.encoder_identity = "clip 1"  # type: ignore[assignment]
    tensors = {"weight": torch.ones(1, 2), "bias": torch.ones(1), ANCHORS: torch.eye(2)}
    initial = Initial("mine", "ab", tensors, replace(CARD, frozen="clip 1"))
    initial.put_into(network)  # type: ignore[arg-type]
    assert (network.weight == 1).all() and torch.equal(initial.anchors, torch.eye(2))
    assert initial.to_dict() == {"checkpoint": "mine", "sha256": "ab", "made_by": {"command": "x"}}
    with pytest.raises(CheckpointError, match="was trained on the encoders ''; here are 'clip 1'"):
        replace(initial, card=CARD).put_into(network)  # type: ignore[arg-type]
    with pytest.raises(CheckpointError, match="mine does not fit its card"):
        replace(initial, tensors={"weight": torch.ones(3, 2)}).put_into(network)  # type: ignore[arg-type]


def test_a_card_says_of_earlier_trainings_which_data_and_not_each_setting_of_them() -> None:
    data = [{"weight": 0.5, "task": "t", "commit": "c", "dirty": False, "camera": {"width": 960}}]
    brief = [{"weight": 0.5, "task": "t", "commit": "c", "dirty": False}]
    first = {"command": "first", "data": data}
    second = {"command": "second", "data": data, "train": {"steps": 3}, "init": {"sha256": "0", "made_by": first}}
    assert in_brief(second) == {
        **{"command": "second", "data": brief, "train": {"steps": 3}},
        "init": {"sha256": "0", "made_by": {"command": "first", "data": brief}},
    }
    assert second["data"] is data and in_brief({"init": None}) == {"init": None}


def test_other_networks_and_workspaces_are_named() -> None:
    initial = Initial("mine", "ab", {}, CARD)
    initial.check_network(NetworkConfig())
    initial.check_workspace(WorkspaceSpec())
    with pytest.raises(ConfigError, match=r"of another network \(crop_pixels 32 not 64, goal_dim 64 not 128\)"):
        initial.check_network(NetworkConfig(goal_dim=64, crop_pixels=32))
    with pytest.raises(DataError, match=r"checkpoint mine \(y_max 0\.3 not 0\.4\): make the data set"):
        initial.check_workspace(WorkspaceSpec(y_max=0.3))


def test_a_state_comes_back_to_the_last_value(tmp_path: Path) -> None:
    def make() -> tuple[nn.Linear, torch.optim.Optimizer]:
        network = nn.Linear(2, 1)
        return network, torch.optim.SGD(network.parameters(), lr=0.1, momentum=0.9)

    network, optimizer = make()
    network(torch.ones(1, 2)).sum().backward()
    optimizer.step()
    identity = {"train": {"steps": 5, "absent_share": 0.0, "lr": 0.1}, "primitive": "fold"}
    again, slots = make()
    assert resume_state(tmp_path, {"network": again}, slots, identity) == 0
    save_state(tmp_path, {"network": network}, optimizer, 3, identity)
    longer = {"train": {"steps": 9, "absent_share": 0.0, "lr": 0.1}, "primitive": "fold"}
    assert resume_state(tmp_path, {"network": again}, slots, longer) == 3
    assert torch.equal(again.weight, network.weight)
    mine, theirs = (each.state_dict()["state"] for each in (slots, optimizer))
    assert all(torch.equal(mine[i]["momentum_buffer"], theirs[i]["momentum_buffer"]) for i in (0, 1))
    for wrong, said in (
        ({"train": {"steps": 5, "absent_share": 0.0, "lr": 0.2}, "primitive": "fold"}, r"train\.lr was 0\.1, not 0\.2"),
        (
            {"train": {"steps": 5, "absent_share": 0.0, "lr": 0.1}, "primitive": "sweep"},
            "primitive was 'fold', not 'sweep'",
        ),
        (
            {"train": {"steps": 5, "absent_share": 0.0, "lr": 0.1, "new": 1}, "primitive": "fold"},
            r"train\.new was None, not 1",
        ),
    ):
        with pytest.raises(DataError, match=said):
            resume_state(tmp_path, {"network": again}, slots, wrong)


def test_an_untrained_bert_is_drawn_by_its_seed_and_frozen() -> None:
    shape = BertShape(200, 20, 16, 32, 1, 2)
    one, same, other = (untrained_bert(shape, seed).state_dict() for seed in (1, 1, 2))
    assert all(torch.equal(one[name], same[name]) for name in one)
    assert not torch.equal(one["words.weight"], other["words.weight"])
    assert float(one["words.weight"].std()) == pytest.approx(0.02, rel=0.1) and not one["layers.0.query.bias"].any()
    network = untrained_bert(shape, 1)
    assert not network.training and not any(p.requires_grad for p in network.parameters())
