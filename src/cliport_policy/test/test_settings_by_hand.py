"""Networks' settings to either side of their bounds, what they promise, and how wrong names are answered."""

from dataclasses import asdict, replace
from typing import Any

import pytest

from cliport_policy.config import NetworkConfig, TrainConfig
from cliport_policy.errors import ConfigError
from cliport_policy.joint_config import JointConfig
from cliport_policy.settings import channel_counts, check_types, did_you_mean
from cliport_policy.stream_config import NetConfig, StreamsConfig

PLAIN = NetConfig(spatial="plain")
SHOWN = replace(PLAIN, goal_image="multiply")
STREAMS = StreamsConfig(PLAIN, PLAIN, PLAIN)


def test_settings_that_nobody_gave() -> None:
    assert asdict(JointConfig()) == {
        "widths": (16, 48, 96, 128), "decoder_width": 16, "token_dim": 384, "goal_dim": 128, "context_layers": 2,
        "transport_channels": 8, "query_cells": 31, "gate": True, "crop_pixels": 64, "n_rotations": 36,
        "color_words": "open", "color_reading": "tokens", "compares_colors": False, "gray_share": 0.4,
        "null_actions": 2, "chooses_primitive": True, "reads_sides": False, "reads_shapes": False, "reads_kinds": False,
        "fits_prints": False, "sweeps_things": False, "aligner": False,
    }  # fmt: skip
    net = {"spatial": "plain", "semantic": False, "language": "none", "laterals": False, "skips": True,
           "norm": "none", "fusion": "none", "goal_image": "none"}  # fmt: skip
    assert STREAMS.to_dict() == {
        "kind": "streams", "pick": net, "query": net, "key": net, "rotator": None, "place_goal": None,
        "encoder": "none", "fallback_encoder": "none", "encoder_seed": 0, "width": 1.0, "crop_pixels": 64,
        "n_rotations": 36, "transport_channels": 3, "color_mean": 0.308, "color_std": 0.113, "height_mean": 0.0027,
        "height_std": 0.0077,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("settings", "good"),
    [
        ({"spatial": "plain"}, True), ({"semantic": True}, True), ({}, False),
        ({"spatial": "lateral", "semantic": True, "fusion": "add"}, True),
        ({"spatial": "lateral", "semantic": True}, False), ({"spatial": "plain", "fusion": "add"}, False),
        ({"semantic": True, "fusion": "concat"}, False),
        ({"semantic": True, "norm": "group"}, True), ({"semantic": True, "norm": "group", "skips": False}, False),
        ({"spatial": "plain", "norm": "group"}, False),
        ({"spatial": "lateral", "semantic": True, "fusion": "add", "laterals": True}, True),
        ({"spatial": "plain", "semantic": True, "fusion": "add", "laterals": True}, False),
        ({"spatial": "lateral", "laterals": True}, False),
        ({"spatial": "plain", "language": "film"}, True), ({"spatial": "lateral", "language": "film"}, False),
        ({"semantic": True, "language": "multiply"}, True),
        ({"spatial": "lateral", "semantic": True, "fusion": "add", "language": "film"}, True),
    ],
)  # fmt: skip
def test_what_a_net_can_be(settings: dict[str, Any], good: bool) -> None:
    if good:
        NetConfig(**settings)
        return
    with pytest.raises(ConfigError):
        NetConfig(**settings)


@pytest.mark.parametrize(
    ("changes", "good"),
    [
        ({"n_rotations": 1, "transport_channels": 1, "crop_pixels": 32}, True), ({"n_rotations": 0}, False),
        ({"transport_channels": 0}, False), ({"crop_pixels": 0}, False), ({"crop_pixels": 33}, False),
        ({"crop_pixels": 96}, True), ({"crop_pixels": -32}, False), ({"width": 4.0}, True), ({"width": 4.1}, False),
        ({"width": 0.0}, False), ({"width": 0.1}, True), ({"color_std": 0.0}, False), ({"height_std": 0.0}, False),
        ({"color_std": 1e-3, "height_std": 1e-3}, True),
        ({"pick": NetConfig(semantic=True)}, False), ({"pick": NetConfig(semantic=True), "encoder": "clip_rn50"}, True),
        ({"pick": NetConfig(spatial="plain", language="film")}, False),
        ({"pick": SHOWN}, True), ({"key": SHOWN}, False),
        ({"query": SHOWN}, False),
        ({"place_goal": SHOWN}, False), ({"place_goal": PLAIN}, True),
        ({"rotator": SHOWN}, True), ({"width": "1"}, False), ({"encoder_seed": 1.0}, False),
    ],
)  # fmt: skip
def test_what_a_network_of_streams_can_be(changes: dict[str, Any], good: bool) -> None:
    if good:
        replace(STREAMS, **changes)
        return
    with pytest.raises(ConfigError):
        replace(STREAMS, **changes)


