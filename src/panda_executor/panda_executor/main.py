"""The executable `executor`: it starts the node, and stops the arm before the process ends."""

from __future__ import annotations

from cliport_core.errors import CoreError
from cliport_core.ros_running import run_node
from panda_executor.errors import ExecutorError
from panda_executor.node import ExecutorNode


def main(args: list[str] | None = None) -> int:
    """Run the node; return the exit status. SIGINT and SIGTERM cancel what runs before the process ends."""
    return run_node(lambda _: ExecutorNode(), (ExecutorError, CoreError), args, ExecutorNode.close)
