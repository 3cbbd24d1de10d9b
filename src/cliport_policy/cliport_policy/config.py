"""Configuration of the compact network and of training, as flat dataclasses checked when they are made."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any

from cliport_policy.errors import ConfigError
from cliport_policy.settings import TOKEN_DIM, channel_counts, check_choice, check_common_shape, check_keys, check_types

TARGETS = ("soft", "one_hot")
SCHEDULES = ("cosine", "constant")
PRECISIONS = ("auto", "float32", "bfloat16")
RECOLORS = ("none", "demonstrated", "surveyed")


@dataclass(frozen=True)
class NetworkConfig:
    """Shape of the compact network.

    widths: channels of the U-Net's levels, at 1/2, 1/4, 1/8 and 1/16 of the heightmap.
    token_dim: width of the frozen text encoder's token embeddings. goal_dim: width of one goal vector.
    transport_channels: features that are correlated. query_cells: side of the query window in cells of 2 pixels.
    crop_pixels: side of the rotator's crop. n_rotations: k of rotator and transport.
    language, heights, mask: False takes the sentence, the heights, or the mask of cells that the depth camera saw,
    from the network: ablations. Without the mask cells that were not seen are still a uniform grey in the picture.
    """

    widths: tuple[int, ...] = (24, 40, 64, 96)
    token_dim: int = TOKEN_DIM
    goal_dim: int = 128
    transport_channels: int = 4
    query_cells: int = 31
    crop_pixels: int = 64
    n_rotations: int = 36
    language: bool = True
    heights: bool = True
    mask: bool = True

    def __post_init__(self) -> None:
        check_types(self, "network")
        channel_counts(self.widths)
        check_common_shape(self)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> NetworkConfig:
        """Read the values that `to_dict` returned.

        Raises:
            ConfigError: if a name or a value can't be.
        """
        check_keys(values, (f.name for f in fields(cls)), "network")
        return cls(**{**values, "widths": channel_counts(values.get("widths", cls.widths))})


@dataclass(frozen=True)
class TrainConfig:
    """Recipe of a training; the defaults are this project's own, PAPER is the paper's.

    batch_size: samples of a step in all, however many processes and accumulated parts share them.
    accumulate: parts that a process splits its share of a step into, one after the other.
    schedule: `cosine` to a hundredth, or `constant`; both after warmup_steps. Adam, with weight_decay as in AdamW.
    ema_decay: decay of the averaged weights, which are saved; 0 saves the weights themselves.
    gradient_clip: greatest norm of the gradient; 0 does not clip.
    targets: `soft`, a narrow Gaussian around the expert's pixel and yaw, or `one_hot`.
    rotator_rotations, transport_rotations: number of the k rotations that compete in a sample's softmax, the right one
    and others drawn at random; 0 takes all. The aligner's are as many as the rotator's.
    done_share: share of samples that show a finished scene, if there are any.
    absent_share: share of samples whose sentence is exchanged for one about things that are not in the scene; for data
    sets that list what lies on the table.
    strange_share: share of samples of kits whose shape is called by a name that no demonstration holds.
    augment_probability: share of samples that are moved by a random SE(2) transform.
    rotation_sigma_deg, translation_sigma_px: spread of these transforms.
    directed_rotation_sigma_deg: spread of rotations for a sentence that names a direction, such as left, which turning
    would falsify.
    precision: `bfloat16`, which loses little, `float32`, or `auto`: bfloat16 if this machine is fast at it.
    recolor: `demonstrated` repaints samples in colours that the demonstrations show and name, `surveyed` in all basic
    colours, in shades of a survey; `none` repaints nothing.
    recolor_probability: share of the samples naming colours that are repainted, their sentences with them.
    rearrange_probability: share of samples whose things are put elsewhere on the table, each by itself; for tasks whose
    things may lie anywhere, as blocks and bowls may, but not a rope at its frame.
    mirror_probability: share of samples that are seen in a mirror, with left and right, or top and bottom, exchanged in
    their sentences.
    stretch_sigma: spread of the logarithms of the two factors by which what the aligner compares is stretched, thing
    and hole alike, so that it meets more shapes than the demonstrations hold; every other one is mirrored.
    bend_sigma_px: spread of the waves that bend them, too, in pixels. If both are 0, neither is done.
    jitter: True adds small errors to colours and heights.
    phrases_per_goal: number of wordings of each canonical sentence, fewer where all of them would not fit in memory.
    """

    steps: int = 6000
    batch_size: int = 16
    accumulate: int = 1
    learning_rate: float = 2e-3
    weight_decay: float = 1e-4
    schedule: str = "cosine"
    warmup_steps: int = 200
    ema_decay: float = 0.998
    gradient_clip: float = 1.0
    targets: str = "soft"
    rotator_rotations: int = 12
    transport_rotations: int = 4
    done_share: float = 0.15
    absent_share: float = 0.0
    strange_share: float = 0.0
    augment_probability: float = 0.6
    rotation_sigma_deg: float = 60.0
    directed_rotation_sigma_deg: float = 10.0
    translation_sigma_px: float = 26.67
    recolor: str = "none"
    recolor_probability: float = 0.7
    rearrange_probability: float = 0.0
    mirror_probability: float = 0.0
    stretch_sigma: float = 0.0
    bend_sigma_px: float = 0.0
    jitter: bool = True
    phrases_per_goal: int = 200
    precision: str = "auto"
    seed: int = 0

    def __post_init__(self) -> None:
        check_types(self, "training")
        check_choice(self.precision, PRECISIONS, "precision")
        check_choice(self.targets, TARGETS, "targets")
        check_choice(self.recolor, RECOLORS, "recolor")
        check_choice(self.schedule, SCHEDULES, "schedule")
        least = {"steps": 1, "batch_size": 1, "accumulate": 1}
        for field in fields(self):
            value = getattr(self, field.name)
            if not isinstance(value, str) and not (math.isfinite(value) and value >= least.get(field.name, 0)):
                raise ConfigError(f"{field.name}={value} must be a number of {least.get(field.name, 0)} or more")
        if self.learning_rate == 0:
            raise ConfigError("learning_rate=0 learns nothing: give a positive one")
        shares = ("ema_decay", "done_share", "absent_share", "strange_share", "augment_probability")
        for name in (*shares, "recolor_probability", "rearrange_probability", "mirror_probability"):
            if getattr(self, name) > 1:
                raise ConfigError(f"{name}={getattr(self, name)} must be in 0..1")

    def check_goal_images_stay_true(self) -> None:
        """Raise ConfigError for what would show a network an image of another goal than it is to reach."""
        if self.rearrange_probability:
            raise ConfigError(
                f"rearrange_probability={self.rearrange_probability} is not for a network that is shown a goal image,"
                " whose things lie elsewhere: leave it 0"
            )
        if self.absent_share:
            raise ConfigError(
                f"absent_share={self.absent_share} is not for a network that is shown a goal image, which has all that"
                " is to be there: leave it 0"
            )

    def learning_rate_at(self, step: int) -> float:
        """Return the learning rate of a step: linear warm-up, then the schedule."""
        warm = min(1.0, (step + 1) / max(self.warmup_steps, 1))
        if self.schedule == "constant":
            return self.learning_rate * warm
        progress = min(step / self.steps, 1.0)
        return self.learning_rate * warm * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * progress)))

    def to_dict(self) -> dict[str, Any]:
        """Return plain values, ready for JSON."""
        return asdict(self)


# docs/paper.md, "Training" and "Augmentation". The paper's two optimisers, for the pick's and the place's nets, are one
# here, since Adam treats each weight by itself. The cross-entropy is the ordinary one.
PAPER = TrainConfig(
    steps=201_000,
    batch_size=1,
    learning_rate=1e-4,
    weight_decay=0.0,
    schedule="constant",
    warmup_steps=0,
    ema_decay=0.0,
    gradient_clip=0.0,
    targets="one_hot",
    rotator_rotations=0,
    transport_rotations=0,
    done_share=0.0,
    augment_probability=1.0,
    directed_rotation_sigma_deg=60.0,
    jitter=False,
    phrases_per_goal=0,
)
# Recipe for some ten demonstrations on a laptop: ten minutes at most, from a checkpoint that knows the rest.
FINE_TUNE = TrainConfig(steps=200, learning_rate=5e-4, warmup_steps=30, ema_decay=0.99, phrases_per_goal=40)
RECIPES = {"ours": TrainConfig(), "paper": PAPER, "fine_tune": FINE_TUNE}