def test_what_a_network_of_streams_reads() -> None:
    told = replace(STREAMS, encoder="clip_rn50", key=replace(PLAIN, language="film"))
    assert not STREAMS.reads_language and told.reads_language and not told.needs_goal_image
    assert replace(STREAMS, place_goal=PLAIN).needs_goal_image
    assert replace(STREAMS, pick=SHOWN).needs_goal_image
    assert list(replace(STREAMS, rotator=PLAIN).nets) == ["pick", "rotator", "query", "key"]
    other = replace(told, fallback_encoder="clip_rn50").with_encoder("efficientnet_minilm")
    assert (other.encoder, other.fallback_encoder) == ("efficientnet_minilm", "none")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"pick": {"spatial": "plain"}, "query": "pick"}, "needs the net 'key'"),
        ({"pick": {"spatial": "plain"}, "query": "pick", "key": "none"}, "needs the net 'key'"),
        ({"pick": "key", "query": {"spatial": "plain"}, "key": "query"}, "pick can't be 'key'"),
        ({"pick": {"spatail": "plain"}}, "unknown pick setting 'spatail': did you mean 'spatial'"),
        ({"pick": {"spatial": "plain", "semantic": 1}}, "pick: net setting 'semantic' must be a bool, not 1"),
        ({"pick": [1]}, r"pick must hold a net's settings, not \[1\]"),
    ],
)
def test_nets_that_are_not_there(values: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        StreamsConfig.from_dict(values)


def test_a_net_is_another_by_its_name() -> None:
    found = StreamsConfig.from_dict({"pick": {"spatial": "plain"}, "query": "pick", "key": "pick", "rotator": "none"})
    assert found == STREAMS


@pytest.mark.parametrize(
    ("kind", "changes", "good"),
    [
        (NetworkConfig, {"goal_dim": 4, "query_cells": 1, "crop_pixels": 8, "n_rotations": 1}, True),
        (NetworkConfig, {"transport_channels": 1, "widths": (1, 1)}, True),
        (NetworkConfig, {"goal_dim": 6}, False), (NetworkConfig, {"crop_pixels": 12}, False),
        (NetworkConfig, {"query_cells": 2}, False), (NetworkConfig, {"token_dim": 385}, False),
        (JointConfig, {"null_actions": 0}, False), (JointConfig, {"null_actions": 1}, True),
        (JointConfig, {"context_layers": -1}, False), (JointConfig, {"gray_share": 1.0}, True),
        (JointConfig, {"gray_share": 1.1}, False), (JointConfig, {"gray_share": -0.1}, False),
        (JointConfig, {"gray_share": 0}, True), (JointConfig, {"decoder_width": 1}, True),
        (JointConfig, {"color_reading": "names"}, True), (JointConfig, {"color_reading": "name"}, False),
        (JointConfig, {"color_reading": "names", "color_words": "none"}, False),
    ],
)  # fmt: skip
def test_what_a_compact_and_a_joint_network_can_be(kind: Any, changes: dict[str, Any], good: bool) -> None:
    if good:
        kind(**changes)
        return
    with pytest.raises(ConfigError):
        kind(**changes)


@pytest.mark.parametrize(
    ("value", "counts"),
    [([24, 40], (24, 40)), ((1, 1, 1), (1, 1, 1)), ([1], None), ([1, 0], None), ([1, True], None), ([1, 2.0], None)],
)
def test_widths_are_a_list_of_whole_numbers(value: Any, counts: tuple[int, ...] | None) -> None:
    if counts is not None:
        assert channel_counts(value) == counts
        return
    with pytest.raises(ConfigError, match=r"as in \[24, 40\]"):
        channel_counts(value)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"steps": 1.5}, "training setting 'steps' must be a int, not 1.5"),
        ({"steps": True}, "'steps' must be a int, not True"),
        ({"learning_rate": True}, "'learning_rate' must be a float, not True"),
        ({"learning_rate": "1"}, "'learning_rate' must be a float"),
        ({"jitter": 1}, "'jitter' must be a bool, not 1"),
        ({"targets": 1}, "'targets' must be a str, not 1"),
        ({"learning_rate": 1, "jitter": False}, ""),
    ],
)
def test_types_of_settings(changes: dict[str, Any], said: str) -> None:
    if not said:
        check_types(TrainConfig(**changes), "training")
        return
    with pytest.raises(ConfigError, match=said):
        TrainConfig(**changes)


def test_the_nearest_name_is_offered_if_it_is_near() -> None:
    assert did_you_mean("plian", ["none", "plain"]) == "did you mean 'plain'? Known are none, plain"
    assert did_you_mean("xyz", ["plain", "none"]) == "known are none, plain"


@pytest.mark.parametrize("name", ["rearrange_probability", "absent_share"])
def test_goal_images_forbid_other_scenes(name: str) -> None:
    TrainConfig().check_goal_images_stay_true()
    with pytest.raises(ConfigError, match=rf"{name}=0\.1 is not for a network that is shown a goal image"):
        TrainConfig(**{name: 0.1}).check_goal_images_stay_true()
