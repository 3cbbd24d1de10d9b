"""Sleep of small things: those that rest untouched cost no physics until something touches them."""

from __future__ import annotations

from collections.abc import Iterable

from sim_bridge.bullet import pybullet
from sim_bridge.objects.shape import SceneObject
from sim_bridge.world import SimWorld

_FIRST_STEPS = 4  # physics steps, enough for what is about to fall to begin


def let_sleep(world: SimWorld, things: Iterable[SceneObject]) -> None:
    """Allow things to fall asleep two seconds after they have come to rest."""
    _set(world, things, pybullet.ACTIVATION_STATE_ENABLE_SLEEPING)


def sleep_where_still(world: SimWorld) -> None:
    """Put every thing that may sleep (see let_sleep) and rests to sleep at once, until something wakes it."""
    for thing in world.objects:
        if not thing.fixed and world.is_still(thing):
            # linked things never stop trembling by themselves, and trembling wakes
            pybullet.resetBaseVelocity(thing.body, [0, 0, 0], [0, 0, 0], physicsClientId=world.client)
            _set(world, [thing], pybullet.ACTIVATION_STATE_SLEEP)


def come_to_rest(world: SimWorld) -> None:
    """Settle with as few things awake as possible, then put them to sleep.

    Raises:
        PhysicsError: see SimWorld.settle.
    """
    for _ in range(_FIRST_STEPS):
        world.step()
    sleep_where_still(world)
    world.settle()
    sleep_where_still(world)


def wake(world: SimWorld, things: Iterable[SceneObject]) -> None:
    """Wake things that are about to be pulled by something else than a touch."""
    _set(world, things, pybullet.ACTIVATION_STATE_WAKE_UP)


def _set(world: SimWorld, things: Iterable[SceneObject], state: int) -> None:
    for thing in things:
        pybullet.changeDynamics(thing.body, -1, activationState=state, physicsClientId=world.client)
