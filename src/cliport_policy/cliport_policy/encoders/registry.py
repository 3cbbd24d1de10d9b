"""Frozen encoders by name: the files each needs, and the process's one instance of each."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import torch

from cliport_policy.encoders import bert, clip_rn50, efficientnet, resnet50
from cliport_policy.encoders.files import CLIP_FILE, DISTILBERT_FOLDER, RESNET_FILE, models_folder, require_model
from cliport_policy.encoders.frozen import EncoderShape, FrozenEncoders, Vision
from cliport_policy.stream_config import StreamsConfig

_FILES = {"clip_rn50": (CLIP_FILE,), "resnet50_distilbert": (RESNET_FILE, DISTILBERT_FOLDER)}
PROJECTED_DIM = 1024  # width of the learned projection of a mean token state


def with_available_encoder(config: StreamsConfig) -> StreamsConfig:
    """Return the config on the encoder it asks for, or on its fallback if that encoder's files are missing."""
    here = all((models_folder() / name).exists() for name in _FILES.get(config.encoder, ()))
    return config.with_encoder(config.encoder if here or config.fallback_encoder == "none" else config.fallback_encoder)


def shared_encoders(config: StreamsConfig, dtype: torch.dtype = torch.float32) -> FrozenEncoders | None:
    """Return the shared encoders of a config; None if it needs none.

    Raises:
        EncoderError: naming file and remedy, if they can't be had.
    """
    if config.encoder == "none":
        return None
    return _cached_encoders(config.encoder, config.encoder_seed, models_folder(), dtype)


@lru_cache(maxsize=4)
def _cached_encoders(name: str, seed: int, folder: Path, dtype: torch.dtype) -> FrozenEncoders:
    # MiniLM also checks instructions for every policy of the process, in float32.
    return _load(name, seed).cast(dtype, text=name != "efficientnet_minilm")


def _load(name: str, seed: int) -> FrozenEncoders:
    if name == "clip_rn50":
        return clip_rn50.load_clip(name, require_model(CLIP_FILE, "OpenAI's CLIP RN50 checkpoint"))
    if name == "efficientnet_minilm":
        vision, sentences = efficientnet.load_efficientnet(), bert.minilm()
        return _joined(name, efficientnet.TAP_WIDTHS, vision, sentences)
    if name == "untrained_resnet50_distilbert":
        vision, sentences = resnet50.untrained_resnet50(seed), bert.untrained_distilbert(seed)
    else:
        vision = resnet50.load_resnet50(require_model(RESNET_FILE, "torchvision's ResNet50 state dict"))
        sentences = bert.distilbert(require_model(DISTILBERT_FOLDER, "the files of distilbert-base-uncased"))
    return _joined(name, resnet50.TAP_WIDTHS, vision, sentences)


def _joined(name: str, tap_widths: tuple[int, ...], vision: Vision, sentences: bert.SentenceEncoder) -> FrozenEncoders:
    shape = EncoderShape(tap_widths, sentences.dim, PROJECTED_DIM)
    return FrozenEncoders(name, shape, vision, sentences.module, sentences.encode)
