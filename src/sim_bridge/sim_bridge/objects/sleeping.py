"""Many small things cost much physics: those that rest untouched may sleep until something touches them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from sim_bridge.bullet import pybullet
from sim_bridge.objects.shape import SceneObject

if TYPE_CHECKING:
    from sim_bridge.world import SimWorld


def let_sleep(world: SimWorld, things: Iterable[SceneObject]) -> None:
    """From now on they fall asleep two seconds after they came to rest."""
    _set(world, things, pybullet.ACTIVATION_STATE_ENABLE_SLEEPING)


def put_to_sleep(world: SimWorld, things: Iterable[SceneObject]) -> None:
    """At once: for things that are known to rest; those that may not sleep (see let_sleep) stay awake."""
    _set(world, things, pybullet.ACTIVATION_STATE_SLEEP)


def wake(world: SimWorld, things: Iterable[SceneObject]) -> None:
    """For what is pulled by something else than a touch."""
    _set(world, things, pybullet.ACTIVATION_STATE_WAKE_UP)


def _set(world: SimWorld, things: Iterable[SceneObject], state: int) -> None:
    for thing in things:
        pybullet.changeDynamics(thing.body, -1, activationState=state, physicsClientId=world.client)
