"""Presence networks in checkpoints: tensors beside the policy's, and their vocabulary in the card."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from torch import Tensor

from cliport_policy.blank import blank_modules
from cliport_policy.card import Card
from cliport_policy.checkpoint import PRESENCE, halved, load_checkpoint, save_checkpoint
from cliport_policy.errors import CheckpointError
from cliport_policy.folded_norms import fold_norms
from cliport_policy.language import TextEncoder
from cliport_policy.presence.presence import Presence
from cliport_policy.presence.scene_net import SceneNet
from cliport_policy.presence.sentence_net import SentenceNet
from cliport_policy.presence.vocabulary import Vocabulary
from cliport_policy.shapes.outline_net import load_outline_net
from cliport_policy.shapes.reader import ShapeReader

_SCENE, _SENTENCE = f"{PRESENCE}scene.", f"{PRESENCE}sentence."


def put_presence(
    path: Path, vocabulary: Vocabulary, scene: SceneNet, sentence: SentenceNet, made_by: dict[str, Any]
) -> None:
    """Write a presence network into a checkpoint, in half precision, instead of the one that it had.

    Raises:
        CheckpointError: if the checkpoint is unusable or can't be written.
    """
    stored, card = load_checkpoint(path)
    tensors = {name: stored.as_stored(name) for name in stored if not name.startswith(PRESENCE)}
    for prefix, net in ((_SCENE, scene), (_SENTENCE, sentence)):
        tensors |= {prefix + name: value for name, value in halved(net.state_dict()).items()}
    known = {
        "kinds": list(vocabulary.kinds),
        "colors": list(vocabulary.colors),
        "shades": vocabulary.shades,
        "made_by": made_by,
    }
    save_checkpoint(path, tensors, replace(card, presence=known))


def load_presence(tensors: Mapping[str, Tensor], card: Card, encoder: TextEncoder, path: Path) -> Presence | None:
    """Return a checkpoint's presence network, None where it has none.

    Raises:
        CheckpointError: if the tensors do not fit the card.
    """
    if not card.presence:
        return None
    try:
        shades = tuple(tuple(shade) for shade in card.presence["shades"])
        vocabulary = Vocabulary(tuple(card.presence["kinds"]), tuple(card.presence["colors"]), shades)
        with blank_modules():
            scene = SceneNet(len(vocabulary.kinds), len(vocabulary.colors))
            sentence = SentenceNet(len(vocabulary.kinds))
        for prefix, net in ((_SCENE, scene), (_SENTENCE, sentence)):
            own = {name.removeprefix(prefix): tensors[name] for name in tensors if name.startswith(prefix)}
            net.load_state_dict(own, assign=True)
    except (KeyError, TypeError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:200]
        raise CheckpointError(
            f"the presence network of checkpoint {path} does not fit its card ({reason}): restore it or fit it again"
        ) from error
    knows_shapes = getattr(card.network, "knows_shapes", False)
    shapes = ShapeReader(load_outline_net(), card.workspace.pixel_size) if knows_shapes else None
    fold_norms(scene.requires_grad_(False).eval())
    pixel_size = card.workspace.pixel_size if getattr(card.network, "reads_kinds", False) else None
    return Presence(vocabulary, encoder, scene, sentence.requires_grad_(False), shapes, pixel_size)
