"""What the ports ask of franky, and what they make of its answers; on libfranka itself: test_franky_sim.py."""

from __future__ import annotations

import sys
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from panda_driver import franky_ports
from panda_driver.errors import ArmFaultError, ConnectionFailedError, DriverError, HandFaultError
from panda_driver.franky_ports import ArmSettings, FrankyArm, FrankyHand, load_franky


class StandIn:
    """A module franky that notes every call; a call named in `broken` raises what stands there."""

    Exception = type("Exception", (Exception,), {})
    RealtimeConfig = SimpleNamespace(Enforce="enforce", Ignore="ignore")

    def __init__(self) -> None:
        self.calls: list[tuple[Any, ...]] = []
        self.broken: dict[str, Exception] = {}
        self.answers: dict[str, Any] = {"recover_from_errors": True, "wait": True, "get": True, "is_running": True}
        none = SimpleNamespace(joint_reflex=False, tau_j_range_violation=False)
        self.state = SimpleNamespace(
            robot_mode=SimpleNamespace(name="Idle"), time=SimpleNamespace(to_sec=lambda: 12.5),
            q=np.arange(7.0), dq=np.arange(7.0) / 10.0, tau_J=-np.arange(7.0),
            last_motion_errors=none, current_errors=none,
        )  # fmt: skip
        self.hand_state = SimpleNamespace(width=0.03, max_width=0.078)

    def called(self, name: str, *given: Any, **named: Any) -> Any:
        self.calls.append((name, *given, *named.items()))
        if name in self.broken:
            raise self.broken[name]
        return self.answers.get(name)

    def Robot(self, address: str, **named: Any) -> Any:
        self.called("Robot", address, **named)
        return Noting(self, "state")

    def Gripper(self, address: str) -> Any:
        self.called("Gripper", address)
        return Noting(self, "hand_state")

    def JointImpedanceTracker(self, robot: Any, stiffness: Any) -> Any:
        self.called("JointImpedanceTracker", tuple(stiffness))
        return Noting(self, "state")

    def TorqueStopMotion(self) -> str:
        return "stop"


class Noting:
    """One of its objects: attributes are calls that are noted, but for its state."""

    def __init__(self, franky: StandIn, state: str) -> None:
        self._franky, self._state = franky, state

    @property
    def state(self) -> Any:
        self._franky.called("state")
        return getattr(self._franky, self._state)

    @property
    def model(self) -> Any:
        return SimpleNamespace(mass=lambda state: np.diag(1.0 + state.q))

    @property
    def is_running(self) -> bool:
        return bool(self._franky.answers["is_running"])

    def __getattr__(self, name: str) -> Any:
        def call(*given: Any, **named: Any) -> Any:
            answer = self._franky.called(name, *given, **named)
            return self if name.endswith("_async") else answer

        return call


@pytest.fixture
def franky(monkeypatch: pytest.MonkeyPatch) -> StandIn:
    made = StandIn()
    monkeypatch.setitem(sys.modules, "franky", made)  # type: ignore[arg-type]
    return made


def test_an_arm_is_connected_with_thresholds_and_load_before_it_is_controlled(franky: StandIn) -> None:
    FrankyArm("10.0.0.2", ArmSettings(30.0, 20.0, 0.5, (0.0, 0.01, 0.1)))
    inertia = [5e-5, 0.0, 0.0, 0.0, 5e-5, 0.0, 0.0, 0.0, 5e-5]
    assert franky.calls[:2] == [
        ("Robot", "10.0.0.2", ("realtime_config", "enforce")),
        ("set_collision_behavior", 30.0, 20.0),
    ]
    name, mass, center, given = franky.calls[2]
    assert (name, mass, center) == ("set_load", 0.5, [0.0, 0.01, 0.1])
    np.testing.assert_allclose(given, inertia)


