"""Files of encoders that no package brings: the folder that people keep them in, and their reading."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from cliport_policy.errors import EncoderError

FOLDER_VARIABLE = "CLIPORT_MODELS"
DEFAULT_FOLDER = "~/.cache/cliport"
CLIP_FILE = "RN50.pt"
RESNET_FILE = "resnet50.pth"
DISTILBERT_FOLDER = "distilbert-base-uncased"


def models_folder() -> Path:
    """Return the folder that CLIPORT_MODELS names, or ~/.cache/cliport."""
    return Path(os.environ.get(FOLDER_VARIABLE) or DEFAULT_FOLDER).expanduser()


def require_model(name: str, what: str) -> Path:
    """Return the path of a file or folder among the models.

    Raises:
        EncoderError: if it is missing, saying what to put where.
    """
    path = models_folder() / name
    if not path.exists():
        raise EncoderError(
            f"{path} is missing: put {what} there, or set {FOLDER_VARIABLE} to the folder that holds {name}"
        )
    return path


def read_state_dict(path: Path) -> dict[str, Tensor]:
    """Read the tensors of a TorchScript archive or of a plain state dict.

    Raises:
        EncoderError: if the file is neither.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)  # OpenAI's file is a TorchScript archive for good
            content: Any = torch.jit.load(str(path), map_location="cpu").state_dict()
    except (RuntimeError, ValueError):
        try:
            content = torch.load(path, map_location="cpu", weights_only=True)
        except Exception as error:  # whatever an unpickler says of a file that is none
            reason = " ".join(str(error).split())[:80] or type(error).__name__
            raise EncoderError(f"{path} holds no weights ({reason}): download it again") from None
    if isinstance(content, Mapping) and isinstance(content.get("state_dict"), Mapping):
        content = content["state_dict"]
    if not isinstance(content, Mapping) or not all(isinstance(value, Tensor) for value in content.values()):
        raise EncoderError(f"{path} holds no state dict: download it again")
    return {name.removeprefix("module."): value for name, value in content.items()}
