"""The training loop: steps, checkpoints by minutes, resuming, and agreement with held-out demonstrations."""

from __future__ import annotations

import copy
import logging
import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from cliport_policy.batches import Batch, Phrasebook, batches, collate, make_sample
from cliport_policy.checkpoint import ANCHORS, Card, save_checkpoint, write_json
from cliport_policy.config import TrainConfig
from cliport_policy.demonstrations import DemonstrationSet
from cliport_policy.errors import DataError, TrainingError
from cliport_policy.language import ENCODER_NAME, TextEncoder
from cliport_policy.losses import compute_losses
from cliport_policy.named_configs import AnyNetworkConfig
from cliport_policy.networks.factory import build_network
from cliport_policy.networks.policy_network import PolicyNetwork

logger = logging.getLogger(__name__)

N_ANCHORS = 64
# Below every sentence of the training grammar (0.60 at the least for wordings not drawn) and above what is said of
# other things (0.38 at the most in a list of thirty).
MIN_SIMILARITY = 0.45
AGREE_RADIUS = 0.03  # m


def phrase_vectors(encoder: TextEncoder, phrases: list[str], chunk: int = 2560) -> Tensor:
    """Sentence vectors of all training phrases (P, 384); the encoder remembers their tokens."""
    vectors: list[Tensor] = []
    for start in range(0, len(phrases), chunk):
        vectors.append(encoder.batch(phrases[start : start + chunk]).sentence_vectors())
        logger.info("embedding phrases: %d of %d", min(start + chunk, len(phrases)), len(phrases))
    return torch.cat(vectors)


@dataclass(frozen=True)
class Agreement:
    """Share of held-out demonstrations with which the policy agrees: 3 cm for poses, one bin for yaw.

    pick is a lower bound: where several objects would do, another choice than the expert's counts as wrong.
    """

    pick: float
    yaw: float
    place: float
    done: float
    n: int


class Trainer:
    """Trains one network on one demonstration set into one folder; made again on that folder, it resumes."""

    def __init__(
        self,
        data: DemonstrationSet,
        folder: Path,
        network_config: AnyNetworkConfig,
        config: TrainConfig,
        encoder: TextEncoder,
        made_by: dict[str, Any],
    ) -> None:
        self.data, self.folder, self.config, self.made_by = data, folder, config, made_by
        torch.manual_seed(config.seed)
        self.network = build_network(network_config).to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.average = copy.deepcopy(self.network).eval()
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        rng = np.random.default_rng((config.seed, 1))
        instructions = [demo.instruction for frame in data.frames for demo in frame.demos]
        self.phrasebook = Phrasebook(instructions, config.phrases_per_goal, rng)
        self.phrase_vectors = phrase_vectors(encoder, self.phrasebook.all_phrases())
        self.step = 0
        if self._state_path.is_file():
            self._resume()

    @property
    def _state_path(self) -> Path:
        return self.folder / "training_state.safetensors"

    def run(
        self,
        on_progress: Callable[[dict[str, float]], None],
        save_minutes: float = 3.0,
        max_minutes: float = math.inf,
        should_stop: Callable[[], bool] = lambda: False,
    ) -> None:
        """Train until the last step, max_minutes or should_stop; saves every save_minutes and at the end."""
        start = last_save = time.monotonic()
        sums: dict[str, float] = {}
        first = self.step
        for batch in batches(self.data, self.phrasebook, self.config, self.step):
            now = time.monotonic()
            if self.step >= self.config.steps or should_stop() or now - start > 60 * max_minutes:
                break
            losses = self._train_step(batch)
            for name, value in losses.items():
                sums[name] = 0.98 * sums.get(name, value) + 0.02 * value
            self.step += 1
            if self.step % 50 == 0:
                rate = (self.step - first) / (time.monotonic() - start)
                on_progress(
                    {
                        "step": self.step,
                        "samples_per_s": rate * self.config.batch_size,
                        "eta_min": (self.config.steps - self.step) / rate / 60,
                        **sums,
                    }
                )
            if now - last_save > 60 * save_minutes:
                self.save()
                last_save = time.monotonic()
        self.save()

    def _train_step(self, batch: Batch) -> dict[str, float]:
        self.network.train()
        for group in self.optimizer.param_groups:
            group["lr"] = self._learning_rate()
        generator = torch.Generator().manual_seed(self.config.seed * 1_000_003 + self.step)
        with torch.autocast("cpu", torch.bfloat16):
            losses = compute_losses(self.network, batch, self.config, generator)
        total = losses.total()
        if not torch.isfinite(total):
            raise TrainingError(f"the loss is {float(total.detach())} at step {self.step}: lower --learning-rate")
        self.optimizer.zero_grad(set_to_none=True)
        total.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), self.config.gradient_clip)
        self.optimizer.step()
        self._update_average()
        return {name: float(value.detach()) for name, value in losses._asdict().items()}

    def _learning_rate(self) -> float:
        """Linear warm-up, then a cosine to a hundredth."""
        warm = min(1.0, (self.step + 1) / self.config.warmup_steps)
        progress = self.step / self.config.steps
        return self.config.learning_rate * warm * (0.01 + 0.99 * 0.5 * (1 + math.cos(math.pi * min(progress, 1.0))))

    @torch.no_grad()
    def _update_average(self) -> None:
        decay = min(self.config.ema_decay, (1 + self.step) / (10 + self.step))
        for mean, value in zip(self.average.state_dict().values(), self.network.state_dict().values(), strict=True):
            if mean.dtype.is_floating_point:
                mean.lerp_(value, 1 - decay)
            else:
                mean.copy_(value)

    def save(self) -> None:
        """Write the averaged weights as a policy, and all that resuming needs."""
        self.folder.mkdir(parents=True, exist_ok=True)
        anchors = self._anchors()
        card = Card(
            network=self.network.config,
            workspace=self.data.workspace,
            encoder=ENCODER_NAME,
            min_similarity=MIN_SIMILARITY,
            made_by={
                **self.made_by,
                "train": self.config.to_dict(),
                "steps_done": self.step,
                "frames": len(self.data.frames),
                "data": self.data.meta,
            },
            frozen=self.network.encoder_identity,
        )
        save_checkpoint(
            self.folder / "policy.safetensors",
            {**self.average.state_dict(), ANCHORS: anchors},
            card,
        )
        state = {f"network.{k}": v for k, v in self.network.state_dict().items()}
        state |= {f"average.{k}": v for k, v in self.average.state_dict().items()}
        for index, slot in self.optimizer.state_dict()["state"].items():
            state |= {f"optimizer.{index}.{k}": torch.as_tensor(v) for k, v in slot.items()}
        state["step"] = torch.tensor(self.step)
        temporary = self._state_path.with_suffix(".tmp")
        save_file({k: v.clone().contiguous() for k, v in state.items()}, temporary)
        temporary.replace(self._state_path)
        write_json(self.folder / "training_config.json", self._identity())

    def _identity(self) -> dict[str, Any]:
        return {"network": self.network.config.to_dict(), "train": self.config.to_dict()}

    def _resume(self) -> None:
        try:
            state = load_file(self._state_path)
            self.network.load_state_dict(_part(state, "network."))
            self.average.load_state_dict(_part(state, "average."))
            slots: dict[int, dict[str, Tensor]] = {}
            for name, value in _part(state, "optimizer.").items():
                index, key = name.split(".", 1)
                slots.setdefault(int(index), {})[key] = value
            groups = self.optimizer.state_dict()["param_groups"]
            self.optimizer.load_state_dict({"state": slots, "param_groups": groups})
            self.step = int(state["step"])
        except Exception as error:
            raise DataError(
                f"{self.folder} can't be resumed with these settings ({' '.join(str(error).split())[:160]}): "
                "give another --out or the settings it was begun with"
            ) from error

    def _anchors(self) -> Tensor:
        """A spread of training sentences' vectors (greedy farthest points): (64, 384), unit length."""
        vectors = self.phrase_vectors
        chosen = [0]
        nearest = vectors @ vectors[0]
        while len(chosen) < min(N_ANCHORS, len(vectors)):
            chosen.append(int(nearest.argmin()))
            nearest = torch.maximum(nearest, vectors @ vectors[chosen[-1]])
        return vectors[chosen]


