"""The simulator's reset as the page asks for it, without a graph."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.task import Future

from cliport_interfaces.srv import ResetTask
from demo_tool.ros_scenes import RosScenes


class Client:
    """A service whose answer the test gives."""

    def __init__(self) -> None:
        self.ready, self.asked, self.answer = False, list[Any](), Future()

    def service_is_ready(self) -> bool:
        return self.ready

    def call_async(self, request: Any) -> Future:
        self.asked.append(request)
        return self.answer


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (ResetTask.Response(success=True, instruction="put it there", message="scene 3"), (True, "put it there")),
        (ResetTask.Response(success=False, message="no layout was found"), (False, "no layout was found")),
        (None, (False, "the simulator gave no answer (service /sim_bridge/reset)")),
        (RuntimeError("gone"), (False, "the simulator gave no answer (service /sim_bridge/reset)")),
    ],
)
def test_a_scene_of_the_present_task_is_asked_for(answer: Any, said: tuple[bool, str]) -> None:
    client = Client()
    node: Any = SimpleNamespace(create_client=lambda kind, name: client)
    scenes, answers = RosScenes(node, lambda act: act()), list[tuple[bool, str]]()
    client.ready = True
    assert not scenes.are_offered()
    scenes.look()
    assert scenes.are_offered()
    scenes.change(lambda ok, words: answers.append((ok, words)))
    (request,) = client.asked
    assert (request.task, request.split, request.instruction) == ("", "", "") and 0 <= request.seed < 1_000_000
    if isinstance(answer, Exception):
        client.answer.set_exception(answer)
    else:
        client.answer.set_result(answer)
    assert answers == [said]
