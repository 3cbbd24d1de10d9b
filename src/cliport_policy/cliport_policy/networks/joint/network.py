"""Joint policy network: one look at the scene for pick, place, primitive and the two null actions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_core.action import Primitive
from cliport_policy.joint_config import JointConfig
from cliport_policy.language import shared_encoder
from cliport_policy.named_colors import basic_tokens, color_name_reader
from cliport_policy.networks.compact.goal_reader import GoalReader
from cliport_policy.networks.compact.rotator import Rotator
from cliport_policy.networks.joint.aligner import Aligner
from cliport_policy.networks.joint.color_maps import ColorMaps, is_known, shown_by_maps, without_colors
from cliport_policy.networks.joint.transport import GatedTransport
from cliport_policy.networks.joint.trunk import Decoder, Encoder, pooled
from cliport_policy.networks.policy_network import Goal, Placings, PolicyNetwork
from cliport_policy.observation import CHANNELS

_HEAD_WIDTH = 96
_COLOR_POOL = 8  # cells along the side of a patch that must be of a colour for it to be there


class JointNetwork(PolicyNetwork):
    """Encoder that the goal modulates, decoders for picks and places, rotator and aligner on crops, and heads."""

    config: JointConfig
    cell_size = 2

    def __init__(self, config: JointConfig) -> None:
        super().__init__()
        self.config = config
        self.n_null = config.null_actions
        goal_dim = 2 * config.goal_dim
        self.goal_reader = GoalReader(config.token_dim, config.goal_dim)
        has_maps = config.color_words != "none"
        self.color_maps = ColorMaps(config.token_dim, config.goal_dim, config.compares_colors) if has_maps else None
        n_maps = ColorMaps.n_maps if has_maps else 0
        self.encoder = Encoder(4 * CHANNELS + n_maps, config.widths, goal_dim, config.goal_dim, config.context_layers)
        self.pick_decoder = Decoder(config.widths, config.decoder_width, goal_dim)
        self.place_decoder = Decoder(config.widths, config.decoder_width, goal_dim)
        self.pick_head = nn.Conv2d(config.decoder_width, 1, 1)
        self.transport = GatedTransport(
            config.decoder_width, config.transport_channels, config.query_cells, config.gate
        )
        self.rotator = Rotator(CHANNELS, goal_dim, config.crop_pixels)
        self.aligner = Aligner(CHANNELS, goal_dim, config.crop_pixels) if config.aligner else None
        whole = 2 * config.widths[-1] + goal_dim + n_maps
        self.null_head = _head(whole, config.null_actions)
        self.primitive_head = _head(whole, len(Primitive)) if config.chooses_primitive else None
        self.null_score = nn.Parameter(torch.full((config.null_actions,), 4.0))

    @property
    def has_aligner(self) -> bool:
        """True if the config has an aligner."""
        return self.aligner is not None

    def encode_goal(self, sentences: Sequence[str], images: Tensor | None = None) -> Goal:
        """Return the goals of B sentences; images are not read."""
        device = self.null_score.device
        if self.config.color_reading == "names":
            found = color_name_reader().read(sentences, self.config.color_words)
            read, tokens, shades, mask = (part.to(device) for part in found)
        else:
            tokens, mask = (part.to(device) for part in shared_encoder().encode_cached(sentences))
            read, shades = tokens, None
        words = self.goal_reader.read_words(read, mask)
        return Goal(self.goal_reader.pool_words(words, mask), tokens=tokens, words=words, shades=shades, mask=mask)

    def look(self, images: Tensor, goal: Goal) -> Goal:
        """Return the goals with the encoder's levels and a vector of the whole scene, the last one.

        In training gray_share of the samples are seen in grey, with their colours in the colour maps alone. So is a
        scene whose sentence has a name of the survey: things of such colours look like nothing that was learned from.
        """
        tokens, words, mask, language = goal.tokens, goal.words, goal.mask, goal.language
        assert tokens is not None and words is not None and mask is not None and language is not None
        whole = [language]
        x = F.pixel_unshuffle(images, 2)  # (B, 4 C, H/2, W/2)
        by_name = self.config.color_reading == "names"
        basic = basic_tokens(self.config.color_words).to(x.device) if by_name else None
        maps = None if self.color_maps is None else self.color_maps(x, tokens, words, mask, basic, goal.shades)
        if self.training and self.config.gray_share:
            gray = torch.rand(len(images)) < self.config.gray_share
            x = without_colors(x, gray.to(images.device))
        if maps is not None:
            known = None if goal.shades is None else is_known(goal.shades).any(1)
            if known is not None and known.any():
                x = shown_by_maps(x, maps, known)
            x = torch.cat((x, maps.to(x.dtype)), dim=1)
            whole.append(F.avg_pool2d(maps, _COLOR_POOL, _COLOR_POOL // 2).amax((2, 3)).to(language.dtype))
        levels = self.encoder(x.contiguous(memory_format=torch.channels_last), language, words, mask)
        whole.append(pooled(levels).to(language.dtype))
        return replace(goal, seen=(*levels, torch.cat(whole, dim=1)))

    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        """Return logits (B, h * w + n_null), the last ones the null actions'."""
        goal = self._seen(images, goal)
        cells = self.pick_head(self.pick_decoder(goal.seen[:-1], goal.language)).flatten(1)
        null = self.null_score + self.null_head(goal.seen[-1])
        return torch.cat((cells, null.to(cells.dtype)), dim=1)

    def score_primitives(self, images: Tensor, goal: Goal) -> Tensor | None:
        """Return logits (B, number of primitives), or None."""
        if self.primitive_head is None:
            return None
        logits: Tensor = self.primitive_head(self._seen(images, goal).seen[-1])
        return logits

    def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor | None:
        """Return logits (B, R) of the gripper's yaw."""
        return self.rotator(images, goal.language, pick, angles)

    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        """Return logits (B, R, h, w)."""
        goal = self._seen(images, goal)
        return self.transport(self.place_decoder(goal.seen[:-1], goal.language), pick, angles)

    def score_fits(self, images: Tensor, goal: Goal, placings: Placings) -> Tensor:
        """Return logits (B, R); not without an aligner."""
        assert self.aligner is not None
        logits: Tensor = self.aligner(images, goal.language, placings)
        return logits

    def _seen(self, images: Tensor, goal: Goal) -> Goal:
        return goal if goal.seen else self.look(images, goal)


def _head(width: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(nn.LayerNorm(width), nn.Linear(width, _HEAD_WIDTH), nn.GELU(), nn.Linear(_HEAD_WIDTH, outputs))
