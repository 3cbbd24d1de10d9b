"""What `bench` says of acting: a process's memory, the paper's size in a folder of its own, tricks that are equal."""

import os
from pathlib import Path

import pytest
import torch

from cliport_benchmark import bench_inference
from cliport_benchmark.bench_inference import footprint, paper_size_footprint, tricks
from cliport_policy.encoders.files import CLIP_FILE, FOLDER_VARIABLE


def test_a_footprint_is_of_a_process_that_acts() -> None:
    found = footprint("default", actions=4)
    assert sorted(found) == ["actions", "highest", "loading", "resident"]
    assert len(found["actions"]) == 2, "the first two warm up"
    assert all(1 < action < 100_000 for action in found["actions"]) and 0.01 < found["loading"][0] < 500  # ms, s
    assert 50 < found["resident"][0] <= found["highest"][0] < 10_000  # MB


@pytest.mark.parametrize("given", [None, "/models/of/mine"])
@pytest.mark.parametrize("fails", [False, True])
def test_the_papers_size_lies_in_a_folder_of_its_own_for_as_long_as_it_is_measured(
    monkeypatch: pytest.MonkeyPatch, given: str | None, fails: bool
) -> None:
    monkeypatch.delenv(FOLDER_VARIABLE, raising=False)
    if given is not None:
        monkeypatch.setenv(FOLDER_VARIABLE, given)
    told: list[tuple[str, object]] = []

    def write_clip(path: Path) -> None:
        told.append(("clip", path))
        assert os.environ[FOLDER_VARIABLE] == str(path.parent) and path.name == CLIP_FILE

    def write_cliport(path: Path) -> None:
        told.append(("cliport", path))
        if fails:
            raise OSError("no space left on device")

    def measure(checkpoint: str, models: Path, actions: int) -> dict[str, list[float]]:
        assert checkpoint == str(models / "policy.safetensors") and models.is_dir() and actions == 5
        assert os.environ.get(FOLDER_VARIABLE) == given
        return {"resident": [7.0]}

    monkeypatch.setattr(bench_inference, "_write_random_clip", write_clip)
    monkeypatch.setattr(bench_inference, "_write_random_cliport", write_cliport)
    monkeypatch.setattr(bench_inference, "footprint", measure)
    if fails:
        with pytest.raises(OSError, match="no space left"):
            paper_size_footprint()
    else:
        assert paper_size_footprint() == {"resident": [7.0]}
    (_, clip), (_, cliport) = told
    assert isinstance(clip, Path) and isinstance(cliport, Path) and clip.parent == cliport.parent
    assert not clip.parent.exists() and os.environ.get(FOLDER_VARIABLE) == given


def test_tricks_change_nothing() -> None:
    torch.manual_seed(0)
    found = dict(tricks())
    assert list(found) == [
        "correlate_36", "correlate_36_at_once", "correlate_36_conv2d", "lateral_fusion", "lateral_fusion_joined",
    ]  # fmt: skip
    with torch.no_grad():
        results = {name: compute() for name, compute in found.items()}
    plain = results["correlate_36_conv2d"]
    assert plain.shape == (1, 36, 321, 161)
    for name in ("correlate_36", "correlate_36_at_once"):
        assert torch.allclose(results[name], plain, atol=2e-3 * float(plain.abs().max())), name
    fused, joined = results["lateral_fusion"], results["lateral_fusion_joined"]
    assert fused.shape == joined.shape == (1, 16, 640, 640)
    assert torch.allclose(fused.float(), joined.float(), atol=0.03 * float(joined.float().abs().max()))
