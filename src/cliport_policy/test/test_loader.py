"""Mixtures are drawn by weight, and steps are the same however often, by whom and in how many parts they are made."""

import multiprocessing
import threading
from collections import Counter
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from torch.utils.data.dataloader import _MultiProcessingDataLoaderIter

from cliport_policy.config import PAPER, TrainConfig
from cliport_policy.data.batches import Batch, Phrasebook
from cliport_policy.data.demonstrations import load_demonstrations
from cliport_policy.data.loader import Loader, lost_workers_told
from cliport_policy.data.mixture import Mixture, Source
from cliport_policy.errors import DataError, TrainingError

SMALL = 0.0125  # m: pixels of 64 x 32 heightmaps
CONFIG = TrainConfig(batch_size=6, phrases_per_goal=3)
MakeSet = Callable[..., Path]


def _mixture(make: MakeSet, folder: Path, weights: tuple[float, ...] = (1.0,), **options: object) -> Mixture:
    sources = []
    for number, weight in enumerate(weights):
        path = make(folder / str(number), 3, seed=number, actions=2, task=f"task-{number}-seq", pixel_size=SMALL)
        sources.append(Source(load_demonstrations(path), weight))
    return Mixture(sources, **options)  # type: ignore[arg-type]


def _loader(mixture: Mixture, config: TrainConfig = CONFIG, rank: int = 0, size: int = 1) -> Loader:
    book = Phrasebook(dict.fromkeys(mixture.instructions(), config.phrases_per_goal), np.random.default_rng(0))
    return Loader(mixture, book, config, rank=rank, world_size=size)


def _same(a: list[Batch], b: list[Batch]) -> bool:
    return [p for x in a for p in x.phrases] == [p for x in b for p in x.phrases] and all(
        torch.equal(torch.cat([getattr(x, name) for x in a]), torch.cat([getattr(x, name) for x in b]))
        for name in ("images", "done", "pick", "pick_yaw", "place", "rotation", "seeds")
    )


def test_data_sets_are_drawn_by_weight_and_finished_scenes_by_share(make_flat_set: MakeSet, tmp_path: Path) -> None:
    mixture = _mixture(make_flat_set, tmp_path, (1.0, 3.0), done_share=0.2)
    drawn = [mixture[int(i)] for i in mixture.draw(4000, np.random.default_rng(0))]
    tasks = Counter(d.frame.task for d in drawn)
    assert tasks["task-1-seq"] / 4000 == pytest.approx(0.75, abs=0.03)
    assert sum(d.demo.done for d in drawn) / 4000 == pytest.approx(0.2, abs=0.03)
    assert len({(d.frame.task, d.frame.episode, d.frame.step) for d in drawn}) == 2 * 3 * 3
    assert all(d.frame in d.data.frames for d in drawn)  # a task's episode comes from its own data set


def test_the_papers_share_of_finished_scenes_is_none(make_flat_set: MakeSet, tmp_path: Path) -> None:
    mixture = _mixture(make_flat_set, tmp_path, done_share=PAPER.done_share)
    assert not any(mixture[int(i)].demo.done for i in mixture.draw(200, np.random.default_rng(0)))


@pytest.mark.parametrize("workers", [0, 2])
def test_a_step_is_always_the_same(workers: int, make_flat_set: MakeSet, tmp_path: Path) -> None:
    loader = _loader(_mixture(make_flat_set, tmp_path))
    cv2.GaussianBlur(np.zeros((2000, 2000), np.float32), (31, 31), 5.0)  # OpenCV has its threads before workers begin
    steps = loader.steps(5, workers)
    for number in (5, 6, 7, 8):
        assert _same(next(steps).parts, loader.step(number).parts)
    steps.close()
    assert not _same(loader.step(5).parts, loader.step(6).parts)


@pytest.mark.parametrize(("size", "accumulate"), [(1, 3), (2, 1), (2, 2), (4, 2)])
def test_shares_and_parts_make_up_the_step(size: int, accumulate: int, make_flat_set: MakeSet, tmp_path: Path) -> None:
    mixture = _mixture(make_flat_set, tmp_path)
    whole = _loader(mixture).step(3)
    config = replace(CONFIG, accumulate=accumulate)
    shares = [_loader(mixture, config, rank, size).step(3) for rank in range(size)]
    assert _same([part for share in shares for part in share.parts], whole.parts)
    assert {(share.samples, share.actions) for share in shares} == {(6, int((~whole.parts[0].done).sum()))}


