"""Frozen encoders: read from the right files, refused from wrong ones, shared, and never trained or saved."""

import copy
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor, nn

from cliport_policy.encoders import bert, efficientnet, resnet50
from cliport_policy.encoders.bert_modules import load_bert
from cliport_policy.encoders.clip_rn50 import MEAN, STD, load_clip
from cliport_policy.encoders.frozen import FrozenEncoders, Vision
from cliport_policy.encoders.registry import shared_encoders
from cliport_policy.errors import EncoderError
from cliport_policy.folded_norms import fold_norms
from cliport_policy.language import MAX_TOKENS, model_folder, shared_encoder
from cliport_policy.named_configs import load_network_config
from cliport_policy.networks.streams.network import StreamsNetwork
from cliport_policy.stream_config import StreamsConfig

pytestmark = pytest.mark.usefixtures("one_thread")
SENTENCES = ["put the red blocks in a green bowl", "pack the hammer in the brown box"]


def _config(encoder: str) -> StreamsConfig:
    config = load_network_config("cliport", {"encoder": encoder, "width": 0.125})
    assert isinstance(config, StreamsConfig)
    return config


def test_archive_and_plain_state_dict_are_the_same(
    clip_folder: Path, small_clip: dict[str, Tensor], tmp_path: Path
) -> None:
    plain = tmp_path / "RN50.pt"
    torch.save({"state_dict": {f"module.{name}": value for name, value in small_clip.items()}}, plain)
    a, b = load_clip("clip_rn50", clip_folder / "RN50.pt"), load_clip("clip_rn50", plain)
    assert a.identity == b.identity and a.shape == b.shape
    mean, std = (getattr(a.modules[0], name).flatten().tolist() for name in ("mean", "std"))  # OpenAI's
    assert mean == pytest.approx((0.48145466, 0.4578275, 0.40821073), rel=1e-6)
    assert std == pytest.approx((0.26862954, 0.26130258, 0.27577711), rel=1e-6)
    color = torch.rand(1, 3, 64, 64)
    assert all(torch.equal(x, y) for x, y in zip(a.encode_images(color), b.encode_images(color), strict=True))
    assert torch.equal(a.encode_sentences(SENTENCES), b.encode_sentences(SENTENCES))


def test_clip_is_the_one_that_open_clip_builds(clip_folder: Path) -> None:
    """Tolerance 1e-4 of the largest value: batch norms are folded into convolutions here."""
    from open_clip import tokenize
    from open_clip.openai import load_openai_model

    theirs = load_openai_model(str(clip_folder / "RN50.pt"), precision="fp32", device="cpu")
    ours = load_clip("clip_rn50", clip_folder / "RN50.pt")
    color = torch.rand(2, 3, 64, 96)
    with torch.no_grad():
        x = theirs.visual.stem((color - torch.tensor(MEAN)[:, None, None]) / torch.tensor(STD)[:, None, None])
        for tap, stage in zip(ours.encode_images(color), ("layer1", "layer2", "layer3", "layer4"), strict=True):
            x = getattr(theirs.visual, stage)(x)
            assert (tap - x).abs().max() < 1e-4 * x.abs().max()
        text = theirs.encode_text(tokenize(SENTENCES))
    assert torch.allclose(ours.encode_sentences(SENTENCES), text, atol=1e-4 * float(text.abs().max()))


