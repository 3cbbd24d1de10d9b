"""A franky-sim server with a free block on the table, a log of every tick, and faults on request, as a process.

    python tests/franky_table_server.py --block 0.45 0.1 --log ticks.bin

It prints its address, then runs until it is killed. Each line on its standard input is a request: a fault's name
(reflex, exception, user_stop, drop, cut, hand_gone), what ends one (clear, release, hand_back), `mark`, which is
counted in the log, `between W`, a width [m] below which something between the fingers stops them, or `where`, which
is answered by the block's pose.
"""

from __future__ import annotations

import argparse
import queue
import random
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from franky_sim import FrankaRobotServer, SimulationServer, franka_server
from franky_sim.franka_robot_protocol import (
    AutomaticErrorRecoveryCommand,
    AutomaticErrorRecoveryStatus,
    BaseCommand,
    MoveCommand,
    MoveStatus,
    RobotCommand,
    RobotMode,
)
from franky_sim.mujoco_simulator import MujocoSimulator
from numpy.typing import NDArray

from panda_model import load_preset

_JOINTS = tuple(f"{kind}{joint}" for kind in ("q", "dq", "tau") for joint in range(7))
COLUMNS = ("time", "mode", "mark", *_JOINTS, "width", "x", "y", "z")
BLOCK_SIZE = 0.04  # [m]
_LOST = 0.1  # share of the packets that `drop` loses, either way
_CUT = 40  # ticks for which `cut` loses all of them: libfranka itself gives up after a second
_MOST_LOST = 20  # commands in a row, after which a real arm ends the motion
_FLAGS = 41
_REASONS = {"reflex": 7, "exception": 25}  # places in libfranka's list of errors: cartesian_reflex, communication


class FaultyArm(FrankaRobotServer):  # type: ignore[misc]
    """The server of one arm, with the real one's modes after a fault."""

    mode: RobotMode | None = None
    reason = -1
    dropping = False
    watches = False
    cut = 0
    marks = 0
    missed = 0
    last_state: Any = None
    hand_gone = False

    @property
    def robot_state(self) -> Any:
        """The state, in the fault's mode."""
        state = super().robot_state
        if self.mode is not None:
            flags = tuple(place == self.reason for place in range(_FLAGS))
            state = state.replace(robot_mode=self.mode, errors=flags, reflex_reason=flags)
        self.last_state = state
        return state

    def fail(self, mode: RobotMode, status: MoveStatus, reason: int = -1) -> None:
        """End the motion as a real arm does."""
        motion = self.current_motion_id
        if motion:
            BaseCommand.send_response(self._tcp_socket, RobotCommand.kMove, motion, status)
        self.stop_motion(send_preemption_signal=False)
        self.reset_current_motion_id()
        self.mode, self.reason = mode, reason

    def request(self, what: str) -> None:
        """Do what a line of standard input asks for."""
        if what in _REASONS:
            self.fail(RobotMode.kReflex, MoveStatus.kReflexAborted, _REASONS[what])
        elif what == "mark":
            self.marks += 1
        elif what == "cut":
            self.cut, self.watches, self.missed = _CUT, True, 0
        elif what == "hand_gone":
            self.gripper_server.cleanup()
            self.gripper_server.reset_state()
            self.hand_gone = True
        elif what == "hand_back":
            self.gripper_server.init()
            self.hand_gone = False
        elif what == "user_stop":
            self.fail(RobotMode.kUserStopped, MoveStatus.kPreemptedDueToActivatedSafetyFunctions)
        elif what == "release":
            self.mode = None
        elif what == "drop":
            self.dropping = True
        elif what == "clear":
            self.mode, self.dropping, self.watches = None, False, False

    def process_commands(self) -> None:
        """Take the clients' commands: the arm's alone where the hand is gone."""
        if self.hand_gone:
            super(FrankaRobotServer, self).process_commands()
        else:
            super().process_commands()

    def send_state(self) -> None:
        """Send the states, unless they are lost."""
        self.cut = max(self.cut - 1, 0)
        if self._is_lost():
            return
        if self.hand_gone:
            super(FrankaRobotServer, self).send_state()
        else:
            super().send_state()

    def _is_lost(self) -> bool:
        return self.cut > 0 or (self.dropping and random.random() < _LOST)

    def _handle_udp_command(self, command_data: bytes) -> None:
        if not self._is_lost():
            self.missed = 0
            super()._handle_udp_command(command_data)

    def _post_process_commands(self) -> None:
        super()._post_process_commands()
        self.missed += 1
        if self.watches and self.current_motion_id and self.missed > _MOST_LOST:
            self.fail(RobotMode.kReflex, MoveStatus.kReflexAborted, _REASONS["exception"])


def _recover(command: AutomaticErrorRecoveryCommand, server: FaultyArm) -> None:
    if server.mode is RobotMode.kUserStopped:
        command.reply(AutomaticErrorRecoveryStatus.kCommandRejectedDueToActivatedSafetyFunctions)
        return
    server.mode = None
    command.reply(AutomaticErrorRecoveryStatus.kSuccess)


