"""The frozen encoders by name: which files each needs, and the process's one instance of each."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import torch

from cliport_policy.encoders import bert, clip_rn50, efficientnet, resnet50
from cliport_policy.encoders.files import CLIP_FILE, DISTILBERT_FOLDER, RESNET_FILE, existing, models_folder
from cliport_policy.encoders.frozen import FrozenEncoders
from cliport_policy.networks.stream_net import EncoderShape
from cliport_policy.stream_config import StreamsConfig

_FILES = {"clip_rn50": (CLIP_FILE,), "resnet50_distilbert": (RESNET_FILE, DISTILBERT_FOLDER)}
PROJECTED_DIM = 1024  # of the learned projection of a mean token state


def on_hand(config: StreamsConfig) -> StreamsConfig:
    """The config on the encoder it asks for, or on its fallback where that one's files are not here."""
    here = all((models_folder() / name).exists() for name in _FILES.get(config.encoder, ()))
    return config.with_encoder(config.encoder if here or config.fallback_encoder == "none" else config.fallback_encoder)


def encoders_of(config: StreamsConfig, dtype: torch.dtype = torch.float32) -> FrozenEncoders | None:
    """The shared encoders of a config that names one; None for one that needs none.

    Raises EncoderError, naming file and remedy, where they can't be had.
    """
    if config.encoder == "none":
        return None
    return _shared(config.encoder, config.encoder_seed, models_folder(), dtype)


@lru_cache(maxsize=4)
def _shared(name: str, seed: int, folder: Path, dtype: torch.dtype) -> FrozenEncoders:
    # MiniLM also checks instructions for every policy of the process, in float32.
    return _load(name, seed).cast(dtype, text=name != "efficientnet_minilm")


def _load(name: str, seed: int) -> FrozenEncoders:
    if name == "clip_rn50":
        return clip_rn50.load_clip(name, existing(CLIP_FILE, "OpenAI's CLIP RN50 checkpoint"))
    if name == "efficientnet_minilm":
        vision, reader = efficientnet.load_efficientnet(), bert.minilm()
        return FrozenEncoders(name, EncoderShape(efficientnet.TAP_WIDTHS, reader.dim, PROJECTED_DIM), vision, *reader)
    if name == "untrained_resnet50_distilbert":
        vision, reader = resnet50.untrained_resnet50(seed), bert.untrained_distilbert(seed)
    else:
        vision = resnet50.load_resnet50(existing(RESNET_FILE, "torchvision's ResNet50 state dict"))
        reader = bert.distilbert(existing(DISTILBERT_FOLDER, "the files of distilbert-base-uncased"))
    return FrozenEncoders(name, EncoderShape(resnet50.TAP_WIDTHS, reader.dim, PROJECTED_DIM), vision, *reader)
