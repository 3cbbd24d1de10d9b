"""Training batches: demonstrations drawn, reworded, augmented and stacked in background threads."""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from cliport_policy.augmentation import draw_transform, identity_transform, jitter_color, warp
from cliport_policy.config import TrainConfig
from cliport_policy.demonstrations import DemonstrationSet
from cliport_policy.observation import stack_channels, to_tensor
from cliport_policy.paraphrase import paraphrase


class Sample(NamedTuple):
    """One augmented training sample; pixels are float (row, col)."""

    image: Tensor  # (5, H, W)
    phrase: str
    done: bool
    pick: tuple[float, float]
    pick_yaw: float
    pick_yaw_period: float
    place: tuple[float, float]
    rotation: float  # place yaw - pick yaw, rad


class Batch(NamedTuple):
    """A batch as the loss takes it. Pixels are float (row, col); angles rad."""

    images: Tensor  # (B, 5, H, W)
    phrases: list[str]
    done: Tensor  # (B,) bool
    pick: Tensor  # (B, 2)
    pick_yaw: Tensor  # (B,)
    pick_yaw_period: Tensor  # (B,)
    place: Tensor  # (B, 2)
    rotation: Tensor  # (B,)


class Phrasebook:
    """A fixed number of wordings a goal, drawn once, so that their embeddings can be kept."""

    def __init__(self, instructions: list[str], phrases_per_goal: int, rng: np.random.Generator) -> None:
        self._phrases = {
            text: sorted({text, *(paraphrase(text, rng) for _ in range(phrases_per_goal))})
            for text in sorted(set(instructions))
        }

    def draw(self, instruction: str, rng: np.random.Generator) -> str:
        options = self._phrases[instruction]
        return options[int(rng.integers(len(options)))]

    def all_phrases(self) -> list[str]:
        return sorted({phrase for phrases in self._phrases.values() for phrase in phrases})


def make_sample(
    data: DemonstrationSet,
    index: tuple[int, int],
    phrasebook: Phrasebook,
    config: TrainConfig,
    rng: np.random.Generator,
) -> Sample:
    """One demonstration, reworded, its observation jittered and (with augment_probability) moved by an SE(2)."""
    frame = data.frames[index[0]]
    demo = frame.demos[index[1]]
    channels = stack_channels(jitter_color(frame.color, rng), data.height_m(frame), frame.valid)
    transform = identity_transform()
    if rng.random() < config.augment_probability:
        keep = [] if demo.done else [demo.pick_pixel, demo.place_pixel]
        transform = draw_transform(frame.valid.shape, keep, config.rotation_sigma_deg, config.translation_sigma_px, rng)
        channels = warp(channels, transform)
    return Sample(
        image=to_tensor(channels),
        phrase=phrasebook.draw(demo.instruction, rng),
        done=demo.done,
        pick=transform.pixel(demo.pick_pixel),
        pick_yaw=demo.pick_yaw + transform.angle,
        pick_yaw_period=demo.pick_yaw_period,
        place=transform.pixel(demo.place_pixel),
        rotation=math.remainder(demo.place_yaw - demo.pick_yaw, 2 * math.pi),
    )


def collate(samples: list[Sample]) -> Batch:
    return Batch(
        images=torch.stack([s.image for s in samples]).contiguous(memory_format=torch.channels_last),
        phrases=[s.phrase for s in samples],
        done=torch.tensor([s.done for s in samples]),
        pick=torch.tensor([s.pick for s in samples]),
        pick_yaw=torch.tensor([s.pick_yaw for s in samples]),
        pick_yaw_period=torch.tensor([s.pick_yaw_period for s in samples]),
        place=torch.tensor([s.place for s in samples]),
        rotation=torch.tensor([s.rotation for s in samples]),
    )


def batches(data: DemonstrationSet, phrasebook: Phrasebook, config: TrainConfig, first_step: int) -> Iterator[Batch]:
    """Endless batches from first_step on; batch i is the same whenever it is drawn, so training can be resumed.

    One demonstration in three of an observation's goals is drawn as often as another; samples are drawn with
    replacement, an action as likely as a frame where nothing remains to be done is rare.
    """
    samples = data.samples()
    done = np.array([data.frames[i].demos[j].done for i, j in samples])
    weight = np.where(done, 0.15 / max(done.sum(), 1), 0.85 / max((~done).sum(), 1))
    weight /= weight.sum()

    def make(step: int) -> Batch:
        rng = np.random.default_rng((config.seed, step))
        chosen = rng.choice(len(samples), config.batch_size, p=weight)
        return collate([make_sample(data, samples[int(i)], phrasebook, config, rng) for i in chosen])

    with ThreadPoolExecutor(1) as pool:
        pending = [pool.submit(make, first_step + i) for i in range(2)]
        step = first_step + 2
        try:
            while True:
                yield pending.pop(0).result()
                pending.append(pool.submit(make, step))
                step += 1
        finally:
            for future in pending:
                future.cancel()
