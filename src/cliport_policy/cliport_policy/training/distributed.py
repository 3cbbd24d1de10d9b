"""Processes that train one network together, as torchrun starts them; one process is a group of one.

Each handles an equal share of every step's samples and all add up their gradients, so a network without batch norm
learns the same in a group of any size. Batch norm (the compact network) takes its statistics from each process's own
share, and from each accumulated part of it: keep these at 8 samples or more. The first process's are saved.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, field

import torch
from torch import Tensor, nn
from torch import distributed as dist

from cliport_policy.errors import TrainingError


@dataclass(frozen=True)
class Group:
    """Process's rank in a group of processes, and its device."""

    rank: int = 0
    size: int = 1
    device: torch.device = field(default_factory=lambda: torch.device("cpu"))

    @property
    def is_first(self) -> bool:
        """True in the process that saves and reports."""
        return self.rank == 0

    def share(self, network: nn.Module) -> None:
        """Give every process the first one's weights."""
        if self.size > 1:
            for value in network.state_dict().values():
                dist.broadcast(value, 0)

    def sum(self, values: Tensor) -> Tensor:
        """Return the sum over all processes, in place.

        Raises:
            TrainingError: if one of them has ended.
        """
        if self.size > 1:
            _all_reduce(values)
        return values

    def sum_gradients(self, parameters: Iterable[nn.Parameter]) -> None:
        """Replace each gradient by its sum over all processes; an absent one counts as 0."""
        if self.size == 1:
            return
        learning = [p for p in parameters if p.requires_grad]
        flat = torch.cat([(torch.zeros_like(p) if p.grad is None else p.grad).flatten() for p in learning])
        _all_reduce(flat)
        for parameter, gradient in zip(learning, flat.split([p.numel() for p in learning]), strict=True):
            parameter.grad = gradient.view_as(parameter)

    def any(self, flag: bool) -> bool:
        """Return True if the flag is True in any process."""
        return flag if self.size == 1 else bool(self.sum(torch.tensor(float(flag), device=self.device)) > 0)

    def leave(self) -> None:
        """Leave the group, after the last exchange."""
        if self.size > 1:
            dist.destroy_process_group()


def _all_reduce(values: Tensor) -> None:
    try:
        dist.all_reduce(values)
    except RuntimeError as error:
        raise TrainingError("another process of this training has ended: its own message says why") from error


def join_group(device: str = "auto") -> Group:
    """Join the group that torchrun's environment describes, over nccl on GPUs and gloo on CPUs.

    Raises:
        TrainingError: if a GPU is asked for and there is none.
    """
    has_gpu = torch.cuda.is_available()
    if device == "cuda" and not has_gpu:
        raise TrainingError("no CUDA device is here: give --device cpu")
    use_gpu = has_gpu and device != "cpu"
    rank, size = int(os.environ.get("RANK", "0")), int(os.environ.get("WORLD_SIZE", "1"))
    where = torch.device("cuda", int(os.environ.get("LOCAL_RANK", "0"))) if use_gpu else torch.device("cpu")
    if use_gpu:
        torch.cuda.set_device(where)
    if size > 1:
        dist.init_process_group("nccl" if use_gpu else "gloo")
    return Group(rank, size, where)
