"""What one step of the simulation's loop reads, commands and tells, and what hangs on it: states, faults, a log."""

from __future__ import annotations

import json
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from played_faults import played_faults

from cliport_core.pose import Pose
from sim_bridge.control.gripper_controller import HandFault
from sim_bridge.control.trajectory_goal import TrajectoryGoal, TrajectoryPoint
from sim_bridge.control.trajectory_log import TrajectoryLog, TrajectoryLogError
from sim_bridge.errors import SimBridgeError
from sim_bridge.node_faults import FaultInjection
from sim_bridge.node_parameters import SimParameters
from sim_bridge.node_state import StatePublisher
from sim_bridge.panda import ArmState
from sim_bridge.sim_loop import SimLoop
from sim_bridge.world_snapshot import WorldSnapshot


class World:
    """A world of steps of 0.25 s, and controllers that command what shows who asked; `told` has it in order."""

    def __init__(self) -> None:
        self.time, self.told = 0.0, list[Any]()
        self.panda = SimpleNamespace(
            state=lambda: f"state at {self.time}",
            command=lambda *given: self.told.append(("arm", *given)),
            command_fingers=lambda *given: self.told.append(("fingers", *given)),
        )

    def step(self) -> None:
        self.told.append("step")
        self.time += 0.25

    def controller(self, **command: Any) -> Any:
        def update(now: float, state: str) -> SimpleNamespace:
            self.told.append((now, state))
            return SimpleNamespace(**command)

        return SimpleNamespace(update=update, reset=lambda why: self.told.append(why))


def loop_of(world: World, pacer: Any = None, **given: Any) -> SimLoop:
    arm = world.controller(positions="q", velocities="v")
    hand = world.controller(width=0.04, max_effort=20.0)
    return SimLoop(world, arm, hand, pacer, **given)  # type: ignore[arg-type]


def test_a_step_reads_commands_tells_and_steps() -> None:
    world = World()
    loop = loop_of(world)
    assert loop.world is world
    loop.every(0.25, lambda time, state: world.told.append(("heard", time, state)))
    loop._tick()
    read = (0.0, "state at 0.0")
    assert world.told == [read, read, ("arm", "q", "v"), ("fingers", 0.04, 20.0), ("heard", *read), "step"]


def test_listeners_are_told_at_their_periods_and_what_is_late_is_not_made_up_for() -> None:
    world, heard = World(), list[float]()
    loop = loop_of(world)
    loop.every(0.75, lambda time, _: heard.append(time))
    for _ in range(8):
        loop._tick()
    assert heard == [0.0, 0.75, 1.5]
    world.time = 10.0
    for _ in range(4):
        loop._tick()
    assert heard[3:] == [10.0, 10.75]


def test_a_loop_makes_the_steps_that_are_due_and_tells_the_controllers_of_its_end() -> None:
    world, done = World(), threading.Event()
    due = iter([2, 0, 1])
    pacer = SimpleNamespace(due=lambda now: next(due, None) or (done.set() or 0), delay=lambda now: 0.0)
    loop = loop_of(world, pacer)
    loop.start()
    assert done.wait(60.0)
    assert loop.call(lambda: loop.call(lambda: threading.current_thread().name)) == "physics"
    with pytest.raises(ValueError, match="of the call"):
        loop.call(lambda: int("of the call"))
    loop.stop()
    loop._thread.join(60.0)
    assert world.told[-2:] == ["the simulation has stopped"] * 2 and world.told.count("step") == 3


def test_while_time_is_held_no_step_is_made_and_calls_are_served() -> None:
    world, held = World(), threading.Event()
    loop = loop_of(world, SimpleNamespace(due=lambda now: 3, delay=lambda now: 0.0))
    loop.hold_while(lambda: held.is_set() or world.time >= 0.5)
    loop.start()
    assert reaches(world, 0.5)
    stood = [loop.call(lambda: world.time) for _ in range(5)]
    assert stood == [0.5] * 5, "the third of the steps that were due is not made"
    held.set()
    world.time = 0.0
    assert loop.call(lambda: world.told.count("step")) == 2
    held.clear()
    assert reaches(world, 0.5)
    loop.stop()