def test_no_load_is_set_where_there_is_none_and_a_simulator_needs_no_real_time(franky: StandIn) -> None:
    FrankyArm("h", ArmSettings(realtime=False))
    assert franky.calls == [("Robot", "h", ("realtime_config", "ignore")), ("set_collision_behavior", 40.0, 40.0)]


def test_an_arm_that_never_moved_is_closed(franky: StandIn) -> None:
    arm = FrankyArm("h", ArmSettings())
    arm.close()
    assert franky.calls[-1] == ("join_motion", 2.0) and "move" not in [call[0] for call in franky.calls]


@pytest.mark.parametrize("call", ["Robot", "set_collision_behavior", "set_load"])
def test_an_arm_that_cannot_be_connected(franky: StandIn, call: str) -> None:
    franky.broken[call] = RuntimeError("no route")
    with pytest.raises(ConnectionFailedError, match="the arm at h: no route"):
        FrankyArm("h", ArmSettings(load_mass=0.1))


def test_a_state_of_the_arm(franky: StandIn) -> None:
    state = FrankyArm("h", ArmSettings()).read()
    assert (state.time, state.fault) == (12.5, "")
    np.testing.assert_array_equal(state.positions, np.arange(7.0))
    np.testing.assert_array_equal(state.velocities, np.arange(7.0) / 10.0)
    np.testing.assert_array_equal(state.efforts, -np.arange(7.0))


@pytest.mark.parametrize(
    ("mode", "words"),
    [
        ("UserStopped", "the user stop is pressed: release it"),
        ("Guiding", "guided by hand"),
        ("Reflex", "stopped by reflex"),
        ("AutomaticErrorRecovery", "is recovering from an error: wait"),
        ("Move", ""),
    ],
)
def test_a_mode_in_which_the_arm_does_not_move(franky: StandIn, mode: str, words: str) -> None:
    franky.state.robot_mode.name = mode
    fault = FrankyArm("h", ArmSettings()).read().fault
    assert words in fault and bool(fault) == bool(words) and "(" not in fault


def test_the_errors_of_the_last_motion_come_before_present_ones(franky: StandIn) -> None:
    franky.state.robot_mode.name = "Reflex"
    franky.state.current_errors = SimpleNamespace(power_limit_violation=True)
    arm = FrankyArm("h", ArmSettings())
    assert arm.read().fault.endswith("(power_limit_violation)")
    franky.state.last_motion_errors = SimpleNamespace(joint_reflex=True, cartesian_reflex=True)
    assert arm.read().fault.endswith("(cartesian_reflex, joint_reflex)")


def test_an_arm_that_is_lost(franky: StandIn) -> None:
    arm = FrankyArm("h", ArmSettings())
    franky.broken["state"] = franky.Exception("timeout")
    with pytest.raises(ConnectionFailedError, match=r"the arm at h was lost \(timeout\)"):
        arm.read()


def test_a_motion_from_taking_control_to_letting_go(franky: StandIn) -> None:
    arm = FrankyArm("h", ArmSettings(stiffness=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)))
    franky.broken["poll_motion"] = franky.Exception("how the last one ended")
    del franky.calls[:]
    arm.begin()
    assert franky.calls == [("poll_motion",), ("JointImpedanceTracker", (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0))]
    arm.read()
    arm.follow(np.full(7, 0.1), np.full(7, 0.2), np.full(7, 0.5))
    name, positions, (word, velocities), (force, torques) = franky.calls[-1]
    assert (name, word, positions[0], velocities[0]) == ("set_target", "dq", 0.1, 0.2)
    assert force == "tau_ff"
    np.testing.assert_allclose(torques, 0.5 * (1.0 + np.arange(7.0)))
    arm.end()
    assert franky.calls[-1] == ("move", "stop", ("asynchronous", True))
    del franky.calls[:]
    arm.end()  # a second time there is nothing to end
    assert franky.calls == []
    franky.broken["join_motion"] = RuntimeError("it had stopped")
    arm.close()
    assert franky.calls == [("join_motion", 2.0)]


