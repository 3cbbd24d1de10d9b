"""Presence network of the checkpoint that a training begins with, kept where it finds what demonstrations name."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from torch import Tensor

from cliport_policy.checkpoint import PRESENCE, halved
from cliport_policy.data.demonstrations import DemonstrationSet
from cliport_policy.language import TextEncoder
from cliport_policy.null_odds import absence
from cliport_policy.observation import observation_tensor
from cliport_policy.presence.presence import Presence
from cliport_policy.presence.stored import load_presence
from cliport_policy.server.types import ServerConfig
from cliport_policy.training.initial import Initial

logger = logging.getLogger(__name__)
_SCENES = 40  # of each data set
_MOST_MISSED = 0.05  # share of a data set's scenes


class Inherited(NamedTuple):
    """Tensors of a presence network as they are stored, and what a card says of it; both empty if there is none."""

    tensors: dict[str, Tensor]
    facts: dict[str, Any]


def inherited_presence(initial: Initial, sets: Sequence[DemonstrationSet], encoder: TextEncoder) -> Inherited:
    """Return a checkpoint's presence network, unless it misses what demonstrations name more often than in 1 of 20.

    Things of one's own can look to it like nothing that it knows: a policy would refuse what it has just learned. A
    line of the log says what becomes of it.

    Raises:
        CheckpointError: if the network does not fit the checkpoint's card.
        DataError: if an observation can't be read.
    """
    presence = load_presence(initial.tensors, initial.card, encoder, Path(initial.name))
    if presence is None:
        return Inherited({}, {})
    asked = 0
    for data in sets:
        missed, scenes = _missed(presence, data)
        if missed > _MOST_MISSED * scenes:
            logger.warning(
                "the presence network of %s is left out: in %d of %d scenes of %s it does not find what is named; "
                "fit_presence teaches another one",
                *(initial.name, missed, scenes, data.folder),
            )
            return Inherited({}, {})
        asked += scenes
    logger.info("the presence network of %s is kept: it finds what is named in %d scenes", initial.name, asked)
    tensors = {name: tensor for name, tensor in initial.tensors.items() if name.startswith(PRESENCE)}
    return Inherited(halved(tensors), initial.card.presence)


def _missed(presence: Presence, data: DemonstrationSet) -> tuple[int, int]:
    """Return in how many scenes a server would miss something that is named, and how many were looked at."""
    acting = [index for index in data.samples() if data.demo(index).acts]
    chosen = np.random.default_rng(0).permutation(len(acting))[:_SCENES]
    missed, least = 0, ServerConfig().absent_threshold
    for index in (acting[i] for i in chosen):
        image = observation_tensor(data.observation(data.frames[index.frame]))
        missing = presence.look(image, data.demo(index).instruction).missing
        missed += absence(0.0, missing, done=0.0)[0] >= least
    return missed, len(chosen)
