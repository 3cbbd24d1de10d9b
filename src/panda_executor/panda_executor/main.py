"""The executable `executor`: starts the node, and stops the arm before the process ends."""

from __future__ import annotations

from cliport_perception.errors import PerceptionError
from cliport_perception.ros_running import run_node
from panda_executor.errors import ExecutorError
from panda_executor.node import ExecutorNode


def main(args: list[str] | None = None) -> int:
    """Entry point; returns the exit status. SIGINT and SIGTERM cancel what runs before the process ends."""
    return run_node(lambda _: ExecutorNode(), (ExecutorError, PerceptionError), args, ExecutorNode.close)
