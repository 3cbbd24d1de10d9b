"""Cycles of pick and place with the arm behind its own protocol: does it stay within what a real one allows?

CYCLES (200) of them on franky-sim, whose server is told by a test's launcher to log every tick: the executor and the
driver as they are, a block of 4 cm carried to and fro. The figures go to out/franky_cycles.json.
"""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("franky", reason="needs franky: make setup EXTRAS='all driver'")
pytest.importorskip("franky_sim", reason="needs franky-sim: make setup EXTRAS='all driver'")

from franky_bench import FR3, PATIENT, STIFFNESS, ArmUser, Processes, TableArm
from franky_table_server import read_log
from hardware_times import ROOT
from numpy.typing import NDArray
from ros_domain import next_domain

from cliport_interfaces.action import PickPlace
from panda_executor.model import PandaModel

CYCLES = int(os.environ.get("CYCLES", "200"))
PACE = os.environ.get("PACE", "1.0")  # of the simulated arm, times real time
OUT = ROOT / "out" / "franky_cycles.json"
MOST_SECONDS = float(os.environ.get("MOST_SECONDS", "inf"))  # after which no further cycle is begun
PLACES = ((0.45, 0.12), (0.45, -0.12))  # between which the block goes [m]
MOVING = 2.0  # the robot's mode Move
PATH_ERROR = 0.002  # of the TCP from the commanded path [m]
TORQUE_RATE = 1000.0  # that a real arm takes without an error [N m/s], libfranka's rate_limiting
PLACE_ERROR = 0.01  # of the block from where it should be [m]
SPAN = 0.01  # over which accelerations are measured [s]

pytestmark = [pytest.mark.soak, pytest.mark.timeout(12 * 3600)]


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[tuple[Processes, TableArm, ArmUser]]:
    domain = next_domain()
    processes = Processes(tmp_path, domain)
    x, y = PLACES[0]
    arm = TableArm(processes, "--block", str(x), str(y), "--pace", PACE, "--log", str(tmp_path / "ticks.bin"))
    driver = {"robot_ip": arm.address, "arm": "fr3", "realtime": False, "publish_clock": True, "use_sim_time": True}
    processes.node("driver", "panda_driver.node", heartbeat_timeout=5.0, stiffness=STIFFNESS, **driver)
    user = ArmUser(domain)
    user.wait(lambda: bool(user.joints), 60.0)
    executor = {"robot": "fr3", "use_sim_time": True, "auto_approve": True, "guard_silence": 0.0, **PATIENT}
    processes.node("executor", "panda_executor.main", **executor)
    assert user.pick_place.wait_for_server(60.0)
    yield processes, arm, user
    user.close()
    processes.close()


def test_cycles_stay_within_what_the_arm_allows(bench: tuple[Processes, TableArm, ArmUser], tmp_path: Path) -> None:
    processes, arm, user = bench
    began, began_at, offs = time.monotonic(), user.joints[-1][1], list[NDArray[np.float64]]()
    for cycle in range(CYCLES):
        if time.monotonic() - began > MOST_SECONDS:
            break
        there = PLACES[(cycle + 1) % 2]
        block = arm.block()
        user.see(block)
        result = user.move_block(block, there)
        words = f"cycle {cycle}: {result.message}\n{processes.log('driver')[-2000:]}"
        assert result.outcome == PickPlace.Result.OUTCOME_SUCCEEDED, words
        offs.append(arm.block()[:2] - there)
    took, arm_took = time.monotonic() - began, user.joints[-1][1] - began_at
    processes.close()
    log = read_log(tmp_path / "ticks.bin")
    found = {"cycles": len(offs), "wall_s": took, "arm_s": arm_took, "real_time_factor": arm_took / took}
    found |= {**motion(log), **path_errors(user), **joint_states(user)}
    found |= placing(np.array(offs))
    OUT.parent.mkdir(exist_ok=True)
    OUT.write_text(json.dumps(found, indent=1))
    assert not found["reflexes"]
    assert found["speed_share"] <= 1.0 and found["acceleration_share"] <= 1.0, found
    assert found["torque_share"] <= 1.0 and found["torque_rate_share"] <= 1.0, found
    assert found["path_error_mm"] <= 1e3 * PATH_ERROR, found
    assert found["joint_state_hz"] >= 100.0, found
    assert found["place_error_mm"] <= 1e3 * PLACE_ERROR and abs(found["place_drift_mm"]) <= 1e3 * PLACE_ERROR, found