def test_a_goal_image_moves_with_its_observation(make_flat_set: MakeSet, tmp_path: Path) -> None:
    """Where the goal is the observation itself, as at an episode's end, both images are one after any augmentation."""
    config = replace(CONFIG, augment_probability=1.0, batch_size=24)
    batch = _loader(_mixture(make_flat_set, tmp_path, with_goals=True, done_share=0.5), config).step(0).parts[0]
    assert batch.goal_images is not None and batch.done.any() and not batch.done.all()
    for image, goal, done in zip(batch.images, batch.goal_images, batch.done, strict=True):
        assert torch.equal(image, goal) == bool(done)


@pytest.mark.parametrize("workers", [0, 2])
def test_a_loader_hands_errors_on(workers: int, make_flat_set: MakeSet, tmp_path: Path) -> None:
    mixture = _mixture(make_flat_set, tmp_path)
    (tmp_path / "0" / "part-00000.parquet").unlink()
    with pytest.raises(DataError, match=r"part-00000\.parquet can't be read \(\[Errno 2\]"):
        next(_loader(mixture).steps(0, workers))


def test_workers_use_one_thread_each_and_the_training_gets_its_own_back(
    make_flat_set: MakeSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loader, before = _loader(_mixture(make_flat_set, tmp_path)), cv2.getNumThreads()
    cv2.setNumThreads(2)
    try:
        monkeypatch.setattr(Loader, "step", lambda self, number: (number, cv2.getNumThreads()))
        with closing(loader.steps(3, 2)) as steps:
            assert [next(steps) for _ in range(4)] == [(3, 1), (4, 1), (5, 1), (6, 1)]
        assert cv2.getNumThreads() == 2
    finally:
        cv2.setNumThreads(before)


def test_a_worker_that_is_gone_is_told_of_in_one_line(make_flat_set: MakeSet, tmp_path: Path) -> None:
    def train() -> None:
        with lost_workers_told(), closing(_loader(_mixture(make_flat_set, tmp_path)).steps(0, 2)) as steps:
            next(steps)
            for worker in multiprocessing.active_children():
                worker.kill()
            for _ in range(20):
                next(steps)

    with pytest.raises(TrainingError, match=r"^a process that makes batches is gone"):
        train()
    with pytest.raises(RuntimeError, match=r"^another$"), lost_workers_told():
        raise RuntimeError("another")
    with pytest.raises(RuntimeError, match=r"^Caught"), lost_workers_told():
        raise RuntimeError("Caught RuntimeError in DataLoader worker process 3.")


def test_a_worker_that_ends_in_the_midst_of_a_batch_is_told_of_as_well(
    make_flat_set: MakeSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def cut_off(steps: object) -> None:
        for worker in multiprocessing.active_children():
            threading.Timer(0.3, worker.kill).start()
        raise ConnectionResetError(104, "Connection reset by peer")

    monkeypatch.setattr(_MultiProcessingDataLoaderIter, "_next_data", cut_off)
    with pytest.raises(TrainingError, match=r"^a process that makes batches is gone"), lost_workers_told():
        next(_loader(_mixture(make_flat_set, tmp_path)).steps(0, 2))


def test_unlike_workspaces_do_not_mix(make_flat_set: MakeSet, tmp_path: Path) -> None:
    sets = [load_demonstrations(make_flat_set(tmp_path / str(size), 1, pixel_size=size)) for size in (SMALL, 2 * SMALL)]
    with pytest.raises(DataError, match="other workspaces"):
        Mixture([Source(data) for data in sets])


@pytest.mark.parametrize("weight", [0.0, -1.0, float("nan"), float("inf")])
def test_weights_are_positive(weight: float, flat_set: Path) -> None:
    with pytest.raises(DataError, match="give a positive number"):
        Source(load_demonstrations(flat_set), weight)