def test_control_that_has_ended_is_not_ended_again(franky: StandIn) -> None:
    arm = FrankyArm("h", ArmSettings())
    arm.begin()
    franky.answers["is_running"] = False
    arm.end()
    assert franky.calls[-1][0] == "JointImpedanceTracker"


def test_an_arm_that_ends_its_control(franky: StandIn) -> None:
    arm = FrankyArm("h", ArmSettings())
    franky.broken["JointImpedanceTracker"] = RuntimeError("libfranka: not now")
    with pytest.raises(ArmFaultError, match="the arm stopped by itself: not now; look"):
        arm.begin()
    franky.broken.clear()
    arm.begin()
    franky.answers["is_running"] = False
    with pytest.raises(ArmFaultError, match="ended its control without a word: call ~/recover_errors"):
        arm.follow(np.zeros(7), np.zeros(7), np.zeros(7))
    franky.broken["poll_motion"] = franky.Exception("cartesian_reflex")
    with pytest.raises(ArmFaultError, match="stopped by itself: cartesian_reflex"):
        arm.follow(np.zeros(7), np.zeros(7), np.zeros(7))


def test_errors_are_cleared_or_stay(franky: StandIn, monkeypatch: pytest.MonkeyPatch) -> None:
    arm = FrankyArm("h", ArmSettings())
    arm.begin()
    arm.recover()
    assert franky.calls[-1] == ("recover_from_errors",)
    arm.end()  # the control ended with the error
    assert franky.calls[-1] == ("recover_from_errors",)
    franky.answers["recover_from_errors"] = False  # a state of before still says so
    arm.recover()
    franky.state.robot_mode.name = "Reflex"
    monkeypatch.setattr(franky_ports, "CLEARED_S", 0.05)
    with pytest.raises(ArmFaultError, match="the arm keeps its errors: look at the lights"):
        arm.recover()
    franky.broken["recover_from_errors"] = RuntimeError("locked")
    with pytest.raises(ArmFaultError, match="the errors stay: locked"):
        arm.recover()


def test_a_hand(franky: StandIn) -> None:
    hand = FrankyHand("10.0.0.2")
    state = hand.read()
    assert (franky.calls[0], state.width, state.max_width) == (("Gripper", "10.0.0.2"), 0.03, 0.078)
    assert hand.move(0.05, 0.1).wait(3.0)
    assert franky.calls[-2:] == [("move_async", 0.05, 0.1), ("wait", 3.0)]
    assert hand.grasp(0.0, 0.1, 20.0, None).succeeded()
    assert ("grasp_async", 0.0, 0.1, 20.0, 0.078, 0.078) in franky.calls
    hand.grasp(0.1, 0.1, 20.0, (0.1, 0.01))
    assert ("grasp_async", 0.1, 0.1, 20.0, 0.1, 0.01) in franky.calls
    franky.answers.update(get=False, wait=False)
    homing = hand.home()
    assert franky.calls[-1] == ("homing_async",) and not homing.wait(0.1) and not homing.succeeded()
    hand.stop()
    assert franky.calls[-1] == ("stop",)


def test_a_hand_that_fails(franky: StandIn) -> None:
    franky.broken["Gripper"] = RuntimeError("refused")
    with pytest.raises(ConnectionFailedError, match="the hand at h: refused"):
        FrankyHand("h")
    franky.broken.clear()
    hand = FrankyHand("h")
    franky.broken.update(state=RuntimeError("cut"), stop=RuntimeError("busy"), get=franky.Exception("jammed"))
    with pytest.raises(ConnectionFailedError, match=r"the hand at h was lost \(cut\)"):
        hand.read()
    with pytest.raises(HandFaultError, match="the hand does not stop: busy"):
        hand.stop()
    with pytest.raises(HandFaultError, match="the hand failed: jammed"):
        hand.move(0.01, 0.1).succeeded()


def test_franky_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "franky", None)
    with pytest.raises(DriverError, match="franky is not installed: run 'make setup"):
        load_franky()
