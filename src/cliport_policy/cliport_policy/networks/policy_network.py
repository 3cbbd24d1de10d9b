"""Interface of every policy network, so that one training step and one `infer` serve them all."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

from torch import Tensor, nn

from cliport_policy.named_configs import AnyNetworkConfig
from cliport_policy.networks.rotation import bin_angles


@dataclass(frozen=True, eq=False)
class Goal:
    """Batch of goals, and what a network has seen of their scenes.

    language: (B, D), the sentences' vectors. images: (B, 5, H, W), the finished scenes, if given.
    tokens: (B, T, ...), the words' frozen embeddings, and words, what the network made of them; shades: (B, T, 3),
    scaled CIELAB of words whose colour is known, NaN at others; mask: (B, T), True at a word. seen: features (B, ...)
    of the observations, which `look` adds.
    """

    language: Tensor | None = None
    images: Tensor | None = None
    tokens: Tensor | None = None
    words: Tensor | None = None
    shades: Tensor | None = None
    mask: Tensor | None = None
    seen: tuple[Tensor, ...] = ()

    def select(self, index: Tensor) -> Goal:
        """Return the goals of some entries: a bool mask (B,) or indices."""
        one = {
            field.name: None if getattr(self, field.name) is None else getattr(self, field.name)[index]
            for field in fields(self)
            if field.name != "seen"
        }
        return Goal(**one, seen=tuple(features[index] for features in self.seen))


class Placings(NamedTuple):
    """Batch of picks, and R places with a rotation each that what is picked may be put down at.

    pick: (B, 2) float pixel. yaw: (B,) rad, the gripper's there. places: (B, R, 2) float pixels. angles: (B, R) rad,
    relative to that yaw. cells: (B, side, side, 2), in training: offsets (column, row) in the gripper's frame, in
    pixels, of what is compared of pick and place, distorted alike, so that what fits still fits.
    """

    pick: Tensor
    yaw: Tensor
    places: Tensor
    angles: Tensor
    cells: Tensor | None = None


class PolicyNetwork(nn.Module, ABC):
    """Network that scores picks, yaws and places.

    Images are (B, 5, H, W) as observation.py makes them. Pixels are float (row, col); angles in rad.
    cell_size: pixels along the side of one cell of the pick's and the place's maps; h = H / cell_size, w likewise.
    acts_in_bfloat16: True if a policy lets torch compute in bfloat16 what loses little by it; weights stay as they are.
    """

    config: AnyNetworkConfig
    cell_size: int
    acts_in_bfloat16 = False
    n_null = 1  # logits of the pick that stand for no cell: "done", then "not here" where it is told apart

    @property
    def needs_goal_image(self) -> bool:
        """True if encode_goal must be given goal images."""
        return False

    @property
    def has_aligner(self) -> bool:
        """True if score_fits is to be had; otherwise score_places decides alone."""
        return False

    @property
    def encoder_identity(self) -> str:
        """Identity of the frozen encoders that the weights belong to; empty for the policy's own sentence encoder."""
        return ""

    def compile_parts(self, backend: str = "inductor") -> None:
        """Let torch compile each net at its first use: half a minute then, faster afterwards."""
        for module in self.children():
            parts = module.values() if isinstance(module, nn.ModuleDict) else (module,)
            for part in parts:
                part.compile(backend=backend)

    @abstractmethod
    def encode_goal(self, sentences: Sequence[str], images: Tensor | None = None) -> Goal:
        """Return the goals of B sentences, on the network's device.

        images: (B, 5, H, W), the finished scenes, if the network needs them.
        """

    def look(self, images: Tensor, goal: Goal) -> Goal:
        """Return the goals with what the scores have in common, so that it is computed once; themselves if nothing."""
        return goal

    def score_primitives(self, images: Tensor, goal: Goal) -> Tensor | None:
        """Return logits (B, number of primitives); None where the demonstrations' one is taken."""
        return None

    @abstractmethod
    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        """Return logits (B, h * w + n_null), the last ones the null actions'.

        The first of them is "nothing remains to be done", the second "what the sentence names is not here".
        """

    @abstractmethod
    def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor | None:
        """Return logits (B, R) of the gripper's yaw; None without a rotator.

        pick: (B, 2). angles: (B, R).
        """

    @abstractmethod
    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        """Return logits (B, R, h, w).

        pick: (B, 2). angles: (B, R), relative to the pick's yaw.
        """

    def score_fits(self, images: Tensor, goal: Goal, placings: Placings) -> Tensor:
        """Return logits (B, R) of places, each under a rotation, where has_aligner is True.

        They come on top of score_places: by how much more often an expert goes there than score_places has it.
        """
        raise ValueError(f"{type(self).__name__} has no aligner: ask only where has_aligner is True")

    def score_rotations(self, images: Tensor, goal: Goal, pick: Tensor) -> tuple[Tensor | None, Tensor]:
        """Return score_yaws and score_places at all k rotation bins: (B, k) or None, (B, k, h, w)."""
        angles = bin_angles(self.config.n_rotations, images.device).expand(len(images), -1)
        return self.score_yaws(images, goal, pick, angles), self.score_places(images, goal, pick, angles)


def count_parameters(module: nn.Module) -> int:
    """Return the number of values that a module learns."""
    return sum(p.numel() for p in module.parameters() if p.requires_grad)
