"""Checks of numbers that come as ROS parameters."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from panda_executor.errors import ExecutorError

Get = Callable[[str, Any], Any]  # declares a parameter of a name and a default, and returns its value


def whole(get: Get, name: str, default: int, most: int) -> int:
    """Return the parameter `name`. Raises ExecutorError unless it is from 1 to `most`."""
    value = int(get(name, default))
    if not 1 <= value <= most:
        raise ExecutorError(f"{name} must be 1 to {most}, got {value}")
    return value


def finite(get: Get, name: str, default: float) -> float:
    """Return the parameter `name`. Raises ExecutorError unless it is a finite number."""
    value = float(get(name, default))
    if not math.isfinite(value):
        raise ExecutorError(f"{name} must be finite, got {value:g}")
    return value


def positive(get: Get, name: str, default: float) -> float:
    """Return the parameter `name`. Raises ExecutorError unless it is positive and finite."""
    value = finite(get, name, default)
    if not value > 0.0:
        raise ExecutorError(f"{name} must be positive, got {value:g}")
    return value


def not_negative(get: Get, name: str, default: float) -> float:
    """Return the parameter `name`. Raises ExecutorError when it is negative or not finite."""
    value = finite(get, name, default)
    if value < 0.0:
        raise ExecutorError(f"{name} must not be negative, got {value:g}")
    return value