def test_a_wrong_clip_file_is_one_line(clip_models: Path, small_clip: dict[str, Tensor], tmp_path: Path) -> None:
    path = tmp_path / "RN50.pt"

    def without(prefix: str) -> dict[str, Tensor]:
        return {name: value for name, value in small_clip.items() if not name.startswith(prefix)}

    cases: dict[str, Callable[[], object]] = {
        "holds no weights": lambda: path.write_text("<html>404 not found</html>"),
        "no weights": lambda: path.write_bytes((clip_models / "RN50.pt").read_bytes()[:100_000]),
        "no state dict": lambda: torch.save([1, 2, 3], path),
        "vision transformer": lambda: torch.save({**small_clip, "visual.proj": torch.zeros(2, 2)}, path),
        "visual.layer1.0.conv1.weight": lambda: torch.save(without("visual."), path),
        "token_embedding.weight": lambda: torch.save(without("token_embedding"), path),
        "does not fit": lambda: torch.save({**small_clip, "visual.conv1.weight": torch.zeros(5, 3, 3, 3)}, path),
    }
    for message, write in cases.items():
        write()
        with pytest.raises(EncoderError, match=message) as caught:
            load_clip("clip_rn50", path)
        assert "\n" not in str(caught.value) and str(path) in str(caught.value) and len(str(caught.value)) < 400


