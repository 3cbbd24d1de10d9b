"""When the simulator's node judges a scene: once an action, with the arm at home and everything at rest; and what a
reset that fails leaves."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sim_bridge import node_services
from sim_bridge.errors import LayoutError, PhysicsError, SimBridgeError, SimulationError, UnknownNameError
from sim_bridge.node_services import SceneServices
from sim_bridge.robot import ROBOT

SETTLE_S = 2.0
HOME = np.asarray(ROBOT.ready, dtype=np.float64)


class Bench:
    """The services over a loop, an arm and a task that only count."""

    def __init__(self) -> None:
        self.judged = 0
        self.still, self.fixed, self.apart = True, False, False
        self.state = SimpleNamespace(positions=HOME)
        self.resets: list[str] = []
        world = SimpleNamespace(
            time=0.0,
            config=SimpleNamespace(max_settle_s=SETTLE_S),
            panda=SimpleNamespace(state=lambda: self.state),
            objects=[SimpleNamespace(fixed=False)],
            is_still=lambda thing: self.still,
            check_intact=self._check_intact,
        )
        arm = SimpleNamespace(active=None, reset=self.resets.append)
        hand = SimpleNamespace(reset=self.resets.append)
        self.loop = SimpleNamespace(world=world, arm=arm, gripper=hand, every=self._every, call=lambda job: job())
        node = SimpleNamespace(
            get_logger=lambda: SimpleNamespace(warning=self.resets.append), create_service=lambda *a, **k: None
        )
        task = SimpleNamespace(
            advance=self._advance,
            score=lambda: 0.25,
            done=lambda: False,
            instruction="put it there",
            name="x",
            split=SimpleNamespace(value="val"),
        )
        self.services = SceneServices(node, self.loop, task, 3)  # type: ignore[arg-type]

    def _every(self, period: float, callback: Any) -> None:
        self.watch = callback

    def _advance(self) -> None:
        self.judged += 1

    def _check_intact(self) -> None:
        if self.apart:
            raise PhysicsError("the red block flew off")

    def at(self, off: float, time: float = 0.0) -> None:
        """Let the loop see the arm so far from home [rad] at that simulated time [s]."""
        self.loop.world.time, self.state = time, SimpleNamespace(positions=HOME + off)
        self.watch(time, self.state)

    def ask(self) -> float:
        return self.services._score_now()[0]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_nothing_is_judged_before_an_action(bench: Bench) -> None:
    bench.at(0.0)
    assert bench.ask() == 0.25 and bench.judged == 0


def test_a_scene_that_flew_apart_keeps_its_score_and_is_judged_no_more(bench: Bench) -> None:
    bench.at(0.5)
    bench.at(0.0)
    assert bench.judged == 1 and not bench.services._broken
    for bench.apart in (True, False):
        bench.at(0.5)
        bench.at(0.0)
        response = bench.services._score(None, SimpleNamespace())  # type: ignore[arg-type]
        assert response.broken and (response.score, bench.judged) == (0.25, 1)
    assert bench.resets == ["the scene is judged no more: the red block flew off"]
    bench.services._take_scene(bench.services._task)
    assert not bench.services._broken


def test_an_action_is_judged_once_however_often_one_asks(bench: Bench) -> None:
    for number in (1, 2):
        bench.at(0.5)
        assert bench.ask() == 0.25 and bench.judged == number - 1  # on its way
        bench.at(0.0)
        assert (bench.ask(), bench.ask()) == (0.25, 0.25) and bench.judged == number


def test_what_still_moves_is_waited_for_though_one_asks(bench: Bench) -> None:
    bench.still = False
    bench.at(0.5)
    bench.at(0.0, time=1.0)
    bench.ask()
    assert bench.judged == 0  # a thing that still rolls
    bench.still = True
    bench.ask()
    assert bench.judged == 1


def test_what_never_rests_is_judged_when_it_had_its_time(bench: Bench) -> None:
    bench.still = False
    bench.at(0.5)
    bench.at(0.0, time=1.0)
    bench.at(0.0, time=1.0 + SETTLE_S - 0.1)
    assert bench.judged == 0
    bench.at(0.0, time=1.0 + SETTLE_S)
    assert bench.judged == 1


def test_an_action_is_judged_before_the_next_at_the_latest(bench: Bench) -> None:
    bench.still = False
    bench.at(0.5)
    bench.at(0.0)
    bench.loop.arm.active = object()
    bench.at(0.0)
    assert bench.judged == 1
    bench.at(0.5)
    bench.loop.arm.active = None
    bench.at(0.0)
    assert bench.judged == 1
    bench.still = True
    bench.at(0.0)
    assert bench.judged == 2


def test_while_a_trajectory_is_active_nothing_is_judged(bench: Bench) -> None:
    bench.at(0.5)
    bench.loop.arm.active = object()
    bench.at(0.0)
    assert bench.judged == 0
    bench.loop.arm.active = None
    bench.at(0.0)
    assert bench.judged == 1


def reset(bench: Bench, monkeypatch: pytest.MonkeyPatch, error: Exception, cleared: bool) -> None:
    """Ask for a scene whose making fails with that error, after or before the world was cleared."""

    def reset_scene(world: Any, *_: object) -> None:
        if cleared:
            world.panda = SimpleNamespace(state=lambda: bench.state)
        raise error

    monkeypatch.setattr(node_services, "reset_scene", reset_scene)
    request = SimpleNamespace(task="align-rope", split="test", seed=4, instruction="")
    with pytest.raises(type(error)):
        bench.services._reset_now(request)


@pytest.mark.parametrize("error", [LayoutError("no place"), SimBridgeError("no meshes"), ValueError("a bug")])
def test_a_reset_that_fails_in_an_emptied_world_leaves_no_scene(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    bench.at(0.5)
    reset(bench, monkeypatch, error, cleared=True)
    assert bench.resets == ["the world was reset"] * 2  # else the arm jumps back to where its motion was
    with pytest.raises(SimulationError, match="there is no scene"):
        bench.ask()
    bench.at(0.0)
    assert bench.judged == 0


def test_a_reset_that_is_refused_keeps_the_scene(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    reset(bench, monkeypatch, UnknownNameError("task", "x", ["y"]), cleared=False)
    assert bench.resets == [] and bench.ask() == 0.25
