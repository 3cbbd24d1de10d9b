"""The inference thread: what fails in it is said, and warming up checks no sentence."""

import logging
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from cliport_policy.errors import InstructionError
from cliport_policy.policy import load_policy
from cliport_policy.server.inference_worker import InferenceWorker

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
