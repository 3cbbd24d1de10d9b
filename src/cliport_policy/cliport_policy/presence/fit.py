"""Training of both nets of a presence network: sentences in minutes, scenes in an hour."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F
from torch.nn.utils.rnn import pad_sequence

from cliport_policy.language import TextEncoder, padded
from cliport_policy.networks.joint.color_maps import is_known, nearest_shades
from cliport_policy.presence.color_evidence import term_maps
from cliport_policy.presence.scene_net import SceneNet, evidence, grayed
from cliport_policy.presence.scenes import SceneBatch
from cliport_policy.presence.sentence_net import SentenceNet
from cliport_policy.presence.sentences import Example

_SENTENCE_BATCH, _SENTENCE_RATE = 64, 1e-3
_SCENE_RATE, _LAST_RATE, _WARM_UP = 3e-3, 1e-5, 200
_DECAY = 0.02
_MOST_NORM = 2.0
_KIND_WEIGHT = 0.3  # of what is told of each marked cell's kind
_HARDEST = 4  # cells of a scene that are told that what was asked for is not there
_NO_ROLE = -100  # label of tokens that are no colour's name
_CHUNK = 64


def fit_sentences(
    net: SentenceNet,
    examples: Sequence[Example],
    steps: int,
    seed: int,
    encoder: TextEncoder,
    is_stopped: Callable[[], bool] = lambda: False,
) -> float | None:
    """Fit a net to sentences; return the mean loss of its last hundred steps, None if it was stopped before."""
    rng = np.random.default_rng(seed)
    tokens, roles = _embedded(examples, encoder)
    kinds = torch.tensor([(example.pick, example.place) for example in examples])
    optimizer = torch.optim.AdamW(net.parameters(), lr=_SENTENCE_RATE, weight_decay=_DECAY)
    losses = []
    for step in range(steps):
        if is_stopped():
            return None
        optimizer.param_groups[0]["lr"] = _SENTENCE_RATE * min(1.0, (step + 1) / 100) * (1 - step / steps)
        chosen = rng.integers(len(examples), size=_SENTENCE_BATCH)
        batch = padded([tokens[i] for i in chosen])
        labels = pad_sequence([roles[i] for i in chosen], True, _NO_ROLE)
        said, belongs = net.train()(batch.tokens, batch.mask)
        loss = F.cross_entropy(said.flatten(0, 1), kinds[chosen].flatten())
        if (labels != _NO_ROLE).any():
            loss = loss + F.cross_entropy(belongs.flatten(0, 1), labels.flatten(), ignore_index=_NO_ROLE)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    net.eval()
    return float(np.mean(losses[-100:]))


def _embedded(examples: Sequence[Example], encoder: TextEncoder) -> tuple[list[Tensor], list[Tensor]]:
    """Return each sentence's embeddings (T, 384) and its tokens' roles (T,)."""
    tokens: list[Tensor] = []
    for start in range(0, len(examples), _CHUNK):
        encoded = encoder.encode([example.sentence for example in examples[start : start + _CHUNK]])
        tokens += [row[mask].clone() for row, mask in zip(*encoded, strict=True)]
    roles = []
    for row, example in zip(tokens, examples, strict=True):
        labels = torch.full((len(row),), _NO_ROLE)
        for (begin, end), role in example.roles:
            labels[encoder.pieces.within(example.sentence, begin, end)[: len(row)]] = int(role)
        roles.append(labels)
    return tokens, roles


def scene_optimizer(net: SceneNet) -> torch.optim.Optimizer:
    """Return the optimiser of a net of scenes."""
    return torch.optim.AdamW(net.parameters(), lr=_SCENE_RATE, weight_decay=_DECAY)


def scene_step(
    net: SceneNet, optimizer: torch.optim.Optimizer, batch: SceneBatch, step: int, steps: int
) -> dict[str, float]:
    """Take one of some steps, the first one being 0, by a batch; return its losses."""
    falling = 0.5 * (1 + math.cos(math.pi * step / steps))
    rate = _LAST_RATE + _SCENE_RATE * min(1.0, (step + 1) / _WARM_UP) * falling
    optimizer.param_groups[0]["lr"] = rate
    losses = scene_losses(net.train(), batch)
    optimizer.zero_grad()
    sum(losses.values(), start=torch.zeros(())).backward()
    torch.nn.utils.clip_grad_norm_(net.parameters(), _MOST_NORM)
    optimizer.step()
    return {name: loss.item() for name, loss in losses.items()}


def scene_losses(net: SceneNet, batch: SceneBatch) -> dict[str, Tensor]:
    """Return the losses of what is there, of what is not, and of the marked cells' kinds."""
    maps = _maps(batch)
    any_color = (batch.terms < 0) & ~is_known(batch.shades)
    features = net.features(grayed(batch.images, batch.gray))
    scores = net.score(features, evidence(maps, any_color), batch.kinds, batch.colors)
    scene = torch.arange(len(scores))[:, None]
    near = F.max_pool2d(scores, 3, 1, 1)  # a mark may lie a cell beside what shows best
    at = near[scene, torch.arange(scores.shape[1])[None], batch.cells[..., 0], batch.cells[..., 1]]
    hardest = scores.flatten(2).topk(_HARDEST, dim=2).values[batch.asked & ~batch.present]
    scenes, marked, rows, cols = batch.marks.unbind(1)
    kinds = net.kind_head(features)[scenes, :, rows, cols]
    return {
        "there": _mean(F.softplus(-at[batch.present])),
        "not there": _mean(F.softplus(hardest)),
        "kinds": _KIND_WEIGHT * _mean(F.cross_entropy(kinds, marked, reduction="none")),
    }


def _mean(losses: Tensor) -> Tensor:
    return losses.mean() if losses.numel() else losses.sum()


def _maps(batch: SceneBatch) -> Tensor:
    """Return where each question's colour is seen: (B, Q, H/2, W/2)."""
    terms = term_maps(batch.images)
    maps = terms[torch.arange(len(terms))[:, None], batch.terms.clamp_min(0)]
    known = is_known(batch.shades)
    scenes = known.any(1)
    if scenes.any():
        folded = F.pixel_unshuffle(batch.images[scenes], 2)
        near = nearest_shades(folded, batch.shades[scenes].nan_to_num()).unflatten(2, maps.shape[-2:])
        maps[scenes] = torch.where(known[scenes][..., None, None], near, maps[scenes])
    return maps