def reaches(world: World, at: float) -> bool:
    """Wait until the world's time is at least that [s]; return False if it is not after 30 s."""
    deadline = time.monotonic() + 30.0
    while world.time < at and time.monotonic() < deadline:
        time.sleep(0.002)
    return world.time >= at


def test_a_failed_step_ends_the_loop_and_is_told() -> None:
    world, failures = World(), list[BaseException]()
    error = RuntimeError("flew apart")

    def due(now: float) -> int:
        raise error

    loop = loop_of(world, SimpleNamespace(due=due), on_failure=failures.append)
    loop.start()
    loop._thread.join(60.0)
    assert failures == [error] and world.told == ["the simulation has stopped"] * 2


@pytest.mark.parametrize("done", [True, False])
def test_the_end_of_a_motion_is_awaited_for_so_long(done: bool) -> None:
    assert loop_of(World()).wait(SimpleNamespace(done=done), 0.02) is done


def test_joints_and_clock_are_said_with_their_time() -> None:
    said: dict[str, list[Any]] = {}
    calls: dict[str, Any] = {}
    node: Any = SimpleNamespace(
        create_publisher=lambda kind, topic, qos: SimpleNamespace(publish=said.setdefault(topic, []).append)
    )
    hand = SimpleNamespace(fault=HandFault.NONE)
    loop: Any = SimpleNamespace(every=lambda period, call: calls.update({call.__name__: call}), gripper=hand)
    camera: Any = SimpleNamespace(camera_in_base=Pose.from_xyz_rpy((0.4, 0.1, 1.0), (0.0, 0.0, 0.0)))
    parameters = SimParameters()
    StatePublisher(node, loop, camera, parameters, played_faults())
    places, speeds, efforts = np.arange(7.0), np.arange(10.0, 17.0), np.arange(20.0, 27.0)
    state = ArmState(places, speeds, efforts, np.array([0.01, 0.02]), np.array([0.3, 0.4]))
    for call in calls.values():
        call(3.5, state)
    (clock,), (joints,), (static,) = said["/clock"], said["/joint_states"], said["/tf_static"]
    assert (clock.clock.sec, clock.clock.nanosec) == (joints.header.stamp.sec, joints.header.stamp.nanosec) == (3, 5e8)
    assert list(joints.name) == list(parameters.arm.joints) and len(joints.name) == 9
    assert list(joints.position) == [*range(7), 0.01, 0.02] and list(joints.velocity) == [*range(10, 17), 0.3, 0.4]
    assert list(joints.effort) == [*range(20, 27), 0.0, 0.0]
    (transform,) = static.transforms
    assert (transform.header.frame_id, transform.child_frame_id) == (parameters.base_frame, parameters.camera_frame)
    place = transform.transform.translation
    assert (place.x, place.y, place.z, transform.header.stamp.sec) == (0.4, 0.1, 1.0, 0)
    hand.fault = HandFault.LOST
    calls["_publish_joints"](3.6, state)
    lost = said["/joint_states"][-1]
    assert list(lost.name) == list(parameters.arm.arm_joints) and len(lost.position) == len(lost.effort) == 7


