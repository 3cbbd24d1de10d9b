"""A tiny demonstration set, drawn flat, in the format that cliport_benchmark generate writes."""

import json
import warnings
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch

from cliport_core.action import PickPlaceAction, Primitive
from cliport_core.outcome import ActionResult, Outcome
from cliport_core.pose import PlanarPose, Pose
from cliport_core.workspace import WorkspaceSpec
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.data_set import DataSet
from cliport_episodes.demonstration import Source, StepRecord
from cliport_episodes.observation import Observation
from cliport_episodes.observation_messages import messages_from_observation
from cliport_episodes.raw import RawMessage
from cliport_episodes.writer import EpisodeWriter
from cliport_perception.camera_model import CameraModel
from cliport_policy.card import Card
from cliport_policy.checkpoint import ANCHORS, save_checkpoint
from cliport_policy.encoders.clip_modules import ClipResNet, ClipText
from cliport_policy.language import ENCODER_NAME, shared_encoder
from cliport_policy.named_configs import load_network_config
from cliport_policy.networks.factory import build_network
from cliport_policy.policy import Policy, load_policy
from cliport_policy.presence.scene_net import SceneNet
from cliport_policy.presence.sentence_net import SentenceNet
from cliport_policy.presence.stored import put_presence
from cliport_policy.presence.vocabulary import Vocabulary, shade_of

COLORS = {"red": (255, 87, 89), "blue": (78, 121, 167)}


def _png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


SENTENCE = "put the red blocks in a blue bowl"


def write_flat_set(
    folder: Path,
    episodes: int,
    seed: int = 0,
    actions: int = 0,
    task: str = "",
    sentence: str = SENTENCE,
    pixel_size: float = 0.0025,
    finish: bool = True,
    primitives: Sequence[str] = (),
) -> Path:
    """A red block and a blue bowl, drawn as squares.

    actions: of each episode, whose last observation is then of the finished scene, if it is to `finish`; 0: one
    observation an episode, every third of them a finished one. primitives: of the episodes, over and over again;
    empty: the column is not there, as in sets of the first version.
    """
    folder.mkdir(parents=True)
    rng = np.random.default_rng(seed)
    rows = []
    for episode in range(episodes):
        for step in range(actions + finish if actions else 1):
            done = step == actions if actions else episode % 3 == 2
            rows.append(_flat_row(episode, step, done, task, sentence, WorkspaceSpec(pixel_size=pixel_size), rng))
            if primitives:
                rows[-1]["demos"][0]["primitive"] = primitives[episode % len(primitives)]
    pq.write_table(pa.Table.from_pylist(rows), folder / "part-00000.parquet")
    workspace = WorkspaceSpec(pixel_size=pixel_size).to_dict()
    (folder / "meta.json").write_text(json.dumps({"version": 1, "workspace": workspace}))
    return folder


def _flat_row(
    episode: int,
    step: int,
    done: bool,
    task: str,
    sentence: str,
    workspace: WorkspaceSpec,
    rng: np.random.Generator,
) -> dict[str, Any]:
    scale = 0.0025 / workspace.pixel_size
    color = np.full((*workspace.shape, 3), 200, np.uint8)
    height = np.zeros(workspace.shape, np.float32)
    pick = (int(scale * rng.integers(40, 120)), int(scale * rng.integers(30, 130)))
    place = (int(scale * rng.integers(200, 280)), int(scale * rng.integers(30, 130)))
    for (row, col), name, side in ((pick, "red", 8), (place, "blue", 20)):
        half = max(int(scale * side), 1)
        color[row - half : row + half, col - half : col + half] = COLORS[name]
        height[row - half : row + half, col - half : col + half] = 0.04
    demo = {
        "instruction": sentence,
        "block": "red",
        "bowl": "blue",
        "done": done,
        "pick_row": pick[0],
        "pick_col": pick[1],
        "pick_yaw": 0.0,
        "pick_yaw_period": float(np.pi / 2),
        "place_row": place[0],
        "place_col": place[1],
        "place_yaw": 0.0,
    }
    return {
        "task": task,
        "episode": episode,
        "seed": episode,
        "step": step,
        "color_png": _png(color[..., ::-1]),
        "height_png": _png(np.round((height - workspace.z_min) / 1e-4).astype(np.uint16)),
        "valid_png": _png(np.full(workspace.shape, 255, np.uint8)),
        "demos": [demo],
    }


@pytest.fixture
def make_flat_set() -> Callable[..., Path]:
    """write_flat_set."""
    return write_flat_set


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
def policy() -> Policy:
    """Return the shipped policy."""
    return load_policy()


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


TINY = {"width": 0.0625, "crop_pixels": 32, "n_rotations": 8}
TINY_COMPACT = {"widths": (8, 12), "goal_dim": 16, "crop_pixels": 16, "query_cells": 9, "n_rotations": 8}


