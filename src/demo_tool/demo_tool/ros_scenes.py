"""Scenes of the simulator, where one runs."""

from __future__ import annotations

import random
from collections.abc import Callable

from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future

from cliport_core import topics
from cliport_interfaces.srv import ResetTask
from demo_tool.ports import OnAnswer

_SEEDS = 1_000_000  # of the present split, from which a scene is drawn


class RosScenes:
    """Client of the simulator's reset, as `Scenes`; post: calls something in the node's thread."""

    def __init__(self, node: Node, post: Callable[[Callable[[], None]], None]) -> None:
        self._client: Client = node.create_client(ResetTask, topics.SIM_RESET)
        self._post = post
        self._is_there = False

    def look(self) -> None:
        """Update `are_offered`; to be called now and then in the node's thread."""
        self._is_there = self._client.service_is_ready()

    def are_offered(self) -> bool:
        """Return True if the simulator was there when it was looked for last."""
        return self._is_there

    def change(self, on_answer: OnAnswer) -> None:
        """Have the simulator make a random scene of its present task and split."""
        self._post(lambda: self._change(on_answer))

    def _change(self, on_answer: OnAnswer) -> None:
        def answered(done: Future) -> None:
            response = None if done.exception() is not None else done.result()
            if response is None:
                on_answer(False, f"the simulator gave no answer (service {topics.SIM_RESET})")
            else:
                on_answer(bool(response.success), str(response.instruction if response.success else response.message))

        request = ResetTask.Request(seed=random.randrange(_SEEDS))
        self._client.call_async(request).add_done_callback(answered)
