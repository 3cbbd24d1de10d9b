"""Policy of streams: CLIPort, its baselines and its ablations, by config.

See docs/paper.md, "Two streams" and "Baselines and ablations".
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from cliport_policy.encoders.frozen import EncoderShape, FrozenEncoders
from cliport_policy.errors import ConfigError
from cliport_policy.networks.correlation import correlate_inside
from cliport_policy.networks.policy_network import Goal, PolicyNetwork
from cliport_policy.networks.rotation import bin_angles, rotated_windows
from cliport_policy.networks.streams.semantic import Taps
from cliport_policy.networks.streams.stream_net import StreamNet
from cliport_policy.observation import unscaled
from cliport_policy.stream_config import StreamsConfig

STRIDE = 32  # sizes are padded to a multiple of it: pixels of the semantic stream's coarsest feature
NULL_SCORE = 4.0
IMAGES_PER_CHUNK = 9  # images that a net acts on together: all 36 crops take 150 MB more, and no less time


class StreamsNetwork(PolicyNetwork):
    """Locator, rotator (where configured) and transport, each a StreamNet or two at the full resolution.

    The frozen encoders are shared, not owned: they are neither in parameters() nor in state_dict().
    """

    config: StreamsConfig
    cell_size = 1

    def __init__(
        self, config: StreamsConfig, encoders: FrozenEncoders | None = None, shape: EncoderShape | None = None
    ) -> None:
        """Build the nets; a shape alone is enough to build and count a network.

        A semantic or language net needs the encoders to be run.
        """
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
        """True if encode_goal must be given goal images."""
        return self.config.needs_goal_image

    @property
    def encoder_identity(self) -> str:
        """Identity of the frozen encoders that the weights belong to."""
        return self._encoders.identity if self._encoders is not None else ""

    def encode_goal(self, sentences: Sequence[str], images: Tensor | None = None) -> Goal:
        """Return the goals of B sentences and, if needed, of images (B, 5, H, W) of the finished scenes."""
        language = None
        if self.config.reads_language:
            language = self._require_encoders().encode_sentences(sentences).to(self.null_score.device)
        return Goal(language, images if self.needs_goal_image else None)

    def score_picks(self, images: Tensor, goal: Goal) -> Tensor:
        """Return logits (B, H * W + 1), the last one the null action's."""
        height, width = images.shape[-2:]
        side = _padded_length(max(height, width))
        top, left = (side - height) // 2, (side - width) // 2
        scene = _pad(self._scene("pick", images, goal), top, left, side, side)
        cells = self._run("pick", scene, goal.language)[:, 0, top : top + height, left : left + width]
        return torch.cat((cells.flatten(1), self.null_score.expand(len(images), 1).to(cells.dtype)), dim=1)

    def score_yaws(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor | None:
        """Return logits (B, R) of the gripper's yaw; None without a rotator."""
        if "rotator" not in self.nets:
            return None
        crops = self._crops(self._scene("rotator", images, goal), pick, angles)
        return self._yaw_logits(crops, goal, angles.shape[1], None)

    def score_places(self, images: Tensor, goal: Goal, pick: Tensor, angles: Tensor) -> Tensor:
        """Return logits (B, R, H, W)."""
        # An object in the gripper turns by +angle if its window is cut at -angle.
        crops = self._crops(unscaled(images), pick, -angles)
        return self._place_logits(images, crops, goal, pick, angles, None)

    def score_rotations(self, images: Tensor, goal: Goal, pick: Tensor) -> tuple[Tensor | None, Tensor]:
        """Return the scores at all bins, encoding the crops of rotator and query once.

        The query's crops are the rotator's in another order.
        """
        net = self.config.rotator
        if net is None or not (net.semantic and self.config.query.semantic and net.goal_image == "none"):
            return super().score_rotations(images, goal, pick)
        k = self.config.n_rotations
        angles = bin_angles(k, images.device).expand(len(images), -1)
        crops = self._crops(unscaled(images), pick, angles)
        taps = self._require_encoders().encode_images(crops[:, :3])
        yaws = self._yaw_logits(crops, goal, k, taps)
        entry = torch.arange(len(images), device=images.device)[:, None] * k
        order = (entry + (-torch.arange(k, device=images.device)) % k).flatten()  # bin i's crop at bin -i
        taps = [tap[order] for tap in taps]
        return yaws, self._place_logits(images, crops[order], goal, pick, angles, taps)

    def _yaw_logits(self, crops: Tensor, goal: Goal, n: int, taps: Taps | None) -> Tensor:
        """Return the rotator's score at the middle of each crop: (B * R, 4, side, side) -> (B, R)."""
        scores = self._run("rotator", crops, _repeat_language(goal.language, n), taps)
        middle = self.config.crop_pixels // 2
        return scores[:, 0, middle, middle].reshape(-1, n)

    def _place_logits(
        self, images: Tensor, crops: Tensor, goal: Goal, pick: Tensor, angles: Tensor, taps: Taps | None
    ) -> Tensor:
        height, width = images.shape[-2:]
        batch, n = angles.shape
        half = self.config.crop_pixels // 2
        padded_height, padded_width = _padded_length(height + 2 * half), _padded_length(width + 2 * half)
        query = self._run("query", crops, _repeat_language(goal.language, n), taps)
        scene = _pad(unscaled(images), half, half, padded_height, padded_width)
        key = self._run("key", scene, goal.language)
        if "place_goal" in self.nets:
            after = unscaled(_require_images(goal.images))
            crops_after = self._crops(after, pick, -angles)
            query = query + self._run("place_goal", crops_after, _repeat_language(goal.language, n))
            scene_after = _pad(after, half, half, padded_height, padded_width)
            key = key + self._run("place_goal", scene_after, goal.language)
        windows = query.float().reshape(batch, n, *query.shape[1:])
        scores = correlate_inside(key.float(), windows)
        # A mean over the window, so that an untrained network finds all places about equally likely.
        return scores[..., :height, :width] / self.config.crop_pixels**2

    def _scene(self, name: str, images: Tensor, goal: Goal) -> Tensor:
        scene = unscaled(images)
        if self.config.nets[name].goal_image == "multiply":
            scene = scene * unscaled(_require_images(goal.images))
        return scene

    def _crops(self, scene: Tensor, pick: Tensor, angles: Tensor) -> Tensor:
        """Cut crops (B * R, 4, side, side) turned about the pick, which comes to lie on pixel (side / 2, side / 2)."""
        side = self.config.crop_pixels
        crops = rotated_windows(scene, pick, angles, side + 1)[..., :side, :side].flatten(0, 1)
        return crops.contiguous(memory_format=torch.channels_last)

    def _run(self, name: str, scene: Tensor, language: Tensor | None, taps: Taps | None = None) -> Tensor:
        language = language if self.config.nets[name].language != "none" else None
        if torch.is_grad_enabled() or len(scene) <= IMAGES_PER_CHUNK:
            return self._run_chunk(name, scene, language, taps)
        parts: list[Tensor] = []
        for start in range(0, len(scene), IMAGES_PER_CHUNK):
            chunk = slice(start, start + IMAGES_PER_CHUNK)
            part_language = None if language is None else language[chunk]
            part_taps = None if taps is None else [tap[chunk] for tap in taps]
            parts.append(self._run_chunk(name, scene[chunk], part_language, part_taps))
        return torch.cat(parts)

    def _run_chunk(self, name: str, scene: Tensor, language: Tensor | None, taps: Taps | None) -> Tensor:
        net = self.nets[name]
        if net.reads_taps and taps is None:
            taps = self._require_encoders().encode_images(scene[:, :3])
        out: Tensor = net(scene, language, taps)
        return out

    def _require_encoders(self) -> FrozenEncoders:
        if self._encoders is None:
            raise ConfigError(f"this network was built without its encoders ({self.config.encoder}): it can't be run")
        return self._encoders


def _padded_length(size: int) -> int:
    return -(-size // STRIDE) * STRIDE


def _pad(scene: Tensor, top: int, left: int, height: int, width: int) -> Tensor:
    """Pad a scene to a size, black and at height 0."""
    return F.pad(scene, (left, width - left - scene.shape[-1], top, height - top - scene.shape[-2]))


def _repeat_language(language: Tensor | None, n: int) -> Tensor | None:
    return None if language is None else language.repeat_interleave(n, dim=0)


def _require_images(images: Tensor | None) -> Tensor:
    if images is None:
        raise ConfigError("this network reads an image of the goal: hand one to encode_goal")
    return images
