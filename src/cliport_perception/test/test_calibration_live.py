"""The live procedures, fed as a camera and an arm would feed them."""

from __future__ import annotations

import os
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
import yaml

from cliport_core import Pose
from cliport_perception import CameraModel
from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.calibration_file import CalibrationRecord, Method, save_calibration
from cliport_perception.calibration.calibration_watch import CalibrationWatch
from cliport_perception.calibration.collector import SampleCollector
from cliport_perception.calibration.detection import Fault, Refusal
from cliport_perception.calibration.procedures import EyeOnBaseProcedure, KnownBoardProcedure, Voice
from cliport_perception.calibration.proposals import describe_move
from cliport_perception.calibration.result import Acceptance, Misfit, Uncertainty
from cliport_perception.calibration.sample import Sample
from cliport_perception.calibration.synthetic import SyntheticCamera
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.camera_health import Level
from cliport_perception.errors import CalibrationError

S = 1_000_000_000
PICTURE = np.zeros((540, 960), np.uint8)
NOW = datetime(2026, 11, 22, 5, 0, tzinfo=timezone.utc)


class SeenBoard:
    """A detector that sees what a set-up would show it, without pictures."""

    def __init__(self, world) -> None:
        self.world = world
        self.gripper = world.start
        self.rng = np.random.default_rng(0)

    def look(self, picture):
        return self.world.sample(self.rng, self.gripper, noise_px=0.05).view


def stand(collector: SampleCollector, pose: Pose, start_s: float, seconds: float = 1.0) -> float:
    """Let the gripper stand at a pose for some time; return when that ends [s]."""
    for time_s in np.arange(start_s, start_s + seconds, 0.02):
        collector.on_gripper(round(time_s * S), pose)
    return start_s + seconds


def test_a_sample_is_taken_when_arm_and_board_stand_still(board_in_hand) -> None:
    detector = SeenBoard(board_in_hand)
    collector = SampleCollector(detector)  # type: ignore[arg-type]
    end = stand(collector, board_in_hand.start, 10.0)
    first = collector.on_picture(round(end * S), PICTURE)
    assert isinstance(first, Refusal) and "hold still for one more picture" in first.words
    got = collector.on_picture(round((end + 0.03) * S), PICTURE)
    assert isinstance(got, Sample) and collector.samples == [got]
    again = collector.on_picture(round((end + 0.06) * S), PICTURE)
    assert isinstance(again, Refusal) and "this pose is taken" in again.words