def _part(state: dict[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {k[len(prefix) :]: v for k, v in state.items() if k.startswith(prefix)}


@torch.inference_mode()
def agreement(network: PolicyNetwork, data: DemonstrationSet, samples: Iterable[tuple[int, int]]) -> Agreement:
    """Compare a network with held-out demonstrations, in their canonical wording and without augmentation."""
    config = TrainConfig(augment_probability=0.0)
    rng = np.random.default_rng(0)
    network.eval()
    cell = network.cell_size
    radius = AGREE_RADIUS / data.workspace.pixel_size
    hits = {"pick": [0, 0], "yaw": [0, 0], "place": [0, 0], "done": [0, 0]}
    n = 0
    for index in samples:
        n += 1
        demo = data.frames[index[0]].demos[index[1]]
        batch = collate([make_sample(data, index, Phrasebook([demo.instruction], 0, rng), config, rng)])
        goal = network.encode_goal([demo.instruction])
        logits = network.score_picks(batch.images, goal)[0]
        done = float(logits.softmax(0)[-1]) > 0.5
        _count(hits["done"], done == demo.done)
        if demo.done:
            continue
        cols = batch.images.shape[-1] // cell
        best = int(logits[:-1].argmax())
        _count(hits["pick"], _near((cell * (best // cols), cell * (best % cols)), demo.pick_pixel, radius))
        yaws, places = network.score_rotations(batch.images, goal, batch.pick)
        yaw = 0.0 if yaws is None else int(yaws[0].argmax()) * 2 * math.pi / network.config.n_rotations
        period = min(demo.pick_yaw_period, math.pi)
        _count(hits["yaw"], abs(math.remainder(yaw - demo.pick_yaw, period)) < math.radians(10))
        best = int(places[0].max(0).values.argmax())
        _count(hits["place"], _near((cell * (best // cols), cell * (best % cols)), demo.place_pixel, radius))
    share = {name: right / max(total, 1) for name, (right, total) in hits.items()}
    return Agreement(share["pick"], share["yaw"], share["place"], share["done"], n)


def _count(tally: list[int], right: bool) -> None:
    tally[0] += int(right)
    tally[1] += 1


def _near(a: tuple[int, int], b: tuple[int, int], radius: float) -> bool:
    return math.hypot(a[0] - b[0], a[1] - b[1]) < radius