def columns(log: dict[str, NDArray[np.float64]], kind: str) -> NDArray[np.float64]:
    """Return the seven columns of a kind, (ticks, 7)."""
    return np.stack([log[f"{kind}{joint}"] for joint in range(7)], axis=1)


def motion(log: dict[str, NDArray[np.float64]]) -> dict[str, Any]:
    """Return the greatest speed, acceleration, torque and torque's rate, as shares of what the arm allows."""
    moving = log["mode"] == MOVING
    positions, speeds, torques = (columns(log, kind) for kind in ("q", "dq", "tau"))
    both = moving[1:] & moving[:-1] & (np.diff(log["time"]) < 0.0015)
    rates = np.abs(np.diff(torques, axis=0))[both] / 0.001
    ticks = round(SPAN / 0.001)
    changes = np.abs(speeds[ticks:] - speeds[:-ticks]) / SPAN
    throughout = moving[ticks:] & moving[:-ticks]
    jumps = np.abs(np.diff(positions, axis=0))[both] / 0.001
    return {
        "reflexes": int((log["mode"] > MOVING).sum()),
        "moving_ticks": int(moving.sum()),
        "speed_share": float(FR3.limits.velocity_ratio(positions[moving], speeds[moving]).max()),
        "jump_share": float((jumps / FR3.limits.velocity).max()),
        "acceleration_share": float((changes[throughout] / FR3.limits.acceleration).max()),
        "torque_share": float((np.abs(torques[moving]) / FR3.torque).max()),
        "torque_rate_share": float(rates.max() / TORQUE_RATE),
    }


def path_errors(user: ArmUser) -> dict[str, float]:
    """Return the TCP's greatest distance from the path that the driver's controller commanded."""
    model, worst = PandaModel(FR3), 0.0
    for pairs in list(user.followed.values()):
        if len(pairs) < 3:
            continue
        desired, actual = (
            np.array([model.tcp_arrays(np.array(pair[which]))[1] for pair in pairs]) for which in (0, 1)
        )  # fmt: skip
        worst = max(worst, *(off_polyline(point, desired) for point in actual))
    return {"path_error_mm": 1e3 * worst, "motions": float(len(user.followed))}


def off_polyline(point: NDArray[np.float64], line: NDArray[np.float64]) -> float:
    """Return the distance [m] of a point (3,) from a line through points (n, 3)."""
    starts, ways = line[:-1], np.diff(line, axis=0)
    shares = ((point - starts) * ways).sum(axis=1) / np.maximum((ways**2).sum(axis=1), 1e-12)
    nearest = starts + np.clip(shares, 0.0, 1.0)[:, None] * ways
    return float(np.linalg.norm(point - nearest, axis=1).min())


def joint_states(user: ArmUser) -> dict[str, float]:
    """Return rate and jitter of the joint states by their stamps, which are the arm's time."""
    gaps = np.diff([stamp for _, stamp, _ in user.joints])
    return {
        "joint_state_hz": float(len(gaps) / gaps.sum()),
        "joint_state_jitter_ms": 1e3 * float(gaps.std()),
        "joint_state_longest_ms": 1e3 * float(gaps.max()),
    }


def placing(offs: NDArray[np.float64]) -> dict[str, float]:
    """Return how far the block came down from where it should (n, 2) [m], at most, and what grew over the cycles."""
    far = np.linalg.norm(offs, axis=1)
    slope = np.polyfit(np.arange(len(far)), far, 1)[0] if len(far) > 1 else 0.0
    return {"place_error_mm": 1e3 * float(far.max()), "place_drift_mm": 1e3 * float(slope * len(far))}
