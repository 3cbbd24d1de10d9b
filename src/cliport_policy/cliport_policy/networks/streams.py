"""A policy of streams: CLIPort, its baselines and its ablations, as a config says (spec, sections 10 to 12)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.errors import ConfigError
from cliport_policy.networks.correlation import correlate_inside
from cliport_policy.networks.policy_network import Goal, PolicyNetwork
from cliport_policy.networks.rotation import bin_angles, rotated_windows
from cliport_policy.networks.semantic import Taps
from cliport_policy.networks.stream_net import EncoderShape, StreamNet
from cliport_policy.observation import unscaled
from cliport_policy.stream_config import StreamsConfig

if TYPE_CHECKING:
    from cliport_policy.encoders.frozen import FrozenEncoders

STRIDE = 32  # what sizes are padded to a multiple of: the semantic stream's coarsest feature
NULL_SCORE = 4.0
AT_ONCE = 9  # images that a net acts on together: all 36 crops take 150 MB more, and no less time


class StreamsNetwork(PolicyNetwork):
    """Locator, rotator (where configured) and transport, each a StreamNet or two at the full resolution.

    The frozen encoders are shared, not owned: they are neither in parameters() nor in state_dict().
    """

    config: StreamsConfig
    cell_size = 1

    def __init__(
        self, config: StreamsConfig, encoders: FrozenEncoders | None = None, shape: EncoderShape | None = None
    ) -> None:
        """shape is enough to build and count a network; to run a semantic or language one takes the encoders."""
        super().__init__()
        self.config = config
        self._encoders = encoders
        shape = shape or (encoders.shape if encoders is not None else EncoderShape((), 0))
        channels = config.transport_channels
        outs = {"pick": 1, "rotator": 1, "query": channels, "key": channels, "place_goal": channels}
        self.nets = nn.ModuleDict(
            {name: StreamNet(net, config, shape, outs[name]) for name, net in config.nets.items()}
        )
        self.null_score = nn.Parameter(torch.tensor(NULL_SCORE))

    @property
    def needs_goal_image(self) -> bool:
        return self.config.needs_goal_image

    @property
    def encoder_identity(self) -> str:
        return self._encoders.identity if self._encoders is not None else ""

    def encode_goal(self, sentences: Sequence[str], images: Tensor | None = None) -> Goal:
        language = None
        if self.config.reads_language:
            language = self._frozen().read(sentences).to(self.null_score.device)
        return Goal(language, images if self.needs_goal_image else None)

    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        height, width = images.shape[-2:]
        side = _up(max(height, width))
        top, left = (side - height) // 2, (side - width) // 2
        scene = _pad(self._scene("pick", images, goal), top, left, side, side)
        cells = self._run("pick", scene, goal.language)[:, 0, top : top + height, left : left + width]
        return torch.cat((cells.flatten(1), self.null_score.expand(len(images), 1).to(cells.dtype)), dim=1)

    def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor | None:
        if "rotator" not in self.nets:
            return None
        crops = self._crops(self._scene("rotator", images, goal), pick, angles)
        return self._yaw_logits(crops, goal, angles.shape[1], None)

    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        # Turning what is held by +angle means reading it at -angle.
        crops = self._crops(unscaled(images), pick, -angles)
        return self._place_logits(images, crops, goal, pick, angles, None)

    def score_rotations(self, images: Tensor, goal: Goal, pick: Tensor) -> tuple[Tensor | None, Tensor]:
        """As in the base class. The query's crops are the rotator's in another order: they are encoded once."""
        net = self.config.rotator
        if net is None or not (net.semantic and self.config.query.semantic and net.goal_image == "none"):
            return super().score_rotations(images, goal, pick)
        k = self.config.n_rotations
        angles = bin_angles(k, images.device).expand(len(images), -1)
        crops = self._crops(unscaled(images), pick, angles)
        taps = self._frozen().see(crops[:, :3])
        yaws = self._yaw_logits(crops, goal, k, taps)
        entry = torch.arange(len(images), device=images.device)[:, None] * k
        order = (entry + (-torch.arange(k, device=images.device)) % k).flatten()  # bin i's crop at bin -i
        taps = [tap[order] for tap in taps]
        return yaws, self._place_logits(images, crops[order], goal, pick, angles, taps)

    def _yaw_logits(self, crops: Tensor, goal: Goal, n: int, taps: Taps | None) -> Tensor:
        """The rotator's map at the pick, of each crop: (B * R, 4, side, side) -> (B, R)."""
        scores = self._run("rotator", crops, _repeated(goal.language, n), taps)
        middle = self.config.crop_pixels // 2
        return scores[:, 0, middle, middle].reshape(-1, n)

    def _place_logits(
        self, images: Tensor, crops: Tensor, goal: Goal, pick: Tensor, angles: Tensor, taps: Taps | None
    ) -> Tensor:
        height, width = images.shape[-2:]
        batch, n = angles.shape
        half = self.config.crop_pixels // 2
        size = (half, half, _up(height + 2 * half), _up(width + 2 * half))
        query = self._run("query", crops, _repeated(goal.language, n), taps)
        key = self._run("key", _pad(unscaled(images), *size), goal.language)
        if "place_goal" in self.nets:
            after = unscaled(_given(goal.images))
            query = query + self._run("place_goal", self._crops(after, pick, -angles), _repeated(goal.language, n))
            key = key + self._run("place_goal", _pad(after, *size), goal.language)
        scores = correlate_inside(key.float(), query.float().reshape(batch, n, *query.shape[1:]))
        # A mean over the window, so that the place is near uniform where nothing is learned yet.
        return scores[..., :height, :width] / self.config.crop_pixels**2

    def _scene(self, name: str, images: Tensor, goal: Goal) -> Tensor:
        scene = unscaled(images)
        if self.config.nets[name].goal_image == "multiply":
            scene = scene * unscaled(_given(goal.images))
        return scene

    def _crops(self, scene: Tensor, pick: Tensor, angles: Tensor) -> Tensor:
        """(B * R, 4, side, side) turned about the pick, which comes to lie on pixel (side / 2, side / 2)."""
        side = self.config.crop_pixels
        crops = rotated_windows(scene, pick, angles, side + 1)[..., :side, :side].flatten(0, 1)
        return crops.contiguous(memory_format=torch.channels_last)

    def _run(self, name: str, scene: Tensor, language: Tensor | None, taps: Taps | None = None) -> Tensor:
        language = language if self.config.nets[name].language != "none" else None
        if torch.is_grad_enabled() or len(scene) <= AT_ONCE:
            return self._run_at_once(name, scene, language, taps)
        parts = [
            self._run_at_once(
                name,
                scene[start : start + AT_ONCE],
                None if language is None else language[start : start + AT_ONCE],
                None if taps is None else [tap[start : start + AT_ONCE] for tap in taps],
            )
            for start in range(0, len(scene), AT_ONCE)
        ]
        return torch.cat(parts)

    def _run_at_once(self, name: str, scene: Tensor, language: Tensor | None, taps: Taps | None) -> Tensor:
        net = self.nets[name]
        if net.reads_taps and taps is None:
            taps = self._frozen().see(scene[:, :3])
        out: Tensor = net(scene, language, taps)
        return out

    def _frozen(self) -> FrozenEncoders:
        if self._encoders is None:
            raise ConfigError(f"this network was built without its encoders ({self.config.encoder}): it can't be run")
        return self._encoders


def _up(size: int) -> int:
    return -(-size // STRIDE) * STRIDE


def _pad(scene: Tensor, top: int, left: int, height: int, width: int) -> Tensor:
    """Black and at height 0 around the scene."""
    return F.pad(scene, (left, width - left - scene.shape[-1], top, height - top - scene.shape[-2]))


def _repeated(language: Tensor | None, n: int) -> Tensor | None:
    return None if language is None else language.repeat_interleave(n, dim=0)


def _given(images: Tensor | None) -> Tensor:
    if images is None:
        raise ConfigError("this network reads an image of the goal: hand one to encode_goal")
    return images
