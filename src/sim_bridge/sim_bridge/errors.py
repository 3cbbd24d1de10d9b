"""Errors of sim_bridge: one root, values carried, the remedy named."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class SimBridgeError(Exception):
    """Root of everything that this package raises on purpose."""


class SimulationError(SimBridgeError):
    """A command or a scene that the simulator cannot take."""


class UnknownNameError(SimBridgeError):
    """A name that is not registered; the message names the nearest ones."""

    def __init__(self, what: str, name: str, known: Iterable[str]) -> None:
        self.name = name
        self.known = tuple(known)
        near = difflib.get_close_matches(name, self.known, n=2, cutoff=0.4)
        hint = f"did you mean {' or '.join(near)}?" if near else f"choose from {', '.join(self.known)}"
        super().__init__(f"unknown {what} '{name[:60]}': {hint}")


class LayoutError(SimBridgeError):
    """No free place was found for all objects of a scene."""


class PhysicsError(SimBridgeError):
    """Objects that flew apart: the episode is worth nothing."""


class ObjectFolderError(SimBridgeError):
    """A folder of object meshes that is missing or not usable."""


class GoalError(SimBridgeError):
    """An instruction that names no goal that this task can set up."""


class TaskPackageError(SimBridgeError):
    """A task of another package that cannot be used."""

    def __init__(self, name: str, why: str) -> None:
        self.name = name
        super().__init__(f"the added task '{name[:60]}': {' '.join(why.split())}; mend or uninstall its package")
