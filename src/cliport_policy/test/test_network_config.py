"""Networks as data: every shipped config is sound, and a wrong name or value is answered with the nearest right one."""

from pathlib import Path
from typing import Any

import pytest

from cliport_policy.config import NetworkConfig
from cliport_policy.encoders.registry import with_available_encoder
from cliport_policy.errors import ConfigError
from cliport_policy.named_configs import config_names, load_network_config, network_config_from_dict
from cliport_policy.stream_config import StreamsConfig

BASES = [
    "clip_only",
    "cliport",
    "cliport_wo_lang",
    "compact",
    "compact_wo_height",
    "compact_wo_lang",
    "image_goal",
    "language_transporter",
    "rn50_bert",
    "transporter",
    "untrained_sem",
    "wo_skips",
]
PAPERS = [name for name in BASES if not name.startswith("compact")]  # each once more with a rotator
NAMES = sorted([*BASES, "multi", *(f"{name}_rotator" for name in PAPERS)])


def test_the_named_networks_are_there() -> None:
    assert config_names() == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_card_gives_back_what_it_was_given(name: str) -> None:
    config = load_network_config(name)
    assert network_config_from_dict(config.to_dict()) == config


def test_compact_is_the_default_network() -> None:
    assert load_network_config("compact") == NetworkConfig()


def test_what_the_names_promise() -> None:
    configs = {name: load_network_config(name) for name in NAMES if not name.startswith(("compact", "multi"))}
    reading = {name for name, config in configs.items() if isinstance(config, StreamsConfig) and config.reads_language}
    names = {"clip_only", "cliport", "language_transporter", "rn50_bert", "untrained_sem"}
    assert reading == names | {f"{name}_rotator" for name in names}
    goal_driven = {
        name for name, config in configs.items() if isinstance(config, StreamsConfig) and config.needs_goal_image
    }
    assert goal_driven == {"image_goal", "image_goal_rotator"}


@pytest.mark.parametrize(
    ("name", "changes", "near"),
    [
        ("clipport", {}, "'cliport'"),
        ("cliport", {"pick.langage": "film"}, "'language'"),
        ("cliport", {"pick.language": "flim"}, "'film'"),
        ("cliport", {"pik.language": "film"}, "'pick.language'"),
        ("cliport", {"encodr": "clip_rn50"}, "'encoder'"),
        ("cliport", {"encoder": "clip_rn5"}, "'clip_rn50'"),
        ("cliport", {"kind": "stream"}, "'streams'"),
        ("transporter", {"key": {"spatial": "plane"}}, "'plain'"),
        ("compact", {"with": [8, 16]}, "'widths'"),
    ],
)
def test_the_nearest_valid_name_is_shown(name: str, changes: dict[str, Any], near: str) -> None:
    with pytest.raises(ConfigError, match="did you mean") as caught:
        load_network_config(name, changes)
    assert near in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("transporter", {"pick.spatial": "none"}),  # no stream
        ("transporter", {"pick.language": "multiply"}),  # no encoder
        ("transporter", {"pick.fusion": "add"}),  # one stream only
        ("cliport", {"pick.fusion": "none"}),  # two streams
        ("cliport", {"pick.spatial": "plain"}),  # laterals of a stream without
        ("cliport", {"pick.semantic": "yes"}),
        ("cliport", {"pick.skips": False}),  # nothing to normalise
        ("cliport", {"pick": None}),
        ("cliport", {"width": "wide"}),
        ("cliport", {"width": 0.0}),
        ("cliport", {"crop_pixels": 60}),
        ("cliport", {"n_rotations": True}),
        ("image_goal", {"key.goal_image": "multiply"}),
    ],
)
def test_what_cannot_work_is_one_line(name: str, changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigError) as caught:
        load_network_config(name, changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["compact", "multi"])
@pytest.mark.parametrize(
    "changes",
    [{"widths": 24}, {"widths": ["a", "b"]}, {"widths": [24]}, {"widths": [24, 0]}, {"widths": "24, 40"},
     {"goal_dim": 130}, {"goal_dim": 0}, {"token_dim": 100}, {"query_cells": -1}, {"query_cells": 30},
     {"crop_pixels": 0}, {"crop_pixels": 20}, {"transport_channels": 0}, {"n_rotations": 0}],
)  # fmt: skip
def test_a_shape_that_cannot_work_is_one_line(name: str, changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigError) as caught:
        load_network_config(name, changes)
    assert next(iter(changes)) in str(caught.value) and "\n" not in str(caught.value)


def test_the_joint_networks_context_needs_whole_heads() -> None:
    with pytest.raises(ConfigError, match="must be a multiple of 4"):
        load_network_config("multi", {"widths": [16, 30]})
    load_network_config("multi", {"widths": [16, 30], "context_layers": 0})
    with pytest.raises(ConfigError, match="decoder_width=0"):
        load_network_config("multi", {"decoder_width": 0})


def test_a_change_reaches_one_net_only() -> None:
    config = load_network_config("cliport", {"query.language": "film", "rotator": {"spatial": "plain"}})
    assert isinstance(config, StreamsConfig) and config.rotator is not None
    assert (config.query.language, config.key.language, config.rotator.spatial) == ("film", "multiply", "plain")


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("kind: streams\npick: &n {spatial: plain}\nquery: *n\nkey: *n\nn_rotations: 12\n")
    assert load_network_config(path).n_rotations == 12
    for text in ("pick: [", "- a\n- b\n", "\0"):
        path.write_text(text)
        with pytest.raises(ConfigError, match=r"YAML|mapping") as caught:
            load_network_config(path)
        assert "\n" not in str(caught.value)


def test_rn50_bert_falls_back_on_what_packages_bring(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CLIPORT_MODELS", str(tmp_path))
    config = load_network_config("rn50_bert")
    assert isinstance(config, StreamsConfig)
    assert with_available_encoder(config).encoder == "efficientnet_minilm"
    (tmp_path / "resnet50.pth").touch()
    (tmp_path / "distilbert-base-uncased").mkdir()
    assert with_available_encoder(config).encoder == "resnet50_distilbert"


@pytest.mark.parametrize("name", PAPERS)
def test_a_network_for_a_parallel_hand_is_the_papers_with_a_rotator(name: str) -> None:
    config = load_network_config(f"{name}_rotator")
    assert isinstance(config, StreamsConfig) and config.rotator == config.pick
    assert config == load_network_config(name, {"rotator": "pick"})
    assert load_network_config(f"{name}_rotator", {"rotator": "none"}) == load_network_config(name)


def test_a_file_extends_a_shipped_config(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text("extends: transporter\nwidth: 0.5\n")
    assert load_network_config(path) == load_network_config("transporter", {"width": 0.5})
    path.write_text("extends: transportre\n")
    with pytest.raises(ConfigError, match="did you mean 'transporter'"):
        load_network_config(path)


def test_a_net_is_given_by_another_ones_name() -> None:
    for wrong, message in (("pik", "did you mean 'pick'"), ("place_goal", "rotator can't be 'place_goal'")):
        with pytest.raises(ConfigError, match=message):
            load_network_config("cliport", {"rotator": wrong})
