"""Composition of a network of streams as checked values: the paper's network, its baselines and ablations."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from typing import Any

from cliport_policy.errors import ConfigError
from cliport_policy.settings import check_choice, check_keys, check_types

SPATIAL = ("none", "plain", "lateral")
LANGUAGE = ("none", "multiply", "film")
FUSION = ("none", "add", "concat")
NORM = ("none", "group")
GOAL_IMAGE = ("none", "multiply")
NETS = ("pick", "rotator", "query", "key", "place_goal")
ENCODERS = ("none", "clip_rn50", "resnet50_distilbert", "efficientnet_minilm", "untrained_resnet50_distilbert")


@dataclass(frozen=True)
class NetConfig:
    """One net: image in, map out, made of a spatial and a semantic stream (paper, appendices C and F).

    spatial: `plain` is the 43-layer hourglass, `lateral` the deeper one of CLIPort itself.
    semantic: True adds a frozen encoder with a decoder. skips: True hands encoder features to the decoder.
    norm: `group` normalises after the six wide convolutions of the decoder with skips (docs/paper.md, "Layers").
    laterals: True adds the spatial decoder's features to the semantic one.
    language: fusion of the sentence with the semantic decoder, or with a spatial stream that stands alone.
    fusion: joining of the two streams' maps: their sum, or concatenated through a 1x1 convolution.
    goal_image: `multiply` takes the product of the observation and the goal image for input.
    """

    spatial: str = "none"
    semantic: bool = False
    language: str = "none"
    laterals: bool = False
    skips: bool = True
    norm: str = "none"
    fusion: str = "none"
    goal_image: str = "none"

    def __post_init__(self) -> None:
        check_types(self, "net")
        for name, valid in (
            ("spatial", SPATIAL),
            ("language", LANGUAGE),
            ("norm", NORM),
            ("fusion", FUSION),
            ("goal_image", GOAL_IMAGE),
        ):
            check_choice(getattr(self, name), valid, name)
        if self.spatial == "none" and not self.semantic:
            raise ConfigError("a net needs a stream: set spatial to plain or lateral, or semantic to true")
        if (self.spatial != "none" and self.semantic) != (self.fusion != "none"):
            raise ConfigError(f"fusion={self.fusion}: two streams need add or concat, one stream needs none")
        if self.norm != "none" and not (self.semantic and self.skips):
            raise ConfigError(f"norm={self.norm} needs semantic: true and skips: true")
        if self.laterals and not (self.spatial == "lateral" and self.semantic):
            raise ConfigError("laterals need spatial: lateral and semantic: true")
        if self.language != "none" and not self.semantic and self.spatial != "plain":
            raise ConfigError(
                "language enters a semantic stream or a plain spatial one: set semantic or spatial: plain"
            )

    @classmethod
    def from_dict(cls, values: Any, where: str) -> NetConfig:
        """Read the settings of the net called `where`.

        Raises:
            ConfigError: naming the net, if a name or a value can't be.
        """
        if not isinstance(values, dict):
            raise ConfigError(f"{where} must hold a net's settings, not {values!r}")
        check_keys(values, (f.name for f in fields(cls)), where)
        try:
            return cls(**values)
        except ConfigError as error:
            raise ConfigError(f"{where}: {error}") from None


@dataclass(frozen=True)
class StreamsConfig:
    """Policy of up to five nets that share nothing but the frozen encoders (paper, appendices C, D and F).

    pick: the locator. rotator: None leaves the gripper's yaw at 0, as in the paper's simulation.
    query, key: the two nets that are correlated. place_goal: a net on the goal image whose features are added
    to those of query and key. encoder: the frozen encoders; fallback_encoder: their substitute if their files are
    missing.
    width: scales the streams' channels; 1 is the paper's. crop_pixels: side of the rotator's and the query's crops.
    color_mean .. height_std: the spatial stream's normalisation, colour in 0..1 and height in m. They are those of this
    project's simulator; the paper's, of its own, are 0.18877631, 0.07276466, 0.00509261 and 0.00903967.
    """

    pick: NetConfig
    query: NetConfig
    key: NetConfig
    rotator: NetConfig | None = None
    place_goal: NetConfig | None = None
    encoder: str = "none"
    fallback_encoder: str = "none"
    encoder_seed: int = 0
    width: float = 1.0
    crop_pixels: int = 64
    n_rotations: int = 36
    transport_channels: int = 3
    color_mean: float = 0.308
    color_std: float = 0.113
    height_mean: float = 0.0027
    height_std: float = 0.0077

    def __post_init__(self) -> None:
        check_types(self, "network")
        check_choice(self.encoder, ENCODERS, "encoder")
        check_choice(self.fallback_encoder, ENCODERS, "fallback_encoder")
        nets = self.nets.values()
        if self.encoder == "none" and any(net.semantic or net.language != "none" for net in nets):
            raise ConfigError("a net with a semantic stream or language needs an encoder: set encoder to clip_rn50")
        if self.n_rotations < 1 or self.transport_channels < 1 or self.crop_pixels < 32 or self.crop_pixels % 32:
            raise ConfigError(
                f"n_rotations={self.n_rotations} and transport_channels={self.transport_channels} must be positive, "
                f"crop_pixels={self.crop_pixels} a multiple of 32"
            )
        if not 0 < self.width <= 4 or self.color_std <= 0 or self.height_std <= 0:
            raise ConfigError(
                f"width={self.width} must be in 0..4, color_std={self.color_std}, height_std={self.height_std} positive"
            )
        if any(net is not None and net.goal_image != "none" for net in (self.query, self.key, self.place_goal)):
            raise ConfigError("goal_image is for pick and rotator; query and key take place_goal")

    @property
    def nets(self) -> dict[str, NetConfig]:
        """Nets of the policy, by name."""
        named = {name: getattr(self, name) for name in NETS}
        return {name: net for name, net in named.items() if net is not None}

    @property
    def reads_language(self) -> bool:
        """True if a net reads the sentence."""
        return any(net.language != "none" for net in self.nets.values())

    @property
    def needs_goal_image(self) -> bool:
        """True if a net reads an image of the finished scene."""
        return self.place_goal is not None or any(net.goal_image != "none" for net in self.nets.values())

    def with_encoder(self, encoder: str) -> StreamsConfig:
        """Return the same policy on other encoders, without a fallback, as a checkpoint's card records it."""
        return replace(self, encoder=encoder, fallback_encoder="none")

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return {"kind": "streams", **asdict(self)}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> StreamsConfig:
        """Read a mapping of settings.

        A net may be given as another's name, `rotator: pick` has the settings of `pick`, or as `none`.

        Raises:
            ConfigError: if a name or a value can't be.
        """
        check_keys(values, (f.name for f in fields(cls)), "network")
        known = dict(values)
        for name in NETS:
            if isinstance(known.get(name), str):
                given = {net: values[net] for net in NETS if isinstance(values.get(net), dict)}
                check_choice(known[name], (*given, "none"), name)
                known[name] = given.get(known[name])
            if known.get(name) is not None:
                known[name] = NetConfig.from_dict(known[name], name)
            elif name in ("pick", "query", "key"):
                raise ConfigError(f"a network of streams needs the net '{name}'")
        return cls(**known)