@pytest.fixture
def tiny_checkpoint(clip_models: Path, tmp_path: Path) -> Callable[..., Path]:
    """Saves a small untrained policy of a named config for a workspace of 64 x 32 pixels."""

    def make(name: str, primitive: Primitive = Primitive.PICK_PLACE, **changes: object) -> Path:
        torch.manual_seed(0)
        small = TINY_COMPACT if name == "compact" else TINY
        network = build_network(load_network_config(name, {**small, **changes}))
        workspace = WorkspaceSpec(pixel_size=0.0125)
        anchors = shared_encoder().encode_one(SENTENCE).sentence_vectors()
        card = Card(network.config, workspace, ENCODER_NAME, 0.45, frozen=network.encoder_identity, primitive=primitive)
        path = tmp_path / f"{name}.safetensors"
        save_checkpoint(path, {**network.state_dict(), ANCHORS: anchors}, card)
        return path

    return make


@pytest.fixture
def give_presence() -> Callable[[Path, bool], None]:
    """Gives a checkpoint a presence network that knows blocks and bowls, and sees everything, or nothing."""
    shades = tuple(tuple(float(value) for value in shade_of(color)) for color in (0x4E79A7, 0x59A14F, 0xFF5759))
    vocabulary = Vocabulary(("block", "bowl"), ("blue", "green", "red"), shades)

    def give(path: Path, sees: bool) -> None:
        net, reader = SceneNet(2, 3), SentenceNet(2)
        with torch.no_grad():
            net.out.bias.fill_(9.0 if sees else -9.0)
            reader.kind.bias.copy_(torch.tensor((9.0, 0.0, 0.0)))  # all is a block
        put_presence(path, vocabulary, net, reader, {"command": "by hand"})

    return give


SETUP = CaptureSetup(
    WorkspaceSpec(pixel_size=0.0125),
    CameraModel(160, 120, 110.0, 110.0, 80.0, 60.0),
    "camera",
    "base",
    Pose.looking_at((0.45, 0.0, 0.8), (0.45, 0.0, 0.0)),
)
HALF_SIDE = {"red": 0.03, "blue": 0.06}  # of what is drawn [m]


def camera_messages(pick: PlanarPose, place: PlanarPose, stamp_ns: int) -> list[RawMessage]:
    """A red square at the pick and a blue one at the place, lying flat, as SETUP's camera sees them from above."""
    camera, pose = SETUP.camera, SETUP.camera_in_base
    rays = camera.rays() @ pose.rotation.T
    depth = -pose.translation[2] / rays[..., 2]
    xy = rays[..., :2] * depth[..., None] + pose.translation[:2]
    color = np.full((camera.height, camera.width, 3), 200, np.uint8)
    for at, name in ((place, "blue"), (pick, "red")):
        color[(np.abs(xy - (at.x, at.y)) < HALF_SIDE[name]).all(axis=-1)] = COLORS[name]
    seen = Observation(stamp_ns, color, depth.astype(np.float32), camera, pose, {})
    return messages_from_observation(seen, SETUP.camera_frame, SETUP.base_frame)


def write_episode(
    data_set: Path,
    name: str,
    success: bool | None = True,
    outcomes: tuple[int, ...] = (0, 0),
    seed: int = 0,
    setup: CaptureSetup = SETUP,
    primitive: Primitive = Primitive.PICK_PLACE,
) -> list[StepRecord]:
    """An episode of flat squares, a step an outcome; the records of its steps. A data set of it is made if needed."""
    DataSet.open_or_create(data_set, setup)
    writer, rng = EpisodeWriter.create(data_set, setup, name), np.random.default_rng(seed)
    records = []
    for step, outcome in enumerate(outcomes):
        stamp_ns = (100 + 8 * step) * 10**9
        pick = PlanarPose(rng.uniform(0.33, 0.57), rng.uniform(-0.3, -0.1), rng.uniform(-1.5, 1.5))
        place = PlanarPose(rng.uniform(0.33, 0.57), rng.uniform(0.1, 0.3), pick.yaw + 0.5)
        record = StepRecord(
            *(step, stamp_ns, setup.base_frame, SENTENCE, Source.CLICKED, None, None, 0, 0, 36),
            action=PickPlaceAction(pick, place, primitive),
            result=ActionResult(Outcome(outcome), "", None, 0.04),
        )
        writer.add_step(camera_messages(pick, place, stamp_ns), record)
        records.append(record)
    writer.finish(camera_messages(place, place, stamp_ns + 8 * 10**9), success)
    return records


@pytest.fixture(scope="session")
def make_episode() -> Callable[..., list[StepRecord]]:
    """write_episode."""
    return write_episode