@pytest.mark.parametrize(("encoder", "file"), [("clip_rn50", "RN50.pt"), ("resnet50_distilbert", "resnet50.pth")])
def test_a_missing_file_says_what_to_put_where(
    encoder: str, file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CLIPORT_MODELS", str(tmp_path))
    with pytest.raises(EncoderError, match=f"{file} is missing: put .* there, or set CLIPORT_MODELS"):
        shared_encoders(_config(encoder))


def test_one_instance_that_no_network_owns(clip_models: Path) -> None:
    encoders = shared_encoders(_config("clip_rn50"))
    assert encoders is not None and shared_encoders(_config("clip_rn50")) is encoders
    network = StreamsNetwork(_config("clip_rn50"), encoders)
    frozen = {id(p) for module in encoders.modules for p in module.parameters()}
    assert frozen and not frozen & {id(p) for p in network.parameters()}
    assert set(network.state_dict()) == {name for name, _ in network.named_parameters()}
    assert copy.deepcopy(network).encoder_identity == encoders.identity
    network.train()
    for part in encoders.modules:
        assert not any(module.training for module in part.modules())
        assert not any(p.requires_grad for p in part.parameters())


def test_a_sentence_is_encoded_once_and_serves_training() -> None:
    asked: list[list[str]] = []

    def read(sentences: list[str]) -> Tensor:
        asked.append(sentences)
        return torch.ones(len(sentences), 4)

    encoders = FrozenEncoders("fake", None, Vision([nn.Conv2d(3, 3, 1)], MEAN, STD), nn.Linear(1, 1), read)  # type: ignore[arg-type]
    with torch.inference_mode():
        encoders.encode_sentences(["a", "b", "a"])
    vector = encoders.encode_sentences(["b", "c"])
    assert asked == [["a", "b"], ["c"]]
    nn.Linear(4, 1)(vector).sum().backward()


def test_efficientnet_has_four_taps_and_its_published_weights() -> None:
    vision = efficientnet.load_efficientnet().eval()
    color = torch.rand(2, 3, 64, 96, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        taps = vision(color)
    assert [tuple(tap.shape[1:]) for tap in taps] == [(24, 16, 24), (40, 8, 12), (112, 4, 6), (320, 2, 3)]
    assert all(0.1 < float(tap.std()) < 30 for tap in taps)  # as its batch norms expect them: neither dead nor wild


def test_folded_norms_are_the_same() -> None:
    """Tolerance 1e-4 of the largest value."""
    vision = efficientnet.load_efficientnet().eval()
    folded = copy.deepcopy(vision)
    fold_norms(folded)
    assert not any(isinstance(module, nn.BatchNorm2d) for module in folded.modules())
    color = torch.rand(1, 3, 64, 64)
    with torch.no_grad():
        for a, b in zip(vision(color), folded(color), strict=True):
            assert (a - b).abs().max() < 1e-4 * a.abs().max()


def test_minilm_reads_sentences_apart() -> None:
    encoder = bert.minilm()
    together, alone = encoder.encode(SENTENCES), encoder.encode(SENTENCES[:1])
    assert together.shape == (2, encoder.dim)
    assert torch.allclose(together[:1], alone, atol=1e-4)  # padding does not count
    assert not torch.allclose(together[0], together[1], atol=0.1)


def test_minilm_is_the_one_of_transformers(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tolerance 1e-5."""
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    transformers = pytest.importorskip("transformers")
    tokenizer = transformers.AutoTokenizer.from_pretrained(model_folder())
    model = transformers.AutoModel.from_pretrained(model_folder(), add_pooling_layer=False).eval()
    sentences = [*SENTENCES, "Ünïcode — naïve 日本語 🙂!!", "brown " * 60, "x"]
    batch = tokenizer(sentences, padding=True, truncation=True, max_length=MAX_TOKENS, return_tensors="pt")
    with torch.no_grad():
        theirs = model(**batch).last_hidden_state
    ours = shared_encoder().encode(sentences)
    assert torch.equal(ours.mask, batch["attention_mask"].bool())
    assert (ours.tokens - theirs)[ours.mask].abs().max() < 1e-5


def test_distilbert_is_the_one_of_transformers(tmp_path: Path) -> None:
    """Tolerance 1e-5."""
    transformers = pytest.importorskip("transformers")
    config = transformers.DistilBertConfig(dim=48, n_layers=2, n_heads=2, hidden_dim=64)
    theirs = transformers.DistilBertModel(config).eval()
    theirs.save_pretrained(tmp_path)
    ours = load_bert(tmp_path)
    numbers, mask = torch.randint(0, 30_000, (2, 7)), torch.ones(2, 7, dtype=torch.bool)
    mask[1, 4:] = False
    with torch.no_grad():
        states = theirs(input_ids=numbers, attention_mask=mask.long()).last_hidden_state
        assert (ours(numbers, mask) - states)[mask].abs().max() < 1e-5


def test_untrained_encoders_are_the_same_for_a_seed() -> None:
    color = torch.rand(1, 3, 64, 64)
    with torch.no_grad():
        a, b = (resnet50.untrained_resnet50(seed=3)(color) for _ in range(2))
    assert torch.equal(a[3], b[3])
    assert all(tap.isfinite().all() and float(tap.std()) < 10 for tap in a)


def test_resnet50_and_distilbert_from_the_users_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from torchvision.models import resnet50 as torchvision_resnet50
    from transformers import DistilBertConfig, DistilBertModel

    torch.save(torchvision_resnet50(weights=None).state_dict(), tmp_path / "resnet50.pth")
    folder = tmp_path / "distilbert-base-uncased"
    DistilBertModel(DistilBertConfig(dim=48, n_layers=1, n_heads=2, hidden_dim=64)).save_pretrained(folder)
    shutil.copy(model_folder() / "vocab.txt", folder)
    monkeypatch.setenv("CLIPORT_MODELS", str(tmp_path))
    encoders = shared_encoders(_config("resnet50_distilbert"))
    assert encoders is not None and encoders.shape == ((256, 512, 1024, 2048), 48, 1024)
    assert [tap.shape[1] for tap in encoders.encode_images(torch.rand(1, 3, 32, 32))] == [256, 512, 1024, 2048]
    vectors = encoders.encode_sentences(SENTENCES)
    shutil.copy(model_folder() / "tokenizer.json", folder)
    assert vectors.shape == (2, 48) and torch.allclose(vectors, bert.distilbert(folder).encode(SENTENCES), atol=1e-5)
    torch.save({"a": torch.zeros(1)}, tmp_path / "resnet50.pth")
    with pytest.raises(EncoderError, match=r"resnet50\.pth is no state dict of torchvision's resnet50"):
        resnet50.load_resnet50(tmp_path / "resnet50.pth")
    (folder / "config.json").unlink()
    with pytest.raises(EncoderError, match="holds no BERT") as caught:
        bert.distilbert(folder)
    assert "\n" not in str(caught.value)