def test_what_keeps_a_sample_from_being_taken_is_said(board_in_hand) -> None:
    detector = SeenBoard(board_in_hand)
    collector = SampleCollector(detector)  # type: ignore[arg-type]
    start = board_in_hand.start

    def words(time_s: float, fault: Fault = Fault.MOVING) -> str:
        got = collector.on_picture(round(time_s * S), PICTURE)
        assert isinstance(got, Refusal) and got.fault is fault
        return got.words

    assert "no transform joins the gripper to the base" in words(1.0, Fault.NO_ARM)
    collector.on_gripper(round(1.0 * S), start)
    assert "too short a time" in words(1.0)
    end = stand(collector, start, 1.0)
    for i in range(20):
        shifted = Pose(start.rotation, start.translation + np.array([0.001 * i, 0.0, 0.0]))
        collector.on_gripper(round((end + 0.02 * i) * S), shifted)
    assert "the arm moves" in words(end + 0.38)
    assert "60.0 s older than the picture: do camera and arm have one clock" in words(end + 60.38, Fault.NO_ARM)
    stand(collector, start, 500.0)
    assert "one more picture" in words(501.0)
    detector.gripper = start @ Pose.from_xyz_rpy((0.01, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert "the board moved by" in words(501.02)


def test_poses_that_lag_behind_the_picture_a_little_are_good_enough(board_in_hand) -> None:
    collector = SampleCollector(SeenBoard(board_in_hand))  # type: ignore[arg-type]
    end = stand(collector, board_in_hand.start, 10.0)
    for i in range(2):
        got = collector.on_picture(round((end + 0.8 + 0.02 * i) * S), PICTURE)
    assert isinstance(got, Sample)


def test_a_clock_that_was_reset_begins_anew(board_in_hand) -> None:
    collector = SampleCollector(SeenBoard(board_in_hand))  # type: ignore[arg-type]
    stand(collector, board_in_hand.start, 100.0)
    end = stand(collector, board_in_hand.start, 1.0)
    collector.on_picture(round(end * S), PICTURE)
    assert isinstance(collector.on_picture(round(end * S), PICTURE), Sample)


def test_late_poses_of_two_publishers_do_not_begin_anew(board_in_hand) -> None:
    collector = SampleCollector(SeenBoard(board_in_hand))  # type: ignore[arg-type]
    for i in range(100):
        collector.on_gripper(round((10.0 + 0.01 * i) * S), board_in_hand.start)
        collector.on_gripper(round((9.98 + 0.01 * i) * S), board_in_hand.start)
    collector.on_picture(round(11.0 * S), PICTURE)
    assert isinstance(collector.on_picture(round(11.02 * S), PICTURE), Sample)


def test_a_refused_solution_asks_for_more_samples_and_keeps_what_was_taken(board_in_hand) -> None:
    procedure = EyeOnBaseProcedure(
        board_in_hand.board, board_in_hand.camera, 1, np.random.default_rng(0), Voice(lambda _: None, lambda _: None)
    )
    procedure._collector = SampleCollector(SeenBoard(board_in_hand))  # type: ignore[arg-type]
    end = stand(procedure._collector, board_in_hand.start, 10.0)
    for _ in range(2):
        procedure.on_picture(round(end * S), PICTURE)
    assert procedure.is_complete
    with pytest.raises(CalibrationError, match="take more"):
        procedure.solve(("base", "optical"), NOW)
    assert procedure.extend() == 5
    assert not procedure.is_complete and len(procedure._collector.samples) == 1


def test_the_whole_procedure_from_pictures(board_in_hand) -> None:
    said: list[str] = []
    lens = CameraModel(640, 360, 360.0, 361.0, 321.0, 179.0, "plumb_bob", (0.05, -0.05, 0.0, 0.0, 0.0))
    world = board_in_hand._replace(camera=lens)
    nearer = world.placement.camera_in_base @ Pose.from_xyz_rpy((-0.1, -0.08, 0.55), (0.0, 0.0, 0.2))
    world = world._replace(start=nearer @ world.placement.board_in_gripper.inverse())
    drawn = SyntheticCamera(world.board, lens)
    rng = np.random.default_rng(2)
    procedure = EyeOnBaseProcedure(world.board, lens, 11, rng, Voice(said.append, said.append))
    time_s = 0.0
    for told in (sample.gripper_in_base for sample in world.samples(30, seed=4)):
        for _ in range(40):
            time_s += 0.02
            procedure.on_gripper(round(time_s * S), told)
        for _ in range(2):
            picture = drawn.picture(world.placement.board_in_camera(told), rng)
            procedure.on_picture(round(time_s * S), picture)
        if procedure.is_complete:
            break
    record = procedure.solve(("base", "optical"), NOW)
    mm, deg = pose_difference(record.camera.camera_in_base, world.placement.camera_in_base)
    assert record.uncertainty is not None and mm < record.uncertainty.mm and deg < record.uncertainty.deg
    assert (record.method, record.base_frame, record.camera_frame) == (Method.EYE_ON_BASE, "base", "optical")
    assert any(words.startswith("sample 3 of 11:") and "move " in words for words in said)
    assert any("held out" in words for words in said) and any("uncertainty" in words for words in said)


def test_a_board_on_the_table_needs_no_arm(board_in_hand) -> None:
    world = board_in_hand._replace(placement=replace(board_in_hand.placement, board_in_gripper=Pose.identity()))
    lying = Pose.from_xyz_rpy((0.4, 0.1, 0.0), (np.pi, 0.0, 0.4))
    said: list[str] = []
    procedure = KnownBoardProcedure(
        world.board, lying, world.camera, 3, Method.FIXED_MARKER, Voice(said.append, said.append)
    )
    procedure.on_picture(0, PICTURE)
    assert not procedure.is_complete and "no marker of 4X4_50" in said[-1]
    drawn, rng = SyntheticCamera(world.board, world.camera), np.random.default_rng(0)
    for i in range(3):
        procedure.on_picture(i, drawn.picture(world.placement.board_in_camera(lying), rng))
    record = procedure.solve(("base", "optical"), NOW)
    mm, deg = pose_difference(record.camera.camera_in_base, world.placement.camera_in_base)
    assert record.method is Method.FIXED_MARKER and record.uncertainty is not None
    assert mm < record.uncertainty.mm and deg < record.uncertainty.deg


def test_a_misfit_of_a_lying_board_is_not_called_held_out() -> None:
    with pytest.raises(CalibrationError) as caught:
        Acceptance().check(Misfit(9.0, 0.0, 0.0), Uncertainty(0.0, 0.0), "misfit", "look at the board")
    assert str(caught.value) == "the calibration is not good enough: misfit 9.00 px (at most 1); look at the board"


def test_moves_are_proposed_in_words() -> None:
    start = Pose.from_xyz_rpy((0.4, 0.0, 0.3), (np.pi, 0.0, 0.0))
    wanted = Pose.from_xyz_rpy((0.45, 0.0, 0.28), (np.pi, 0.0, 0.0)) @ Pose.from_xyz_rpy((0, 0, 0), (0.3, 0, 0))
    words = describe_move(start, wanted)
    assert words == "move +50 mm along the base's x, -20 mm along the base's z, +17 degrees about the hand's x"
    assert describe_move(start, start) == "stay where you are"


def record(x: float = 0.9) -> CalibrationRecord:
    lens = CameraModel(640, 480, 500.0, 500.0, 320.0, 240.0)
    pose = Pose.looking_at((x, 0.0, 0.8), (0.4, 0.0, 0.0))
    return CalibrationRecord(CameraCalibration(lens, pose), NOW, Method.STATIC, "panda_link0", "optical")


def test_a_changed_file_is_read_again_and_a_broken_one_is_not_used(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    save_calibration(path, record())
    watch = CalibrationWatch(path, 30.0, lambda: NOW + timedelta(days=2))
    assert watch.poll() is None
    assert (watch.report(0.1).level, watch.report(0.1).message) == (Level.OK, "the calibration is 2.0 days old")
    save_calibration(path, record(1.0))
    changed = watch.poll()
    assert changed is not None and changed.camera.camera_in_base.translation[0] == pytest.approx(1.0)
    content = yaml.safe_load(path.read_text())
    content["camera"]["position"][0] = float("nan")
    path.write_text(yaml.safe_dump(content))
    os.utime(path, ns=(1, 1))
    assert watch.poll() is None
    report = watch.report(None)
    assert report.level is Level.ERROR and "stays in use" in report.message and "position" in report.message
    assert watch.record.camera.camera_in_base.translation[0] == pytest.approx(1.0)
    path.unlink()
    assert watch.poll() is None and watch.report(None).level is Level.ERROR


def test_an_old_calibration_is_worth_a_warning(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    save_calibration(path, record())
    report = CalibrationWatch(path, 30.0, lambda: NOW + timedelta(days=45)).report(0.2)
    assert report.level is Level.WARN and "45 days old (limit 30)" in report.message
    assert CalibrationWatch(path, 30.0, lambda: NOW - timedelta(days=1)).report(0.2).level is Level.WARN
    with pytest.raises(CalibrationError, match="cannot read"):
        CalibrationWatch(tmp_path / "none.yaml", 30.0, lambda: NOW)
    with pytest.raises(CalibrationError, match="max_age_days must be positive"):
        CalibrationWatch(path, float("nan"), lambda: NOW)


def test_who_moves_the_hand_by_itself_is_not_told_how(board_in_hand) -> None:
    said, complaints = list[str](), list[str]()
    voice = Voice(said.append, complaints.append)
    board, camera = board_in_hand.board, board_in_hand.camera
    procedure = EyeOnBaseProcedure(board, camera, 12, np.random.default_rng(0), voice, advises=False)
    procedure._collector._detector = SeenBoard(board_in_hand)  # type: ignore[assignment]
    assert procedure.propose() is None, "it is not known where the gripper is"
    procedure.on_picture(S, PICTURE)
    assert len(complaints) == 1 and "no transform joins the gripper" in complaints[0]
    for time_s in np.arange(10.0, 11.0, 0.02):
        procedure.on_gripper(round(time_s * S), board_in_hand.start)
    for time_s in (11.0, 11.02, 11.04):
        procedure.on_picture(round(time_s * S), PICTURE)
    assert len(complaints) == 1, "one more picture, and a pose that is taken, concern nobody"
    assert procedure.sample_count == 1
    assert [line.split(";") for line in said] == [[said[0]]] and said[0].startswith("sample 1 of 12: ")
    first, second = procedure.propose(), procedure.propose([board_in_hand.start])
    assert first is not None and second is not None
    assert pose_difference(first, board_in_hand.start)[0] > 30.0
