"""Cost of acting: memory of the process, an action of the network at the paper's size, and what tricks save."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

_ACT = """
import json, sys, time
import numpy as np
from cliport_core.heightmap import Heightmap
from cliport_policy import load_policy
def sizes():
    with open("/proc/self/status") as file:
        lines = dict(line.split(":", 1) for line in file)
    return {name: int(lines[name].split()[0]) / 1024 for name in ("VmRSS", "VmHWM")}
start = time.perf_counter()
policy = load_policy(sys.argv[1])
loading = time.perf_counter() - start
size = policy.workspace.shape
color = np.random.default_rng(0).integers(0, 255, (*size, 3)).astype(np.uint8)
seen = Heightmap(color, np.zeros(size, np.float32), np.ones(size, bool), policy.workspace)
actions = []
for _ in range(int(sys.argv[2])):
    start = time.perf_counter()
    policy.infer(seen, "put the red blocks in a green bowl", with_maps=True)
    actions.append(1000 * (time.perf_counter() - start))
print(json.dumps({"loading": loading, "actions": actions[2:], **sizes()}))
"""


def footprint(checkpoint: str, models: Path | None = None, actions: int = 8) -> dict[str, list[float]]:
    """Measure a process that loads a checkpoint and acts, without its ROS part (25 MB).

    loading [s], actions [ms] after a warm-up of two, resident and highest [MB].
    """
    environment = dict(os.environ) if models is None else {**os.environ, "CLIPORT_MODELS": str(models)}
    command = [sys.executable, "-c", _ACT, checkpoint, str(actions)]
    run = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    found = json.loads(run.stdout)
    return {
        "loading": [found["loading"]],
        "actions": found["actions"],
        "resident": [found["VmRSS"]],
        "highest": [found["VmHWM"]],
    }


def paper_size_footprint() -> dict[str, list[float]]:
    """Measure `cliport` at full size, with random weights: 1.3 GB of files in a temporary folder."""
    from cliport_policy.encoders.files import CLIP_FILE, FOLDER_VARIABLE

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        before = os.environ.get(FOLDER_VARIABLE)
        os.environ[FOLDER_VARIABLE] = name
        try:
            _write_random_clip(folder / CLIP_FILE)
            _write_random_cliport(folder / "policy.safetensors")
        finally:
            os.environ.pop(FOLDER_VARIABLE)
            if before is not None:
                os.environ[FOLDER_VARIABLE] = before
        return footprint(str(folder / "policy.safetensors"), folder, actions=5)


def _write_random_clip(path: Path) -> None:
    """Write a file with the tensors of OpenAI's RN50.pt that are read."""
    import torch

    from cliport_policy.encoders.clip_modules import ClipResNet, ClipText

    visual = ClipResNet(64, (3, 4, 6, 3)).state_dict()
    text = ClipText(49408, 77, 512, 12, 1024)
    for parameter in (text.positional_embedding, text.text_projection):
        torch.nn.init.normal_(parameter, std=0.01)
    tensors = {f"visual.{name.removeprefix('stem.')}": value for name, value in visual.items()} | text.state_dict()
    torch.save({name: value.half() if value.is_floating_point() else value for name, value in tensors.items()}, path)


def _write_random_cliport(path: Path) -> None:
    from cliport_core.workspace import WorkspaceSpec
    from cliport_policy.card import Card
    from cliport_policy.checkpoint import ANCHORS, save_checkpoint
    from cliport_policy.language import ENCODER_NAME, shared_encoder
    from cliport_policy.named_configs import load_network_config
    from cliport_policy.networks.factory import build_network

    network = build_network(load_network_config("cliport"))
    anchors = shared_encoder().encode_one("put the red blocks in a green bowl").sentence_vectors()
    card = Card(network.config, WorkspaceSpec(), ENCODER_NAME, 0.45, frozen=network.encoder_identity)
    save_checkpoint(path, {**network.state_dict(), ANCHORS: anchors}, card)


def tricks() -> Iterator[tuple[str, Callable[[], object]]]:
    """Yield each trick and the plain computation it replaces, at the paper's sizes; the tests hold them equal.

    The correlation is done in the frequency domain and a few rotations at a time, all at a time, and as a convolution;
    the fusion of laterals as two convolutions, and as one of the joined maps.
    """
    import torch
    from torch.nn import functional as F

    from cliport_policy.networks.correlation import correlate_inside
    from cliport_policy.networks.streams.fusion import LateralFusion

    key, window = torch.randn(1, 3, 384, 224), torch.randn(1, 36, 3, 64, 64)
    x, lateral = (torch.randn(1, c, 640, 640).bfloat16().to(memory_format=torch.channels_last) for c in (16, 32))
    fusion = LateralFusion(16, 32).to(torch.bfloat16).requires_grad_(False)

    def at_once() -> torch.Tensor:
        spectrum = torch.fft.rfft2(key).unsqueeze(1) * torch.fft.rfft2(window, s=(384, 224)).conj()
        return torch.fft.irfft2(spectrum.sum(2), s=(384, 224))[..., :321, :161]

    yield "correlate_36", lambda: correlate_inside(key, window)
    yield "correlate_36_at_once", at_once
    yield "correlate_36_conv2d", lambda: F.conv2d(key, window[0])
    yield "lateral_fusion", lambda: fusion(x, lateral)
    yield "lateral_fusion_joined", lambda: fusion.project(F.relu(torch.cat((x, lateral), dim=1)))