def test_a_bumped_camera_is_turned_about_itself_and_shifted_and_other_numbers_are_refused() -> None:
    hooks: list[Any] = []
    node: Any = SimpleNamespace(
        declare_parameter=lambda name, value, descriptor: SimpleNamespace(value=value),
        add_on_set_parameters_callback=hooks.append,
    )
    faults = FaultInjection(node, SimpleNamespace(every=lambda *given: None))  # type: ignore[arg-type]
    told = Pose.from_xyz_rpy((0.4, 0.1, 1.0), (2.0, 0.3, 0.1))
    assert faults.true_pose(told).as_matrix().tobytes() == told.as_matrix().tobytes(), "recorded scores depend on it"
    given = SimpleNamespace(name="bump_camera", value=[0.01, 0.0, -0.02, 0.0, 0.0, 0.5])
    assert hooks[0]([given]).successful
    true = faults.true_pose(told)
    np.testing.assert_allclose(true.translation, (0.41, 0.1, 0.98))
    turned = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (0.0, 0.0, 0.5)).rotation @ told.rotation
    np.testing.assert_allclose(true.rotation, turned, atol=1e-12)
    for value in ([0.0] * 5, [0.0, 0.0, float("nan"), 0.0, 0.0, 0.0]):
        answer = hooks[0]([SimpleNamespace(name="bump_camera", value=value)])
        assert not answer.successful and answer.reason.startswith("bump_camera must be six finite numbers, got [0.0, ")
    assert faults.true_pose(told).is_close(true)
    node.declare_parameter = lambda name, value, descriptor: SimpleNamespace(
        value=[1.0] if name == "bump_camera" else value
    )
    with pytest.raises(SimBridgeError, match=r"bump_camera must be six finite numbers, got \[1.0\]"):
        FaultInjection(node, SimpleNamespace(every=lambda *given: None))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("switch", "published"),
    [("", [(3, 0.0), (4, 1.0)]), ("lost", []), ("old", [(2, 0.0), (3, 1.0)]), ("ahead", [(4, 0.0), (5, 1.0)]),
     ("restamped", [(3, 0.0), (4, 0.0)])],
)  # fmt: skip
def test_joint_states_are_spoiled_and_the_true_ones_told_meanwhile(
    switch: str, published: list[tuple[int, float]]
) -> None:
    said: dict[str, list[Any]] = {}
    calls: dict[str, Any] = {}
    node: Any = SimpleNamespace(
        create_publisher=lambda kind, topic, qos: SimpleNamespace(publish=said.setdefault(topic, []).append)
    )
    loop: Any = SimpleNamespace(
        every=lambda period, call: calls.update({call.__name__: call}), gripper=SimpleNamespace(fault=HandFault.NONE)
    )
    camera: Any = SimpleNamespace(camera_in_base=Pose.from_xyz_rpy((0.4, 0.1, 1.0), (0.0, 0.0, 0.0)))
    StatePublisher(node, loop, camera, SimParameters(), played_faults(f"joint_states_{switch}"))
    for number in range(2):
        state = ArmState(np.full(7, float(number)), np.zeros(7), np.zeros(7), np.zeros(2), np.zeros(2))
        calls["_publish_joints"](3.0 + number, state)
    told = {topic: [(m.header.stamp.sec, m.position[0]) for m in said[topic]] for topic in
            ("/joint_states", "/sim_bridge/true_joint_states")}  # fmt: skip
    assert told["/joint_states"] == published
    assert told["/sim_bridge/true_joint_states"] == ([(3, 0.0), (4, 1.0)] if switch else [])


def test_a_clock_that_jumps_takes_the_stamps_of_joint_states_with_it() -> None:
    said: dict[str, list[Any]] = {}
    calls: dict[str, Any] = {}
    node: Any = SimpleNamespace(
        create_publisher=lambda kind, topic, qos: SimpleNamespace(publish=said.setdefault(topic, []).append)
    )
    loop: Any = SimpleNamespace(
        every=lambda period, call: calls.update({call.__name__: call}), gripper=SimpleNamespace(fault=HandFault.NONE)
    )
    camera: Any = SimpleNamespace(camera_in_base=Pose.from_xyz_rpy((0.4, 0.1, 1.0), (0.0, 0.0, 0.0)))
    faults = played_faults()
    StatePublisher(node, loop, camera, SimParameters(), faults)
    state = ArmState(np.zeros(7), np.zeros(7), np.zeros(7), np.zeros(2), np.zeros(2))
    for shift, seconds in ((0.0, 30), (10.0, 40), (-10.0, 20), (-40.0, 0)):
        faults.clock_shift = shift
        for call in calls.values():
            call(30.0, state)
        assert said["/clock"][-1].clock.sec == said["/joint_states"][-1].header.stamp.sec == seconds


