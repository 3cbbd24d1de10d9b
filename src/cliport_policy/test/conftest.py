"""A tiny demonstration set, drawn flat, in the format that cliport_benchmark generate writes."""

import json
import warnings
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch

from cliport_perception.workspace import WorkspaceSpec
from cliport_policy.encoders.clip_modules import ClipResNet, ClipText

COLORS = {"red": (255, 87, 89), "blue": (78, 121, 167)}


def _png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def write_flat_set(folder: Path, observations: int, seed: int = 0) -> Path:
    """A red block and a blue bowl, drawn as squares; every third observation is a done one."""
    folder.mkdir(parents=True)
    workspace = WorkspaceSpec()
    rng = np.random.default_rng(seed)
    rows = []
    for i in range(observations):
        color = np.full((*workspace.shape, 3), 200, np.uint8)
        height = np.zeros(workspace.shape, np.float32)
        pick = (int(rng.integers(40, 120)), int(rng.integers(30, 130)))
        place = (int(rng.integers(200, 280)), int(rng.integers(30, 130)))
        for (row, col), name, half in ((pick, "red", 8), (place, "blue", 20)):
            color[row - half : row + half, col - half : col + half] = COLORS[name]
            height[row - half : row + half, col - half : col + half] = 0.04
        units = np.round((height - workspace.z_min) / 1e-4).astype(np.uint16)
        demo = {
            "instruction": "put the red blocks in a blue bowl",
            "block": "red",
            "bowl": "blue",
            "done": i % 3 == 2,
            "pick_row": pick[0],
            "pick_col": pick[1],
            "pick_yaw": 0.0,
            "pick_yaw_period": float(np.pi / 2),
            "place_row": place[0],
            "place_col": place[1],
            "place_yaw": 0.0,
        }
        rows.append(
            {
                "episode": i,
                "seed": i,
                "step": 0,
                "color_png": _png(color[..., ::-1]),
                "height_png": _png(units),
                "valid_png": _png(np.full(workspace.shape, 255, np.uint8)),
                "demos": [demo],
            }
        )
    pq.write_table(pa.Table.from_pylist(rows), folder / "part-00000.parquet")
    (folder / "meta.json").write_text(json.dumps({"version": 1, "workspace": workspace.to_dict()}))
    return folder


@pytest.fixture
def flat_set(tmp_path: Path) -> Path:
    return write_flat_set(tmp_path / "data", 6)


@pytest.fixture
def one_thread() -> Iterator[None]:
    """Of torch: in tests of small networks a second thread costs more than it does."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


CLIP_WIDTH, CLIP_DIM = 8, 32


def make_small_clip() -> dict[str, torch.Tensor]:
    """A randomly initialised CLIP ResNet, small, with the names and the half precision of OpenAI's checkpoint."""
    generator = torch.Generator().manual_seed(0)
    visual = ClipResNet(CLIP_WIDTH, (1, 2, 1, 1)).state_dict()
    text = ClipText(49408, 77, 64, 2, CLIP_DIM).state_dict()
    weights = {f"visual.{name.removeprefix('stem.')}": value for name, value in visual.items()} | text
    weights["logit_scale"] = torch.tensor(0.0)
    pooled = 32 * CLIP_WIDTH
    weights["visual.attnpool.positional_embedding"] = torch.empty(50, pooled)
    for name, out in (("k_proj", pooled), ("q_proj", pooled), ("v_proj", pooled), ("c_proj", CLIP_DIM)):
        weights[f"visual.attnpool.{name}.weight"] = torch.empty(out, pooled)
        weights[f"visual.attnpool.{name}.bias"] = torch.empty(out)
    for name, value in weights.items():
        if not value.is_floating_point():
            continue
        fan_in = value[0].numel() if value.dim() > 1 else 1
        weights[name] = torch.randn(value.shape, generator=generator) * (2 / fan_in) ** 0.5 * (value.dim() > 1)
        if value.dim() == 1 and name.endswith(("weight", "running_var")):
            weights[name] = 0.5 + torch.rand(value.shape, generator=generator)
    sizes = {
        "input_resolution": torch.tensor(224),
        "context_length": torch.tensor(77),
        "vocab_size": torch.tensor(49408),
    }
    return {name: value.half() if value.is_floating_point() else value for name, value in (weights | sizes).items()}


class _Tree(torch.nn.Module):
    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return x


def write_archive(weights: dict[str, torch.Tensor], path: Path) -> Path:
    """The tensors as a TorchScript archive, which is how OpenAI publishes them."""
    root = _Tree()
    for name, value in weights.items():
        *parents, leaf = name.split(".")
        at = root
        for parent in parents:
            if parent not in dict(at.named_children()):
                at.add_module(parent, _Tree())
            at = getattr(at, parent)
        at.register_buffer(leaf, value)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        torch.jit.save(torch.jit.script(root), str(path))
    return path


@pytest.fixture(scope="session")
def small_clip() -> dict[str, torch.Tensor]:
    return make_small_clip()


@pytest.fixture(scope="session")
def clip_folder(small_clip: dict[str, torch.Tensor], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of models that holds a small RN50.pt, as CLIPORT_MODELS names one."""
    folder = tmp_path_factory.mktemp("models")
    write_archive(small_clip, folder / "RN50.pt")
    return folder


@pytest.fixture
def clip_models(clip_folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CLIPORT_MODELS", str(clip_folder))
    return clip_folder
