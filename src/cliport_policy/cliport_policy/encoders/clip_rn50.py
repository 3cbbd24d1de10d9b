"""CLIP's ResNet50 and its sentence encoder, from the user's checkpoint file (docs/paper.md, "Layers")."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from torch import Tensor

from cliport_policy.blank import blank_modules
from cliport_policy.encoders.clip_modules import ClipResNet, ClipText
from cliport_policy.encoders.files import read_state_dict
from cliport_policy.encoders.frozen import EncoderShape, FrozenEncoders, Vision
from cliport_policy.errors import EncoderError

MEAN = (0.48145466, 0.4578275, 0.40821073)
STD = (0.26862954, 0.26130258, 0.27577711)
_N_STAGES = 4


def load_clip(name: str, path: Path) -> FrozenEncoders:
    """Load OpenAI's TorchScript archive or a plain state dict of it.

    A smaller network of the same kind is read as well.

    Raises:
        EncoderError: if the file holds anything else.
    """
    weights = read_state_dict(path)
    if "visual.proj" in weights:
        raise EncoderError(f"{path} holds a CLIP with a vision transformer: CLIPort needs the ResNet50, RN50.pt")
    try:
        visual, text = _resnet(weights), _text(weights)
    except (KeyError, IndexError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:120]
        raise EncoderError(f"{path} holds no CLIP ResNet ({reason} does not fit): give OpenAI's RN50.pt") from None
    tokenizer = _tokenizer()
    context, dim = text.positional_embedding.shape[0], text.text_projection.shape[1]
    widths = tuple(stage[-1].conv3.out_channels for stage in visual.stages[1:])

    def encode(sentences: list[str]) -> Tensor:
        return text(tokenizer(sentences, context)).float()

    return FrozenEncoders(name, EncoderShape(widths, dim), Vision(visual.stages, MEAN, STD), text, encode)


def _resnet(weights: Mapping[str, Tensor]) -> ClipResNet:
    blocks = [_count_blocks(weights, f"visual.layer{stage + 1}.") for stage in range(_N_STAGES)]
    with blank_modules():
        network = ClipResNet(weights["visual.layer1.0.conv1.weight"].shape[0], blocks)
    named: dict[str, Tensor] = {}
    for name, value in _strip_prefix(weights, "visual.").items():
        if name.startswith("attnpool."):
            continue  # CLIP's pooling is not used
        named[name if name.startswith("layer") else f"stem.{name}"] = value
    network.load_state_dict(named, assign=True)
    return network.float()


def _text(weights: Mapping[str, Tensor]) -> ClipText:
    vocabulary, width = weights["token_embedding.weight"].shape
    context, dim = weights["positional_embedding"].shape[0], weights["text_projection"].shape[1]
    with blank_modules():
        network = ClipText(vocabulary, context, width, _count_blocks(weights, "transformer.resblocks."), dim)
    network.load_state_dict({name: weights[name] for name in network.state_dict()}, assign=True)
    return network.float()


def _strip_prefix(weights: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): value for name, value in weights.items() if name.startswith(prefix)}


def _count_blocks(weights: Mapping[str, Tensor], prefix: str) -> int:
    """Return the number of blocks below a prefix."""
    return len({name.split(".")[0] for name in _strip_prefix(weights, prefix)})


def _tokenizer() -> Any:
    """Load open_clip's tokenizer from its file alone: the package itself would be imported whole.

    It takes sentences and a length to token numbers (B, length); a longer sentence is cut.
    """
    package = importlib.util.find_spec("open_clip")
    if package is None or package.origin is None:
        raise EncoderError("the package open-clip-torch is not installed: run `make setup` again")
    file = Path(package.origin).with_name("tokenizer.py")
    spec = importlib.util.spec_from_file_location("open_clip_tokenizer", file)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.SimpleTokenizer()
