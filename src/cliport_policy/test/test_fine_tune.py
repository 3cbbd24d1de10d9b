"""Going on from a checkpoint: its weights and config, other data, and nothing forgotten of what it refuses."""

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from safetensors.torch import load_file

from cliport_policy.card import load_card
from cliport_policy.checkpoint import ANCHORS, PRESENCE
from cliport_policy.config import FINE_TUNE
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.errors import ConfigError
from cliport_policy.joint_config import JointConfig
from cliport_policy.policy import load_policy
from cliport_policy.train import main
from cliport_policy.training.options import parse_options

SMALL = 0.0125  # m: pixels of 64 x 32 heightmaps, as tiny_checkpoint's
NEW = "put the purple blocks in a white bowl"
MakeSet = Callable[..., Path]
MakeCheckpoint = Callable[..., Path]
pytestmark = pytest.mark.usefixtures("one_thread")


def train(*arguments: str | Path) -> int:
    few = ["--batch", "2", "--phrases", "1", "--device", "cpu"]
    return main([*few, *(str(argument) for argument in arguments)])


def test_a_fine_tuning_goes_on_from_a_checkpoint(
    make_flat_set: MakeSet, tiny_checkpoint: MakeCheckpoint, tmp_path: Path
) -> None:
    mine = make_flat_set(tmp_path / "mine", 3, actions=1, pixel_size=SMALL, sentence=NEW)
    old = make_flat_set(tmp_path / "old", 3, actions=1, pixel_size=SMALL, seed=1)
    begun, out = tiny_checkpoint("compact"), tmp_path / "out"
    known = json.loads(begun.with_suffix(".json").read_text()) | {"done_bias": {"pick_place": 0.5}}
    begun.with_suffix(".json").write_text(json.dumps(known))
    arguments = ["--init", begun, "--data", f"{mine}:0.7", "--data", f"{old}:0.3", "--out", out]
    assert train(*arguments, "--steps", "2") == 0
    before, after = load_file(begun), load_file(out / "policy.safetensors")
    for name, value in before.items():
        if name.endswith(("weight", "bias")):
            assert torch.allclose(after[name], value, atol=0.05), name
    assert any(not torch.equal(after[name], value) for name, value in before.items())
    assert torch.equal(after[ANCHORS][: len(before[ANCHORS])], before[ANCHORS])
    card = json.loads((out / "policy.json").read_text())
    assert card["done_bias"] == {"pick_place": 0.5}
    made_by = card["made_by"]
    assert made_by["init"]["checkpoint"] == str(begun)
    assert made_by["init"]["sha256"] == hashlib.sha256(begun.read_bytes()).hexdigest()
    assert [source["weight"] for source in made_by["data"]] == [0.7, 0.3]
    assert card["network"] == json.loads(begun.with_suffix(".json").read_text())["network"]
    policy = load_policy(out)
    policy.check_instruction("put the red blocks in a blue bowl")
    policy.check_instruction(NEW)
    assert train(*arguments, "--steps", "3") == 0  # resumes, and does not begin again
    assert json.loads((out / "policy.json").read_text())["made_by"]["steps_done"] == 3


def test_it_keeps_a_presence_network_that_finds_what_the_demonstrations_name(
    make_flat_set: MakeSet, tiny_checkpoint: MakeCheckpoint, give_presence: Callable[[Path, bool], None],
    tmp_path: Path, caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    sets = [make_flat_set(tmp_path / name, 3, actions=1, pixel_size=SMALL) for name in ("one", "two")]
    begun, out = tiny_checkpoint("compact"), tmp_path / "out"
    arguments = ["--init", begun, *(word for folder in sets for word in ("--data", folder)), "--out", out]
    give_presence(begun, True)
    caplog.set_level("INFO")
    assert train(*arguments, "--steps", "1") == 0 and train(*arguments, "--steps", "2") == 0
    assert f"the presence network of {begun} is kept: it finds what is named in 6 scenes" in caplog.messages
    before, after = load_file(begun), load_file(out / "policy.safetensors")
    kept = [name for name in before if name.startswith(PRESENCE)]
    assert kept and all(torch.equal(after[name], before[name]) for name in kept)
    assert all(after[name].dtype == before[name].dtype for name in kept)
    assert load_card(out / "policy.safetensors").presence == load_card(begun).presence
    data = load_demonstrations(sets[0])
    assert load_policy(out).infer(data.observation(data.frames[0]), NEW).absent_probability < 0.5

    give_presence(begun, False)
    other = tmp_path / "other"
    assert train(*arguments[:-1], other, "--steps", "1") == 0
    assert (
        f"the presence network of {begun} is left out: in 3 of 3 scenes of {sets[0]} it does not find what is named; "
        "fit_presence teaches another one"
    ) in caplog.messages
    assert not load_card(other / "policy.safetensors").presence
    assert not any(name.startswith(PRESENCE) for name in load_file(other / "policy.safetensors"))


def test_its_recipe_is_short_and_careful(tiny_checkpoint: MakeCheckpoint) -> None:
    given = ["--data", "a", "--out", "o", "--init", str(tiny_checkpoint("compact"))]
    options = parse_options(given)
    assert options.train == FINE_TUNE and options.train.steps * options.train.batch_size < 18_000  # ten minutes at 30/s
    assert parse_options([*given, "--optimizer", "ours", "--steps", "7"]).train.learning_rate == 2e-3
    assert options.initial is not None and options.network == options.initial.card.network


def test_a_trained_network_may_come_to_see_colours_in_another_way() -> None:
    given = ["--data", "a", "--out", "o", "--init", "multi-open-100"]
    options = parse_options([*given, "--set", "color_reading=tokens", "--set", "gray_share=0.2"])
    assert isinstance(options.network, JointConfig) and options.initial is not None
    assert (options.network.color_reading, options.network.gray_share) == ("tokens", 0.2)
    assert replace(options.network, color_reading="names", gray_share=0.4) == options.initial.card.network
    with pytest.raises(ConfigError, match=r"of another network \(goal_dim 16 not 128\)"):
        parse_options([*given, "--set", "color_reading=names", "--set", "goal_dim=16"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--init", "nothing"], "no checkpoint at 'nothing'"),
        (["--init", "{tiny}", "--config", "compact"], "is of another network (crop_pixels 64 not 16"),
        (["--init", "{tiny}", "--set", "goal_dim=32"], "leave --config and its settings out"),
        (["--init", "default"], "pixel_size 0.0125 not 0.0025"),
    ],
)
def test_what_does_not_fit_is_one_line(
    arguments: list[str],
    message: str,
    make_flat_set: MakeSet,
    tiny_checkpoint: MakeCheckpoint,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    data, tiny = make_flat_set(tmp_path / "data", 2, pixel_size=SMALL), tiny_checkpoint("compact")
    given = [argument.format(tiny=tiny) for argument in arguments]
    assert train("--data", data, "--out", tmp_path / "out", "--steps", "1", *given) == 1
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1 and message in errors[0]
    assert not (tmp_path / "out").exists()


def test_another_beginning_is_not_resumed(
    make_flat_set: MakeSet, tiny_checkpoint: MakeCheckpoint, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, begun, out = make_flat_set(tmp_path / "data", 2, pixel_size=SMALL), tiny_checkpoint("compact"), tmp_path / "o"
    assert train("--init", begun, "--data", data, "--out", out, "--steps", "1") == 0
    assert train("--init", out, "--data", data, "--out", out, "--steps", "1") == 1
    assert "init was" in capsys.readouterr().err
