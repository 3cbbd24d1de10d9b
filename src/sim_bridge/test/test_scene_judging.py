"""When the simulator's node judges a scene: once an action, with the arm at home and everything at rest."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sim_bridge.node_services import SceneServices
from sim_bridge.robot import ROBOT

HOME = np.asarray(ROBOT.ready, dtype=np.float64)


class Bench:
    """The services over a loop, an arm and a task that only count."""

    def __init__(self) -> None:
        self.judged = 0
        self.still, self.fixed = True, False
        self.state = SimpleNamespace(positions=HOME)
        world = SimpleNamespace(
            panda=SimpleNamespace(state=lambda: self.state),
            objects=[SimpleNamespace(fixed=False)],
            is_still=lambda thing: self.still,
        )
        arm = SimpleNamespace(active=None)
        self.loop = SimpleNamespace(world=world, arm=arm, every=self._every, call=lambda job: job())
        node = SimpleNamespace(get_logger=lambda: None, create_service=lambda *a, **k: None)
        task = SimpleNamespace(
            advance=self._advance, score=lambda: 0.25, done=lambda: False, instruction="put it there"
        )
        self.services = SceneServices(node, self.loop, task, 3)  # type: ignore[arg-type]

    def _every(self, period: float, callback: Any) -> None:
        self.watch = callback

    def _advance(self) -> None:
        self.judged += 1

    def at(self, off: float) -> None:
        """Let the loop see the arm so far from home [rad]."""
        self.state = SimpleNamespace(positions=HOME + off)
        self.watch(0.0, self.state)

    def ask(self) -> float:
        return self.services._score_now()[0]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_nothing_is_judged_before_an_action(bench: Bench) -> None:
    bench.at(0.0)
    assert bench.ask() == 0.25 and bench.judged == 0


def test_an_action_is_judged_once_however_often_one_asks(bench: Bench) -> None:
    for number in (1, 2):
        bench.at(0.5)
        assert bench.ask() == 0.25 and bench.judged == number - 1  # on its way
        bench.at(0.0)
        assert (bench.ask(), bench.ask()) == (0.25, 0.25) and bench.judged == number


def test_what_still_moves_is_waited_for_unless_one_asks(bench: Bench) -> None:
    bench.still = False
    bench.at(0.5)
    bench.at(0.0)
    assert bench.judged == 0
    bench.ask()
    assert bench.judged == 1


def test_while_a_trajectory_is_active_nothing_is_judged(bench: Bench) -> None:
    bench.at(0.5)
    bench.loop.arm.active = object()
    bench.at(0.0)
    assert bench.judged == 0
    bench.loop.arm.active = None
    bench.at(0.0)
    assert bench.judged == 1
