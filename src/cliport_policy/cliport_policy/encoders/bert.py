"""Sentences as the mean of a BERT's token states: MiniLM from its package, DistilBERT from files or untrained."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from cliport_policy.errors import EncoderError
from cliport_policy.language import MAX_TOKENS, model_folder, shared_encoder


class Reader(NamedTuple):
    """The module, and what takes sentences to (B, dim) float32."""

    module: nn.Module
    read: Callable[[list[str]], Tensor]

    @property
    def dim(self) -> int:
        return int(self.module.config.hidden_size)


def minilm() -> Reader:
    """The process's one MiniLM, which also checks instructions."""
    encoder = shared_encoder()

    def read(sentences: list[str]) -> Tensor:
        tokens, mask = encoder.encode(sentences)
        return mean_state(tokens, mask)

    return Reader(encoder.model, read)


def distilbert(folder: Path) -> Reader:
    """From the files that transformers saves. Raises EncoderError where the folder holds anything else."""
    os.environ.setdefault("HF_HUB_OFFLINE", "1")
    from transformers import AutoTokenizer, DistilBertModel, logging

    logging.set_verbosity_error()
    try:
        return _reader(AutoTokenizer.from_pretrained(folder), DistilBertModel.from_pretrained(folder))
    except Exception as error:  # whatever transformers says of a folder that is none
        reason = " ".join(str(error).split())[:120]
        raise EncoderError(
            f"{folder} holds no DistilBERT ({reason}): give the files of distilbert-base-uncased"
        ) from None


def untrained_distilbert(seed: int) -> Reader:
    """Random weights behind the pretrained tokenizer: MiniLM's, which has the same vocabulary of 30 522 words."""
    from transformers import AutoTokenizer, DistilBertConfig, DistilBertModel

    tokenizer = AutoTokenizer.from_pretrained(model_folder())
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return _reader(tokenizer, DistilBertModel(DistilBertConfig()))


def mean_state(tokens: Tensor, mask: Tensor) -> Tensor:
    """(B, T, D), (B, T) bool -> (B, D), not normalised."""
    weight = mask.unsqueeze(-1).to(tokens.dtype)
    return (tokens * weight).sum(1) / weight.sum(1)


def _reader(tokenizer: Any, model: nn.Module) -> Reader:
    model.eval()

    def read(sentences: list[str]) -> Tensor:
        batch = tokenizer(sentences, padding=True, truncation=True, max_length=MAX_TOKENS, return_tensors="pt")
        hidden = model(input_ids=batch["input_ids"], attention_mask=batch["attention_mask"]).last_hidden_state
        return mean_state(hidden.float(), batch["attention_mask"].bool())

    return Reader(model, read)