def test_a_goal_that_is_to_be_missed_has_a_tolerance_that_no_arm_keeps() -> None:
    hooks: list[Any] = []
    node: Any = SimpleNamespace(
        declare_parameter=lambda name, value, descriptor: SimpleNamespace(value=value),
        add_on_set_parameters_callback=hooks.append,
    )
    loop: Any = SimpleNamespace(every=lambda *given: None)
    faults = FaultInjection(node, loop)
    goal = TrajectoryGoal(("a", "b"), (TrajectoryPoint(1.5, (0.1, 0.2), (), ()),))
    assert faults.adapted(goal) is goal
    hooks[0]([SimpleNamespace(name="miss_goal", value=True)])
    adapted = faults.adapted(goal)
    assert adapted.points == goal.points and 0.0 < adapted.goal_time_tolerance < 1.0
    assert {name: tolerance.position for name, tolerance in adapted.goal_tolerance.items()} == {"a": 1e-7, "b": 1e-7}


def test_one_trajectory_is_aborted_on_its_way_and_the_next_is_not() -> None:
    held: list[str] = []
    ticks: list[Any] = []
    hooks: list[Any] = []
    node: Any = SimpleNamespace(
        declare_parameter=lambda name, value, descriptor: SimpleNamespace(value=value),
        add_on_set_parameters_callback=hooks.append,
        set_parameters=lambda given: hooks[0](given),
    )
    loop: Any = SimpleNamespace(
        every=lambda *given: ticks.append(given), arm=SimpleNamespace(hold=lambda why: held.append(why)),
        gripper=SimpleNamespace(jammed_for=None),
    )  # fmt: skip
    faults = FaultInjection(node, loop)
    ((period, tick),) = ticks
    assert (period, faults.camera_frozen, faults.depth_lost) == (0.02, False, False)
    for name in ("freeze_camera", "unknown"):
        assert hooks[0]([SimpleNamespace(name=name, value=True)]).successful
    assert (faults.camera_frozen, faults.depth_lost) == (True, False)
    hooks[0]([SimpleNamespace(name="abort_next_trajectory", value=True)])
    for start, done in ((1.0, False), (5.0, False)):
        faults.started(SimpleNamespace(done=done), start)  # type: ignore[arg-type]
        tick(start + 0.29, None)
        assert len(held) == (start > 1.0)
        tick(start + 0.31, None)
        tick(start + 0.5, None)
    assert held == ["the controller aborted the motion (injected fault)"]
    hooks[0]([SimpleNamespace(name="abort_next_trajectory", value=True)])
    faults.started(SimpleNamespace(done=True), 9.0)  # type: ignore[arg-type]
    tick(9.5, None)
    assert len(held) == 1


def test_the_log_has_a_line_for_each_trajectory_and_begins_empty(tmp_path: Path) -> None:
    goal = TrajectoryGoal(("a", "b"), (TrajectoryPoint(1.5, (0.1, 0.2), (), ()),))
    path = tmp_path / "log"
    log = TrajectoryLog(str(path))
    assert path.read_text() == ""
    log.append(goal, 2.0)
    log.append(goal, 3.0)
    line = {"joint_names": ["a", "b"], "times": [1.5], "positions": [[0.1, 0.2]]}
    line |= {"velocities": [[]], "accelerations": [[]]}
    assert [json.loads(text) for text in path.read_text().splitlines()] == [{"time": t} | line for t in (2.0, 3.0)]
    TrajectoryLog("").append(goal, 2.0)
    with pytest.raises(TrajectoryLogError, match=r"/none/log: No such file or directory; name a file that can be"):
        TrajectoryLog(str(tmp_path / "none" / "log"))


def test_a_snapshot_keeps_what_moves_on() -> None:
    poses: dict[Any, Any] = {"block": "there", -1: "base", 4: "hand"}
    panda = SimpleNamespace(link_indices={"hand": 4}, link_pose=lambda link: poses[link])
    world: Any = SimpleNamespace(time=2.5, objects=["block"], panda=panda, object_pose=lambda thing: poses[thing])
    kept: Any = WorldSnapshot(world)
    poses.update({"block": "gone", -1: "moved", 4: "moved"})
    assert (kept.time, kept.objects, kept.object_pose("block")) == (2.5, ["block"], "there")
    assert (kept.panda.link_indices, kept.panda.link_pose(-1), kept.panda.link_pose(4)) == ({"hand": 4}, "base", "hand")
