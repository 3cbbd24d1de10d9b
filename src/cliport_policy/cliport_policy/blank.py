"""Modules without values, for weights that come from a file: built at once, and without memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import torch
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode

_FILLS = (Tensor.normal_, Tensor.uniform_)


class _LeaveBlank(TorchFunctionMode):
    """Mode in which random initial values are not drawn.

    They would be drawn even on the meta device: by torch's compiler, whose import takes seconds and 100 MB.
    """

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Sequence[type],
        args: tuple[Any, ...] = (),
        kwargs: Mapping[str, Any] | None = None,
    ) -> Any:
        arguments = dict(kwargs or {})
        fills = func in _FILLS or getattr(func, "__module__", "") == nn.init.__name__
        if fills:
            return args[0] if args else arguments["tensor"]
        return func(*args, **arguments)


@contextmanager
def blank_modules() -> Iterator[None]:
    """Make modules on the meta device within this context; `load_state_dict(..., assign=True)` makes them usable."""
    with torch.device("meta"), _LeaveBlank():
        yield
