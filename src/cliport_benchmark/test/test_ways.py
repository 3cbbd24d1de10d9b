"""Motions, views and measurements that need no physics, worked out by hand."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cliport_benchmark import (
    arm_hand,
    kinematic_hand,
)
from cliport_benchmark.camera_messages import observation_messages
from cliport_benchmark.errors import OptionError
from cliport_benchmark.kinematic_drag import _moved, _progress
from cliport_benchmark.kinematic_hand import KinematicHand
from cliport_benchmark.observer import Observer, _border
from cliport_benchmark.own_setup import OwnSetup
from cliport_benchmark.stage_camera import StageCamera
from cliport_benchmark.variation import MountingErrors, Variation
from cliport_core import PickPlaceAction, PlanarPose, Pose, Primitive, WorkspaceSpec, topics
from cliport_episodes.bags import decode
from cliport_perception import CameraModel
from cliport_perception.camera_file import CameraCalibration
from panda_executor.config import AfterFailure
from sim_bridge.panda import ArmState
from sim_bridge.world import SimConfig

DT = 0.004  # [s]


@pytest.mark.parametrize(("length", "top"), [(0.3, 0.5), (0.02, 0.2)])
def test_a_drag_goes_from_rest_to_rest_with_bounded_speed(length: float, top: float) -> None:
    """2 m/s^2 up to 0.5 m/s: 6.25 cm each to get there and to stop, or half of a shorter way."""
    ramp = top / 2.0
    duration = 2 * ramp + (length - top * ramp) / top
    times = np.arange(0.0, duration, DT)
    *steps, last = list(_progress(length, DT))
    assert len(steps) == len(times) and last == (length, 0.0)
    for t, (gone, speed) in zip(times, steps, strict=True):
        left = duration - t
        expected = min(2.0 * t, top, 2.0 * left)
        assert speed == pytest.approx(expected, abs=1e-9)
        if t < ramp:
            assert gone == pytest.approx(t * t, abs=1e-9)
        elif left < ramp:
            assert gone == pytest.approx(length - left * left, abs=1e-9)
        else:
            assert gone == pytest.approx(ramp * ramp + top * (t - ramp), abs=1e-9)


def test_what_is_held_is_shifted_and_turned_about_itself() -> None:
    held = Pose.from_xyz_rpy((0.4, 0.1, 0.02), (0.0, 0.0, 0.5))
    moved = _moved(held, np.array([0.1, -0.2, 0.3]), 0.25)
    assert moved.is_close(Pose.from_xyz_rpy((0.5, -0.1, 0.32), (0.0, 0.0, 0.75)))


class Chance:
    """Draws what a test says, and notes how widely it was to be drawn."""

    def __init__(self, *drawn: Any) -> None:
        self.drawn, self.asked = list(drawn), list[tuple[float, float]]()

    def normal(self, mean: float, sigma: float, size: int = 1) -> Any:
        self.asked.append((mean, sigma))
        return self.drawn.pop(0)


def hand_over(
    monkeypatch: pytest.MonkeyPatch, thing: object, primitive: Primitive
) -> tuple[list[Any], Chance, PickPlaceAction]:
    """Return what a hand did to a thing at (0.42, 0.1), turned by 0.2, and what it drew."""
    done: list[Any] = []
    rng = Chance(np.array([0.001, -0.002]), 0.01)
    world = SimpleNamespace(
        object_pose=lambda _: Pose.from_xyz_rpy((0.42, 0.1, 0.02), (0.0, 0.0, 0.2)),
        settle=lambda: done.append("settled"),
    )
    monkeypatch.setattr(
        kinematic_hand, "object_at", lambda world, x, y, movable: (x, y, movable) == (0.4, 0.1, True) and thing
    )
    monkeypatch.setattr(kinematic_hand, "set_down", lambda world, thing, pose: done.append(pose))
    for name in ("sweep", "fold"):
        monkeypatch.setattr(kinematic_hand, name, lambda *given, name=name: done.append((name, *given[1:])))
    action = PickPlaceAction(PlanarPose(0.4, 0.1, 0.3), PlanarPose(0.5, -0.1, 0.3 + math.pi / 2 - 0.01), primitive)
    KinematicHand(world, rng).execute(action, None)  # type: ignore[arg-type]
    return done, rng, action


def test_a_hand_without_an_arm_turns_a_thing_about_the_pick(monkeypatch: pytest.MonkeyPatch) -> None:
    done, rng, _ = hand_over(monkeypatch, "thing", Primitive.PICK_PLACE)
    assert done[1:] == ["settled"]
    # the thing's middle, 2 cm ahead of the pick along x, is 2 cm beside the place along y
    assert done[0].is_close(Pose.from_xyz_rpy((0.501, -0.102 + 0.02, 0.02), (0.0, 0.0, 0.2 + math.pi / 2)), 1e-9)
    assert rng.asked == [(0.0, 0.001), (0.0, math.radians(0.5))]


@pytest.mark.parametrize("primitive", [Primitive.SWEEP, Primitive.FOLD])
def test_a_hand_without_an_arm_sweeps_and_folds(monkeypatch: pytest.MonkeyPatch, primitive: Primitive) -> None:
    done, rng, action = hand_over(monkeypatch, "thing", primitive)
    assert done == [(primitive.label, action.pick, action.place)] and rng.asked == []


def test_a_hand_that_meets_nothing_lets_the_world_settle(monkeypatch: pytest.MonkeyPatch) -> None:
    done, rng, _ = hand_over(monkeypatch, None, Primitive.PICK_PLACE)
    assert done == ["settled"] and len(rng.asked) == 2, "the same is drawn whatever lies there"


# the middle of the workspace from straight above, 1 m high: rows along -x, columns along -y
DOWN = Pose(np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]), np.array([0.45, 0.0, 1.0]))


@pytest.mark.parametrize(
    ("pose", "width", "height", "share"),
    [(DOWN, 1000, 1000, 1.0), (DOWN, 1000, 200, 0.5), (DOWN, 400, 1000, 0.5), (DOWN, 600, 800, 0.75)],
)
def test_the_share_of_the_workspace_that_a_camera_sees(pose: Pose, width: int, height: int, share: float) -> None:
    lens = CameraModel(width, height, 1000.0, 1000.0, width / 2, height / 2)
    assert OwnSetup(camera=CameraCalibration(lens, pose))._seen_share() == pytest.approx(share)


def test_a_camera_that_looks_away_or_sees_a_corner_is_refused() -> None:
    lens = CameraModel(100, 100, 1000.0, 1000.0, 50.0, 50.0)
    up = Pose(DOWN.rotation @ np.diag([1.0, -1.0, -1.0]), DOWN.translation)
    words = r"the camera at \[0.45, 0.0, 1.0\] m sees {} % of the workspace \(at least 50 % needed\)"
    for pose, percent in ((up, 0), (DOWN, 2)):
        with pytest.raises(OptionError, match=words.format(percent)):
            OwnSetup(camera=CameraCalibration(lens, pose))


def test_a_set_up_is_recorded_as_numbers() -> None:
    lens = CameraModel(1000, 800, 1000.0, 1001.0, 500.0, 400.0)
    settings = OwnSetup(camera=CameraCalibration(lens, DOWN)).settings()
    assert settings["workspace"] == WorkspaceSpec().to_dict()
    camera = settings["camera"]
    assert np.abs(camera.pop("camera_in_base_xyzw")) == pytest.approx([math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0])
    assert camera == {
        **{"width": 1000, "height": 800, "fx": 1000.0, "fy": 1001.0, "cx": 500.0, "cy": 400.0},
        "camera_in_base_xyz": [0.45, 0.0, 1.0],
    }


@pytest.mark.parametrize(
    ("aspects", "errors", "height", "border"),
    [
        (None, MountingErrors(), 1.0, 12),
        ("light", MountingErrors(0.1, 0.1), 1.0, 12),
        ("mounting", MountingErrors(0.0, 0.0), 1.0, 12),
        ("mounting", MountingErrors(0.002, 0.004), 1.0, 25),  # 4 x 1001 pixels x (4 mrad + 2 mm / 1 m) = 24.02
        ("mounting", MountingErrors(0.002, 0.004), 0.05, 97),  # as if it were 10 cm high: 96.1
    ],
)
def test_the_border_covers_four_sigmas_of_a_mounting_error(aspects, errors, height: float, border: int) -> None:
    lens = CameraModel(1000, 800, 1000.0, 1001.0, 500.0, 400.0)
    pose = Pose(DOWN.rotation, np.array([0.45, 0.0, height]))
    variation = Variation(Variation.parse(aspects).aspects, mounting=errors)
    assert _border(CameraCalibration(lens, pose), variation) == border


def test_an_observer_sees_what_the_set_up_says() -> None:
    lens = CameraModel(1000, 800, 1000.0, 1001.0, 500.0, 400.0)
    whole = Observer(SimConfig(), whole_image=True, camera=CameraCalibration(lens, DOWN))
    assert whole.camera.intrinsics == lens and whole.workspace == WorkspaceSpec()


def test_only_what_sees_the_workspace_is_rendered() -> None:
    lens = CameraModel(2000, 1600, 1000.0, 1001.0, 1000.0, 800.0)
    camera = CameraCalibration(lens, DOWN)
    whole, part = (Observer(SimConfig(), whole_image=whole, camera=camera).camera for whole in (True, False))
    assert whole._window.shape == (1600, 2000)
    # 0.4 m x 0.8 m at a height of 12 cm: 455 x 910 pixels, and 12 on each side
    assert part._window.shape == pytest.approx((455 + 24, 910 + 24), abs=2)


def test_the_stage_is_seen_from_the_cameras_side() -> None:
    model = StageCamera(320, 180, finer=2)._camera.config.intrinsics
    assert (model.width, model.height, model.fx, model.fy, model.cx) == (640, 360, 704.0, 704.0, 320.0)
    assert model.cy == 360 - 180, "the target is 9/32 of the width above the lower edge"


def test_pictures_are_received_40_ms_after_they_were_taken() -> None:
    numbers = np.arange(7.0)
    state = ArmState(numbers, 10.0 + numbers, 20.0 + numbers, np.array([7.0, 8.0]), np.array([17.0, 18.0]))
    frame = SimpleNamespace(color=np.zeros((4, 6, 3), np.uint8), depth=np.ones((4, 6), np.float32))
    lens = CameraModel(6, 4, 5.0, 5.0, 3.0, 2.0)
    messages = observation_messages(frame, lens, DOWN, state, 7)  # type: ignore[arg-type]
    stamps = {m.topic: m.stamp_ns for m in messages}
    assert stamps[topics.COLOR] == stamps[topics.DEPTH] == 40_000_007
    assert {stamp for topic, stamp in stamps.items() if topic not in (topics.COLOR, topics.DEPTH)} == {7}
    (joints,) = [decode(m) for m in messages if m.topic == topics.JOINT_STATES]
    assert list(joints.position) == [float(n) for n in range(9)]
    assert list(joints.velocity) == [10.0 + n for n in range(9)]
    assert list(joints.effort) == [*(20.0 + n for n in range(7)), 0.0, 0.0]


def test_the_executor_is_bounded_by_checks_alone() -> None:
    config = arm_hand._executor_config()
    assert config.search.time_limit == config.table.tolerance == 600.0 and config.planning_time == 15.0
    assert config.after_failure is AfterFailure.STAY
