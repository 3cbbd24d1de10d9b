"""Training samples: demonstrations reworded, jittered and moved, and stacked to batches."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cliport_core.action import Primitive
from cliport_core.heightmap import Heightmap
from cliport_policy.config import TrainConfig
from cliport_policy.data.augmentation import (
    PlanarTransform,
    draw_transform,
    identity_transform,
    is_falsified_by_turning,
    jitter_color,
    jitter_height,
    warp,
)
from cliport_policy.data.demonstrations import Demonstration
from cliport_policy.data.mirror import draw_mirror
from cliport_policy.data.mixture import Drawn
from cliport_policy.data.paraphrase import paraphrase
from cliport_policy.data.phrasings import says_all
from cliport_policy.data.rearrange import rearranged
from cliport_policy.data.recolor import Recoloring, Repainting
from cliport_policy.data.strange_words import strange_words
from cliport_policy.observation import stack_channels


class Sample(NamedTuple):
    """Augmented training sample; pixels are float (row, col)."""

    image: NDArray[np.float32]  # (H, W, 5)
    goal_image: NDArray[np.float32] | None  # (H, W, 5)
    phrase: str
    done: bool
    pick: tuple[float, float]
    pick_yaw: float
    pick_yaw_period: float
    place: tuple[float, float]
    rotation: float  # place yaw - pick yaw, rad
    seed: int  # for the loss's random numbers
    absent: bool = False
    primitive: Primitive = Primitive.PICK_PLACE


class Batch(NamedTuple):
    """Batch of samples for the loss. Pixels are float (row, col); angles rad."""

    images: Tensor  # (B, 5, H, W)
    phrases: list[str]
    done: Tensor  # (B,) bool
    pick: Tensor  # (B, 2)
    pick_yaw: Tensor  # (B,)
    pick_yaw_period: Tensor  # (B,)
    place: Tensor  # (B, 2)
    rotation: Tensor  # (B,)
    seeds: Tensor  # (B,) int64, for the loss's random numbers
    goal_images: Tensor | None = None  # (B, 5, H, W)
    absent: Tensor | None = None  # (B,) bool, what the sentence names is not there; None: in no sample
    primitive: Tensor | None = None  # (B,) int64

    @property
    def acts(self) -> Tensor:
        """Samples that show an action: (B,) bool."""
        return ~self.done if self.absent is None else ~(self.done | self.absent)

    def to(self, device: torch.device) -> Batch:
        """Return the batch on a device; the seeds stay on the CPU, on which random numbers are drawn."""
        moved: dict[str, Tensor] = {}
        for name, value in self._asdict().items():
            if isinstance(value, Tensor) and name != "seeds":
                moved[name] = value.to(device)
        return self._replace(**moved)


class Phrasebook:
    """Fixed number of wordings for each goal, drawn once, so that their embeddings can be kept."""

    def __init__(self, wordings: Mapping[str, int], rng: np.random.Generator) -> None:
        """Draw the wordings.

        wordings: how many are drawn of each sentence, beside the sentence itself.
        """
        self._phrases: dict[str, list[str]] = {}
        self._whole: dict[str, list[str]] = {}  # those that name all that the sentence does
        for text in sorted(wordings):
            drawn = {paraphrase(text, rng) for _ in range(wordings[text])}
            self._phrases[text] = sorted(drawn | {text})
            self._whole[text] = [phrase for phrase in self._phrases[text] if says_all(phrase, text)]

    def draw(self, instruction: str, rng: np.random.Generator, whole: bool = False) -> str:
        """Return a random wording of an instruction, with `whole` one that names all that it names."""
        options = (self._whole if whole else self._phrases)[instruction]
        return options[int(rng.integers(len(options)))]

    def all_phrases(self) -> list[str]:
        """Return all wordings of all instructions, sorted."""
        return sorted({phrase for phrases in self._phrases.values() for phrase in phrases})


def make_sample(
    drawn: Drawn,
    phrasebook: Phrasebook,
    recoloring: Recoloring | None,
    config: TrainConfig,
    rng: np.random.Generator,
) -> Sample:
    """Reword one demonstration, jitter its images alike and (with augment_probability) move them by an SE(2).

    With a recoloring, recolor_probability of the samples get other colours; rearrange_probability get another
    arrangement, which a goal image would not show; mirror_probability are seen in a mirror.
    """
    demo, paints, mirror = drawn.demo, None, None
    settings = drawn.settings
    if recoloring is not None and settings.recolor and rng.random() < config.recolor_probability:
        paints = recoloring.draw(drawn, rng)
    sentence = demo.instruction if paints is None else paints.sentence(demo.instruction)
    if config.mirror_probability and rng.random() < config.mirror_probability:
        mirror = draw_mirror(rng)
    sentence = sentence if mirror is None else mirror.sentence(sentence)
    # What is missing must be named: "the red piece" may be there where a red star is not.
    phrase, seed = phrasebook.draw(sentence, rng, whole=demo.absent), int(rng.integers(2**62))
    if config.strange_share and rng.random() < config.strange_share:
        phrase = strange_words(phrase, demo, drawn.frame.things, rng)
    observation = drawn.data.observation(drawn.frame)
    if config.rearrange_probability and settings.rearrange and rng.random() < config.rearrange_probability:
        observation, demo = rearranged(observation, demo, rng)
    if mirror is not None:
        observation, demo = mirror.scene(observation), mirror.demonstration(demo, observation.valid.shape)
    transform = _drawn_motion(demo, observation.valid.shape, config, rng)
    look = int(rng.integers(2**62)) if config.jitter else None
    goal = None if drawn.goal is None else drawn.data.observation(drawn.goal)
    if goal is not None and mirror is not None:
        goal = mirror.scene(goal)
    return Sample(
        image=_image(observation, paints, transform, look),
        goal_image=None if goal is None else _image(goal, paints, transform, look),
        phrase=phrase,
        done=demo.done,
        absent=demo.absent,
        primitive=demo.primitive,
        pick=transform.pixel(demo.pick_pixel),
        pick_yaw=demo.pick_yaw + transform.angle,
        pick_yaw_period=demo.pick_yaw_period,
        place=transform.pixel(demo.place_pixel),
        rotation=math.remainder(demo.place_yaw - demo.pick_yaw, 2 * math.pi),
        seed=seed,
    )


def _drawn_motion(
    demo: Demonstration, shape: tuple[int, int], config: TrainConfig, rng: np.random.Generator
) -> PlanarTransform:
    """Draw how a scene is moved, in augment_probability of the samples; turned less where its sentence names a way."""
    if rng.random() >= config.augment_probability:
        return identity_transform()
    keep = [demo.pick_pixel, demo.place_pixel] if demo.acts else []
    directed = is_falsified_by_turning(demo.instruction)
    sigma = config.directed_rotation_sigma_deg if directed else config.rotation_sigma_deg
    return draw_transform(shape, keep, sigma, config.translation_sigma_px, rng)


def _image(
    observation: Heightmap, paints: Repainting | None, transform: PlanarTransform, look: int | None
) -> NDArray[np.float32]:
    """Return channels (H, W, 5), painted, moved, and jittered by the seed `look`; None does not jitter."""
    color: NDArray[np.uint8] = observation.color if paints is None else paints.image(observation)
    height: NDArray[np.float32] = observation.height
    if look is not None:
        rng = np.random.default_rng(look)
        color, height = jitter_color(color, rng), jitter_height(height, rng)
    channels = stack_channels(color, height, observation.valid)
    return channels if transform.is_identity else warp(channels, transform)


def collate(samples: Sequence[Sample]) -> Batch:
    """Stack samples; the images are in channels-last order in memory."""
    goals = [s.goal_image for s in samples if s.goal_image is not None]
    return Batch(
        images=_stack([s.image for s in samples]),
        phrases=[s.phrase for s in samples],
        done=torch.tensor([s.done for s in samples]),
        pick=torch.tensor([s.pick for s in samples]),
        pick_yaw=torch.tensor([s.pick_yaw for s in samples]),
        pick_yaw_period=torch.tensor([s.pick_yaw_period for s in samples]),
        place=torch.tensor([s.place for s in samples]),
        rotation=torch.tensor([s.rotation for s in samples]),
        seeds=torch.tensor([s.seed for s in samples]),
        goal_images=_stack(goals) if goals else None,
        absent=torch.tensor([s.absent for s in samples]),
        primitive=torch.tensor([int(s.primitive) for s in samples]),
    )


def _stack(images: Sequence[NDArray[np.float32]]) -> Tensor:
    """Stack images (H, W, 5) to (B, 5, H, W)."""
    return torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2)
