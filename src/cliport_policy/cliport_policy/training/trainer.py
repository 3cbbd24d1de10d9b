"""Training loop: steps, averaged weights, checkpoints by minutes and by steps, and resuming to the exact state."""

from __future__ import annotations

import copy
import logging
import math
import time
from collections.abc import Callable, Collection, Sequence
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from cliport_policy.card import Card
from cliport_policy.checkpoint import ANCHORS, save_checkpoint
from cliport_policy.config import TrainConfig
from cliport_policy.data.batches import Phrasebook
from cliport_policy.data.loader import WORKERS, Loader, StepBatches, lost_workers_told
from cliport_policy.data.mixture import Mixture, Source, SourceSettings
from cliport_policy.data.recolor import Recoloring
from cliport_policy.data.wordings import sentence_groups, share_wordings
from cliport_policy.errors import TrainingError
from cliport_policy.language import ENCODER_NAME, TextEncoder
from cliport_policy.named_configs import AnyNetworkConfig
from cliport_policy.networks.factory import build_network, has_fast_bfloat16
from cliport_policy.policy import Policy
from cliport_policy.training.distributed import Group
from cliport_policy.training.inherited_presence import Inherited, inherited_presence
from cliport_policy.training.initial import Initial, primitive_of
from cliport_policy.training.losses import Losses, compute_losses
from cliport_policy.training.state import resume_state, save_state

logger = logging.getLogger(__name__)

N_ANCHORS = 256
COVERED = 0.85  # similarity to an anchor of its initial checkpoint from which on a phrase needs none of this training
MAX_PHRASES = 12_000  # wordings of all sentences, whose embeddings fit the encoder's cache
# Lower than the similarity of every sentence of the training grammar (at least 0.58 for wordings not drawn, of all ten
# tasks; 0.45 with 64 anchors) and higher than that of sentences about other things (at most 0.42 in a list of twenty).
MIN_SIMILARITY = 0.45
SINGLE_PROCESS = Group()


class Progress(NamedTuple):
    """Report after a step.

    losses: the step's, by name. samples_per_s, minutes_left: by the pace since this start.
    """

    step: int
    steps: int
    losses: dict[str, float]
    learning_rate: float
    samples_per_s: float
    minutes_left: float