def _move_unless_stopped(command: MoveCommand, server: FaultyArm) -> None:
    if server.mode is not None:
        command.reply(MoveStatus.kCommandRejectedDueToActivatedSafetyFunctions)
        return
    _MOVE(command, server)


_MOVE = MoveCommand.handle


class StoppedHand:
    """Fingers of a simulated arm that something outside of its simulation stops."""

    def __init__(self, robot: Any) -> None:
        self._set, self._asked = robot.set_hand_goal, (robot.hand_width, 0.1, 70.0)
        self._least = 0.0
        robot.set_hand_goal = self._goal

    def stop_at(self, width: float) -> None:
        """Let the fingers come no nearer than a full width [m]."""
        self._least = width
        self._goal(*self._asked)

    def _goal(self, width: float, velocity: float, force: float) -> None:
        self._asked = (width, velocity, force)
        self._set(max(width, self._least), velocity, force)


class TableServer(SimulationServer):  # type: ignore[misc]
    """The simulation with its one arm, the block and the log."""

    def __init__(self, simulator: MujocoSimulator, log: Path | None) -> None:
        super().__init__(simulator)
        self._log = log.open("wb") if log is not None else None
        self.requests: queue.Queue[str] = queue.Queue()
        self._ticks = 0

    def init(self) -> None:
        """Bind the arm's server, and begin."""
        arm = FaultyArm(self.sim.robots[0], self._remaining_hostname_candidates)
        arm.init()
        self.robot_servers.append(arm)
        self.sim.start()
        self._block = self.sim.model.joint("block").qposadr[0]
        self._hand = StoppedHand(self.sim.robots[0])

    def run_once(self, realtime: bool | float = True) -> None:
        """Take requests, do one tick, and log it."""
        while not self.requests.empty():
            what = self.requests.get()
            if what == "where":
                print("block " + " ".join(f"{value:.5f}" for value in self._place()), flush=True)
            elif what.startswith("between "):
                self._hand.stop_at(float(what.split()[1]))
            else:
                self.robot_servers[0].request(what)
        super().run_once(realtime)
        self._ticks += 1
        if self._log is not None and self.robot_servers[0].last_state is not None:
            self._log.write(self._row().tobytes())
            if self._ticks % 100 == 0:
                self._log.flush()

    def _place(self) -> NDArray[np.float64]:
        return np.array(self.sim.data.qpos[self._block : self._block + 7])

    def _row(self) -> NDArray[np.float64]:
        state = self.robot_servers[0].last_state
        width = self.sim.robots[0].hand_width
        marks = self.robot_servers[0].marks
        head = (1e-3 * self._ticks, float(state.robot_mode), marks, *state.q, *state.dq, *state.tau_J_d, width)
        return np.array([*head, *self._place()[:3]])


def read_log(path: Path) -> dict[str, NDArray[np.float64]]:
    """Return the columns of a log; the last row may be torn."""
    values = np.fromfile(path)
    rows = values[: len(values) // len(COLUMNS) * len(COLUMNS)].reshape(-1, len(COLUMNS))
    return {name: rows[:, place] for place, name in enumerate(COLUMNS)}


def main() -> None:
    """Serve until the standard input ends."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--block", type=float, nargs=2, default=(0.45, 0.1), metavar=("X", "Y"))
    parser.add_argument("--log", type=Path)
    parser.add_argument("--pace", type=float, default=1.0, help="times real time, where the machine keeps up")
    parser.add_argument("--unhomed", action="store_true", help="the hand does not know its range yet")
    parser.add_argument("--old-version", action="store_true", help="answer as another version of the protocol does")
    options = parser.parse_args()
    AutomaticErrorRecoveryCommand.handle, MoveCommand.handle = _recover, _move_unless_stopped
    if options.old_version:
        franka_server.ConnectStatus.kSuccess._value_ = franka_server.ConnectStatus.kIncompatibleLibraryVersion.value
    with MujocoSimulator() as simulator:
        robot = simulator.add_robot(initial_q=load_preset("fr3").ready.tolist(), initial_hand_width=0.08)
        half = BLOCK_SIZE / 2.0
        x, y = options.block
        block = ElementTree.SubElement(simulator.worldbody, "body", name="block", pos=f"{x} {y} {half}")
        ElementTree.SubElement(block, "freejoint", name="block")
        solid = {"size": f"{half} {half} {half}", "mass": "0.05", "friction": "1.5 0.02 0.001", "condim": "4"}
        ElementTree.SubElement(block, "geom", type="box", **solid)
        with TableServer(simulator, options.log) as server:
            if options.unhomed:
                server.robot_servers[0].gripper_server._max_width = 0.0
            server.run_async(1.0 / options.pace)
            print(f"address {robot.hostname}", flush=True)
            for line in sys.stdin:
                server.requests.put(line.strip())


if __name__ == "__main__":
    main()
