"""The inference thread: what fails in it is said, warming up checks no sentence, and how many cores compute."""

import logging
import threading
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from cliport_policy.errors import ConfigError, InstructionError
from cliport_policy.policy import load_policy
from cliport_policy.server import inference_worker
from cliport_policy.server.inference_worker import InferenceWorker, use_threads

pytestmark = pytest.mark.usefixtures("one_thread")


class Broken:
    """A policy that cannot be warmed up."""

    def warm_up(self) -> None:
        raise RuntimeError("no\ncompiler")

    def infer(self, *_: object, **__: object) -> None:
        raise AssertionError


def test_a_job_that_fails_is_one_warning(caplog: pytest.LogCaptureFixture) -> None:
    worker = InferenceWorker(Broken(), lambda _: None)  # type: ignore[arg-type]
    over = threading.Event()

    def fail() -> None:
        raise ValueError("no picture")

    with caplog.at_level(logging.WARNING):
        worker.warm_up()
        worker.run(fail)
        worker.run(over.set)
        assert over.wait(10.0)
        worker.close()
    assert [record.getMessage() for record in caplog.records] == [
        "the inference thread failed: RuntimeError: no compiler",
        "the inference thread failed: ValueError: no picture",
    ]


@pytest.mark.parametrize("name", ["compact", "image_goal"])
def test_a_policy_of_other_tasks_is_warmed_up_too(name: str, tiny_checkpoint: Callable[..., Path]) -> None:
    policy = load_policy(tiny_checkpoint(name))
    policy._anchors = -policy._anchors  # no sentence is like what it was trained on
    with pytest.raises(InstructionError):
        policy.check_instruction("put the red blocks in the green bowl")
    policy.warm_up()


@pytest.mark.parametrize(("given", "cores", "used"), [(0, 1, 1), (0, 2, 1), (0, 16, 8), (3, 2, 3)])
def test_half_of_the_cores_compute_where_nothing_else_is_said(
    given: int, cores: int, used: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(inference_worker.os, "sched_getaffinity", lambda _: set(range(cores)))
    before = torch.get_num_threads()
    try:
        use_threads(given)
        assert torch.get_num_threads() == used
    finally:
        torch.set_num_threads(before)


def test_a_number_of_threads_that_cannot_be_is_named() -> None:
    with pytest.raises(ConfigError, match="threads is -1: give 1 or more, or 0 for half of the cores"):
        use_threads(-1)
