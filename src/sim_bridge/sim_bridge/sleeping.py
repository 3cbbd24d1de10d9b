"""Many small things cost much physics: those that rest untouched may sleep until something touches them."""

from __future__ import annotations

from collections.abc import Iterable

from sim_bridge.bullet import pybullet
from sim_bridge.objects.shape import SceneObject
from sim_bridge.world import SimWorld

_FIRST_STEPS = 4  # after which what is about to fall does


def let_sleep(world: SimWorld, things: Iterable[SceneObject]) -> None:
    """From now on they fall asleep two seconds after they came to rest."""
    _set(world, things, pybullet.ACTIVATION_STATE_ENABLE_SLEEPING)


def sleep_where_still(world: SimWorld) -> None:
    """What may sleep (see let_sleep) and rests does so at once, and costs nothing until something wakes it."""
    for thing in world.objects:
        if not thing.fixed and world.is_still(thing):
            # linked things never stop trembling by themselves, and trembling wakes
            pybullet.resetBaseVelocity(thing.body, [0, 0, 0], [0, 0, 0], physicsClientId=world.client)
            _set(world, [thing], pybullet.ACTIVATION_STATE_SLEEP)


def come_to_rest(world: SimWorld) -> None:
    """Settle with as little awake as can be, and sleep.

    Raises:
        PhysicsError: see SimWorld.settle.
    """
    for _ in range(_FIRST_STEPS):
        world.step()
    sleep_where_still(world)
    world.settle()
    sleep_where_still(world)


def wake(world: SimWorld, things: Iterable[SceneObject]) -> None:
    """For what is pulled by something else than a touch."""
    _set(world, things, pybullet.ACTIVATION_STATE_WAKE_UP)


def _set(world: SimWorld, things: Iterable[SceneObject], state: int) -> None:
    for thing in things:
        pybullet.changeDynamics(thing.body, -1, activationState=state, physicsClientId=world.client)