class Trainer:
    """Training of one network on a mixture of data sets into one folder; made again on that folder, it resumes."""

    def __init__(
        self,
        sources: Sequence[Source],
        folder: Path,
        network_config: AnyNetworkConfig,
        config: TrainConfig,
        encoder: TextEncoder,
        made_by: dict[str, Any],
        group: Group = SINGLE_PROCESS,
        initial: Initial | None = None,
    ) -> None:
        """Build or restore network, optimiser and loader.

        initial: checkpoint of this network_config to begin with; None: random weights.

        Raises:
            ConfigError: if the settings do not fit the network.
            DataError: if the data or the folder do not fit.
            EncoderError: if an encoder's file is absent.
            CheckpointError: if the initial weights do not fit.
        """
        self.folder, self.config, self.made_by, self.group, self.encoder = folder, config, made_by, group, encoder
        self.initial = initial
        self.primitive = primitive_of([source.data for source in sources], network_config, initial)
        torch.manual_seed(config.seed)
        network = build_network(network_config).to(group.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        if network.needs_goal_image:
            config.check_goal_images_stay_true()
        if initial is not None:
            initial.put_into(network)
        group.share(network)
        self.network = network
        self.average = copy.deepcopy(network).eval() if config.ema_decay else network
        learned = [value for value in network.parameters() if value.requires_grad]
        self.optimizer = torch.optim.AdamW(learned, lr=config.learning_rate, weight_decay=config.weight_decay)
        self.data = Mixture(sources, config.done_share, network.needs_goal_image)
        recoloring, phrasebook = self._draw_wordings()
        self.loader = Loader(self.data, phrasebook, config, recoloring, group.rank, group.size)
        self._anchors = self._anchor_vectors(phrasebook) if group.is_first else None
        self._presence = self._inherited_presence()
        self.step = resume_state(folder, self._modules(), self.optimizer, self._identity())

    def run(
        self,
        on_step: Callable[[Progress], None],
        save_minutes: float = 3.0,
        max_minutes: float = math.inf,
        should_stop: Callable[[], bool] = lambda: False,
        keep_steps: Collection[int] = (),
        on_save: Callable[[], None] = lambda: None,
        on_keep: Callable[[], None] = lambda: None,
    ) -> None:
        """Train until the last step, max_minutes or should_stop; save every save_minutes and at the end.

        keep_steps: steps after which a policy is kept for good, as checkpoints/step-NNNNNNN.safetensors.
        on_step, on_save and on_keep are called in the group's first process only. After an error the last save stays.

        Raises:
            TrainingError: if the loss is no number, or a process that makes batches is gone.
            CheckpointError: if nothing can be saved.
            DataError: if an observation can't be read.
        """
        started = saved = time.monotonic()
        first = self.step
        workers = 0 if self.group.device.type == "cpu" else WORKERS
        with lost_workers_told(), closing(self.loader.steps(self.step, workers)) as steps:
            while self.step < self.config.steps:
                minutes = (time.monotonic() - started) / 60
                if self.group.any(should_stop() or minutes > max_minutes):
                    break
                losses = self._train_step(next(steps))
                self.step += 1
                if not self.group.is_first:
                    continue
                on_step(self._progress(losses, (self.step - first) / (time.monotonic() - started)))
                if self.step in keep_steps:
                    self.save_policy(self.folder / "checkpoints" / f"step-{self.step:07d}.safetensors")
                    on_keep()
                if time.monotonic() - saved > 60 * save_minutes:
                    self._save_and_tell(on_save)
                    saved = time.monotonic()
        if self.group.is_first:
            self._save_and_tell(on_save)

    def _save_and_tell(self, on_save: Callable[[], None]) -> None:
        self.save()
        on_save()

    def save(self) -> None:
        """Write the averaged weights as a policy, and the state to resume from."""
        self.save_policy(self.folder / "policy.safetensors")
        save_state(self.folder, self._modules(), self.optimizer, self.step, self._identity())

    def save_policy(self, path: Path) -> None:
        """Write the averaged weights and their card."""
        tensors = {name: value.cpu() for name, value in self.average.state_dict().items()}
        tensors |= {ANCHORS: self._require_anchors(), **self._presence.tensors}
        save_checkpoint(path, tensors, replace(self._card(), presence=self._presence.facts))

    def policy(self) -> Policy:
        """Return the averaged network as a policy that acts, on the CPU."""
        network = self.average if self.group.device.type == "cpu" else copy.deepcopy(self.average).cpu()
        return Policy(network, self._require_anchors(), self._card(), self.encoder)

    def _train_step(self, step: StepBatches) -> dict[str, float]:
        self.network.train()
        # Dropout draws from the global generator: by step, so that a resumed training draws the same.
        torch.manual_seed((self.config.seed * 1_000_003 + self.step) * 1009 + self.group.rank)
        for group in self.optimizer.param_groups:
            group["lr"] = self.config.learning_rate_at(self.step)
        self.optimizer.zero_grad(set_to_none=True)
        device = self.group.device
        sums = torch.zeros(len(Losses._fields), device=device)
        for part in step.parts:
            with torch.autocast(device.type, torch.bfloat16, enabled=self._autocasts()):
                losses = compute_losses(self.network, part.to(device), self.config, step.samples, step.actions)
            losses.total().backward()
            sums += torch.stack(losses).detach()
        values = dict(zip(Losses._fields, self.group.sum(sums).tolist(), strict=True))
        if not all(math.isfinite(value) for value in values.values()):
            raise TrainingError(f"the loss is no number at step {self.step} ({values}): lower --learning-rate")
        self.group.sum_gradients(self.network.parameters())
        if self.config.gradient_clip:
            nn.utils.clip_grad_norm_(self.network.parameters(), self.config.gradient_clip)
        self.optimizer.step()
        self._update_average()
        return values

    def _autocasts(self) -> bool:
        if self.config.precision == "auto":
            return self.group.device.type == "cuda" or has_fast_bfloat16()
        return self.config.precision == "bfloat16"

    @torch.no_grad()
    def _update_average(self) -> None:
        if self.average is self.network:
            return
        decay = min(self.config.ema_decay, (1 + self.step) / (10 + self.step))
        for mean, value in zip(self.average.state_dict().values(), self.network.state_dict().values(), strict=True):
            if mean.dtype.is_floating_point:
                mean.lerp_(value, 1 - decay)
            else:
                mean.copy_(value)

    def _progress(self, losses: dict[str, float], steps_per_s: float) -> Progress:
        return Progress(
            self.step,
            self.config.steps,
            losses,
            self.config.learning_rate_at(self.step - 1),
            steps_per_s * self.config.batch_size,
            (self.config.steps - self.step) / steps_per_s / 60,
        )

    def _modules(self) -> dict[str, nn.Module]:
        own = {"network": self.network}
        return own if self.average is self.network else {**own, "average": self.average}

    def _draw_wordings(self) -> tuple[Recoloring | None, Phrasebook]:
        config, recoloring = self.config, None
        if config.recolor != "none":
            surveyed = config.recolor == "surveyed"
            recoloring = Recoloring(self.data, surveyed, np.random.default_rng((config.seed, 2)))
        wordings = share_wordings(sentence_groups(self.data, recoloring, config), MAX_PHRASES)
        return recoloring, Phrasebook(wordings, np.random.default_rng((config.seed, 1)))

    def _inherited_presence(self) -> Inherited:
        if self.initial is None or not self.group.is_first:  # the first process saves
            return Inherited({}, {})
        return inherited_presence(self.initial, [source.data for source in self.data.sources], self.encoder)

    def _anchor_vectors(self, phrasebook: Phrasebook) -> Tensor:
        """Return anchors of this training and of its initial checkpoint, whose sentences must not be refused now."""
        vectors = phrase_vectors(self.encoder, phrasebook.all_phrases())
        if self.initial is None:
            return _farthest_points(vectors)
        known = torch.unique(self.initial.anchors, dim=0)
        far = vectors[(vectors @ known.T).amax(1) < COVERED]
        return torch.cat((known, _farthest_points(far))) if len(far) else known

    def _identity(self) -> dict[str, Any]:
        drawn_from = {"demonstrations": len(self.data), "weights": [source.weight for source in self.data.sources]}
        switches = [asdict(source.settings) for source in self.data.sources]
        if any(setting != asdict(SourceSettings()) for setting in switches):
            drawn_from["settings"] = switches
        identity = {"network": self.network.config.to_dict(), "train": self.config.to_dict(), "data": drawn_from}
        identity["primitive"] = self.primitive.label
        return identity if self.initial is None else {**identity, "init": self.initial.sha256}

    def _card(self) -> Card:
        return Card(
            network=self.network.config,
            workspace=self.data.workspace,
            encoder=ENCODER_NAME,
            min_similarity=MIN_SIMILARITY,
            made_by={
                **self.made_by,
                **({} if self.initial is None else {"init": self.initial.to_dict()}),
                "train": self.config.to_dict(),
                "steps_done": self.step,
                "processes": self.group.size,
                "frames": sum(len(source.data.frames) for source in self.data.sources),
                "data": [{"weight": source.weight, **source.data.meta} for source in self.data.sources],
            },
            frozen=self.network.encoder_identity,
            primitive=self.primitive,
            done_bias={} if self.initial is None else self.initial.card.done_bias,
        )

    def _require_anchors(self) -> Tensor:
        assert self._anchors is not None, "the group's first process saves"
        return self._anchors


def phrase_vectors(encoder: TextEncoder, phrases: list[str], chunk: int = 2560) -> Tensor:
    """Return sentence vectors of all training phrases (P, 384); the encoder remembers their tokens."""
    vectors: list[Tensor] = []
    for start in range(0, len(phrases), chunk):
        vectors.append(encoder.encode_cached(phrases[start : start + chunk]).sentence_vectors())
        logger.info("embedding phrases: %d of %d", min(start + chunk, len(phrases)), len(phrases))
    return torch.cat(vectors)


def _farthest_points(vectors: Tensor) -> Tensor:
    """Return up to N_ANCHORS sentence vectors, far from each other (greedy farthest points): (A, 384), unit length."""
    chosen = [0]
    nearest = vectors @ vectors[0]
    while len(chosen) < min(N_ANCHORS, len(vectors)):
        chosen.append(int(nearest.argmin()))
        nearest = torch.maximum(nearest, vectors @ vectors[chosen[-1]])
    return vectors[chosen]
