"""A short life with ROS: begun with the command line's ROS arguments, ended however the work ends."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

from cliport_perception.errors import CalibrationError


@contextmanager
def ros_session(ros_args: list[str]) -> Iterator[SingleThreadedExecutor]:
    """Give an executor; at the end it, its nodes and the context are gone.

    Raises:
        CalibrationError: for ROS arguments or parameters that cannot be understood.
        KeyboardInterrupt: when a signal has shut the context down.
    """
    try:
        rclpy.init(args=ros_args)
    except RuntimeError as error:
        reason = str(error).split(", at /")[0]  # where in its own sources is of no use here
        raise CalibrationError(f"{reason}; look at what follows --ros-args") from None
    executor = SingleThreadedExecutor()
    try:
        yield executor
    except ParameterException as error:
        raise CalibrationError(f"a parameter cannot be used: {error}") from None
    except ExternalShutdownException:
        raise KeyboardInterrupt from None
    finally:
        nodes = executor.get_nodes()
        executor.shutdown()
        for node in nodes:
            node.destroy_node()
        rclpy.try_shutdown()
