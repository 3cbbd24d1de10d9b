"""Calibrations on file: what is written comes back, old ones stay, and what cannot be used ends in one line."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from cliport_core import Pose
from cliport_perception import CameraModel
from cliport_perception.calibration.angles import pose_difference
from cliport_perception.calibration.board import Board, parse_board
from cliport_perception.calibration.calibration_file import (
    CalibrationRecord,
    Method,
    load_calibration,
    record_of,
    save_calibration,
)
from cliport_perception.calibration.cli import main
from cliport_perception.calibration.easy_handeye import read_easy_handeye
from cliport_perception.calibration.known_board import board_from_touches, solve_known_board
from cliport_perception.calibration.print_sheet import board_figure, print_board
from cliport_perception.calibration.result import EyeOnBase, Misfit, SampleMisfit, Uncertainty, Use
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.errors import CalibrationError

LENS = CameraModel(960, 540, 540.0, 541.0, 481.0, 269.0, "plumb_bob", (0.08, -0.1, 0.001, -0.0005, 0.0))
POSE = Pose.looking_at((0.9, 0.1, 0.8), (0.45, 0.0, 0.0))
MADE = datetime(2026, 11, 22, 5, 0, tzinfo=timezone.utc)
FRAMES = ("panda_link0", "camera_color_optical_frame")


def record() -> CalibrationRecord:
    samples = (SampleMisfit(Use.FITTED, Misfit(0.2, 0.5, 0.1)), SampleMisfit(Use.OUTLIER, Misfit(20.0, 30.0, 4.0)))
    found = EyeOnBase(
        POSE, Pose.identity(), Misfit(0.2, 0.5, 0.1), Misfit(0.3, 0.6, 0.1), Uncertainty(1.5, 0.1), samples
    )
    return record_of(found, CameraCalibration(LENS, POSE), Board(), FRAMES, MADE)


def test_a_calibration_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "camera.yaml"
    assert save_calibration(path, record()) is None
    back = load_calibration(path)
    assert back.camera.intrinsics == LENS and back.camera.camera_in_base.is_close(POSE)
    assert back.to_dict()["calibration"] == record().to_dict()["calibration"]
    assert (back.outliers, back.samples, back.board) == ((1,), 2, Board())
    assert back.age_days(MADE + timedelta(hours=36)) == pytest.approx(1.5)
    assert [file.name for file in path.parent.iterdir()] == ["camera.yaml"]


def test_earlier_calibrations_are_kept(tmp_path: Path) -> None:
    path = tmp_path / "camera.yaml"
    for x in (0.1, 0.2, 0.3):
        moved = Pose(POSE.rotation, np.array([x, 0.0, 1.0]))
        save_calibration(path, replace(record(), camera=CameraCalibration(LENS, moved)))
    xs = sorted(float(load_calibration(file).camera.camera_in_base.translation[0]) for file in tmp_path.iterdir())
    assert xs == pytest.approx([0.1, 0.2, 0.3])
    assert load_calibration(path).camera.camera_in_base.translation[0] == pytest.approx(0.3)


@pytest.mark.parametrize("frame", ["camera-1_optical", "cam.left/optical", "Kamera_\u00f6"])
def test_every_frame_that_is_saved_can_be_read(tmp_path: Path, frame: str) -> None:
    path = tmp_path / "camera.yaml"
    save_calibration(path, replace(record(), camera_frame=frame))
    assert load_calibration(path).camera_frame == frame


@pytest.mark.parametrize("frame", ["", "a b", "a\n"])
def test_what_is_no_frame_is_never_saved(frame: str) -> None:
    with pytest.raises(CalibrationError, match="names of frames"):
        replace(record(), camera_frame=frame)


def test_earlier_calibrations_are_kept_without_second_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError("no hard links here")

    monkeypatch.setattr("os.link", refuse)
    path = tmp_path / "camera.yaml"
    save_calibration(path, record())
    kept = save_calibration(path, replace(record(), base_frame="other"))
    assert kept is not None and load_calibration(kept).base_frame == "panda_link0"
    assert load_calibration(path).base_frame == "other"


def test_a_file_that_changes_while_it_is_read_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "camera.yaml"
    save_calibration(path, record())
    text, reads = path.read_text(), []
    monkeypatch.setattr(Path, "read_text", lambda *_, **__: reads.append(1) or (text if len(reads) == 1 else ""))
    assert load_calibration(path).base_frame == "panda_link0"


def test_a_place_that_cannot_be_written_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CalibrationError, match="cannot write"):
        save_calibration(tmp_path / "file" / "camera.yaml", record())
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def edited(tmp_path: Path, edit) -> Path:
    content = record().to_dict()
    edit(content)
    path = tmp_path / "camera.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


@pytest.mark.parametrize(
    ("edit", "words"),
    [(lambda c: c.pop("calibration"), "holds a camera, but no 'calibration'"),
     (lambda c: c["calibration"].pop("made"), "lacks made"),
     (lambda c: c["calibration"].update(mood=1), "has the unknown mood"),
     (lambda c: c["calibration"].update(version=3), "reads versions 1 to 2"),
     (lambda c: c["calibration"].update(method="guess"), "'guess' is not a valid Method"),
     (lambda c: c["calibration"].update(made="yesterday"), "Invalid isoformat"),
     (lambda c: c["calibration"].update(made="2026-11-22T05:00:00"), "time zone"),
     (lambda c: c["calibration"].update(base_frame="a b"), "names of frames"),
     (lambda c: c["calibration"]["held_out"].update(px=float("nan")), r"held_out\.px must be a finite number"),
     (lambda c: c["calibration"]["uncertainty"].pop("mm"), "uncertainty must hold mm, deg"),
     (lambda c: c["calibration"]["board"].pop("pitch"), "a board needs kind"),
     (lambda c: c["camera"].pop("position"), "must hold 'camera' with 'position'"),
     (lambda c: c["camera"].update(position=[0.1, float("inf"), 0.2]), "position must be three numbers"),
     (lambda c: c["camera"].update(orientation_xyzw=[1, 1, 0, 0]), "unit quaternion"),
     (lambda c: c["camera"].pop("fx"), "lacks fx"),
     (lambda c: c["camera"].update(fx=0.0), "focal lengths must be positive"),
     (lambda c: [c["camera"].pop(k) for k in ("width", "height", "fx", "fy", "cx", "cy", "distortion",
                                              "distortion_model")], "lacks the lens")],
)  # fmt: skip
def test_a_file_that_cannot_be_used_is_named_in_one_line(tmp_path: Path, edit, words: str) -> None:
    path = edited(tmp_path, edit)
    before = path.read_bytes()
    with pytest.raises(CalibrationError, match=words) as caught:
        load_calibration(path)
    assert str(path) in str(caught.value) and "\n" not in str(caught.value)
    assert path.read_bytes() == before


def test_a_missing_file_and_no_yaml_are_named(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="cannot read"):
        load_calibration(tmp_path / "none.yaml")
    (tmp_path / "no.yaml").write_text("camera: [")
    with pytest.raises(CalibrationError, match="is not YAML"):
        load_calibration(tmp_path / "no.yaml")


EASY = """parameters:
  name: mine
  calibration_type: eye_on_base
  robot_base_frame: panda_link0
  robot_effector_frame: panda_link8
  tracking_base_frame: camera_color_optical_frame
  tracking_marker_frame: marker
  freehand_robot_movement: true
  move_group_namespace: /
  move_group: manipulator
transform:
  translation: {x: 0.9, y: -0.1, z: 0.5}
  rotation: {x: 0.6, y: 0.0, z: 0.0, w: 0.8}
"""


def test_easy_handeyes_format_goes_there_and_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    theirs, ours, back = tmp_path / "mine.calib", tmp_path / "camera.yaml", tmp_path / "back.calib"
    theirs.write_text(EASY)
    lens = [str(v) for v in (960, 540, 540.0, 540.0, 480.0, 270.0)]
    assert main(["--from-easy-handeye", str(theirs), "--out", str(ours), "--intrinsics", *lens]) == 0
    assert load_calibration(ours).method is Method.STATIC
    assert main(["--to-easy-handeye", str(back), "--calibration", str(ours)]) == 0
    assert "panda_link0" in capsys.readouterr().out
    first, second = read_easy_handeye(theirs), read_easy_handeye(back)
    assert first.camera_in_base.is_close(second.camera_in_base)
    assert first.tracking_base_frame == second.tracking_base_frame
    written = yaml.safe_load(back.read_text())
    assert list(written) == ["parameters", "transform"]
    assert written["parameters"].keys() == yaml.safe_load(EASY)["parameters"].keys()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [("eye_on_base", "eye_in_hand", "only eye_on_base"), ("x: 0.9", "x: .nan", r"translation\.x must be a finite"),
     ("w: 0.8", "w: 0.1", "unit quaternion"), ("  robot_base_frame: panda_link0\n", "", "lacks robot_base_frame"),
     ("transform:", "transformation:", "must hold 'parameters' and 'transform'"),
     (", y: -0.1", "", "must hold x, y, z")],
)  # fmt: skip
def test_what_easy_handeye_did_not_write_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    path = tmp_path / "mine.calib"
    path.write_text(EASY.replace(old, new))
    with pytest.raises(CalibrationError, match=words) as caught:
        read_easy_handeye(path)
    assert "\n" not in str(caught.value)


def test_plain_extrinsics_are_written_and_a_wrong_rotation_overwrites_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "camera.yaml"
    lens = ["--intrinsics", "640", "480", "500", "500", "320", "240", "--out", str(out)]
    assert main(["--static", "0.9", "0", "0.8", "1", "0", "0", "0", *lens]) == 0
    before = out.read_bytes()
    assert load_calibration(out).base_frame == "panda_link0"
    assert main(["--static", "0.9", "0", "0.8", "1", "1", "0", "0", *lens]) == 1
    assert "QX QY QZ QW have length 1.41, not 1" in capsys.readouterr().err
    assert main(["--static", "0.9", "0", "0.8", "1", "0", "0", "0", "--out", str(out)]) == 1
    assert out.read_bytes() == before and len(list(tmp_path.iterdir())) == 1


def test_the_sheet_has_its_true_size(tmp_path: Path) -> None:
    path = tmp_path / "board.pdf"
    assert main(["--print-board", str(path), "--board", "charuco:5x4:40:30:4X4_50"]) == 0
    content = path.read_bytes()
    assert content.startswith(b"%PDF")
    box = content.split(b"/MediaBox [")[1].split(b"]")[0].split()
    width, height = (float(v) * 25.4 / 72.0 for v in box[2:])
    assert (width, height) == pytest.approx((297.0, 210.0), abs=0.1)


@pytest.mark.parametrize("text", ["charuco:5x4:40:30:4X4_50", "aprilgrid:4x3:50:40", "aruco:120"])
def test_the_board_on_the_sheet_has_its_true_size_and_is_found(text: str) -> None:
    board = parse_board(text)
    figure = board_figure(board)
    figure.set_dpi(254.0)  # 10 pixels a mm
    figure.canvas.draw()
    gray = cv2.cvtColor(np.asarray(figure.canvas.buffer_rgba())[..., :3].copy(), cv2.COLOR_RGB2GRAY)
    dark = np.argwhere(gray[:1800] < 128)  # above the ruler
    rows, cols = dark.max(axis=0) - dark.min(axis=0) + 1
    width, height = (1e4 * side for side in board.size)
    if text.startswith("charuco"):  # its corner squares are white on one diagonal only
        assert abs(cols - width) <= 2 and abs(rows - height) <= 2
    corners, ids, _ = cv2.aruco.ArucoDetector(board.cv_board.getDictionary()).detectMarkers(gray)
    assert len(ids) == len(board.cv_board.getIds())
    side = np.linalg.norm(corners[0][0, 0] - corners[0][0, 1])
    assert side == pytest.approx(1e4 * board.marker, abs=3.0)
    ruler = np.flatnonzero(gray[-141] < 200)
    assert ruler.max() - ruler.min() == pytest.approx(1500, abs=6)


def test_a_board_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match="take larger paper"):
        print_board(parse_board("aruco:300"), tmp_path / "board.pdf")
    assert not list(tmp_path.iterdir())


def test_simulated_set_ups_are_solved_and_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "f.json"
    assert main(["--simulate", "1", "--samples", "12", "--seed", "3", "--out", str(out)]) == 0
    result = json.loads(out.read_text())
    assert result["median_mm"] == result["worst_mm"] == result["runs"][0]["error_mm"] < 5.0
    assert result["median_deg"] == result["worst_deg"] < 0.5
    assert result["within_uncertainty"] == 1
    assert main(["--simulate", "0"]) == 1
    assert "must be 1 or more" in capsys.readouterr().err


@pytest.mark.soak
@pytest.mark.parametrize("more", [[], ["--outliers", "0.1"]])
def test_twenty_set_ups_keep_the_bounds(tmp_path: Path, more: list[str]) -> None:
    out = tmp_path / "f.json"
    assert main(["--simulate", "20", "--seed", "7", "--out", str(out), *more]) == 0
    result = json.loads(out.read_text())
    assert result["median_mm"] <= 2.0 and result["median_deg"] <= 0.2
    assert result["worst_mm"] <= 5.0 and result["worst_deg"] <= 0.5
    assert result["within_uncertainty"] == 20


def test_a_marker_at_a_known_place_gives_the_camera(board_in_hand) -> None:
    board, lens = board_in_hand.board, board_in_hand.camera
    lying = Pose.from_xyz_rpy((0.4, 0.1, 0.0), (np.pi, 0.0, 0.4))
    truth = board_in_hand.placement.camera_in_base
    world = board_in_hand._replace(placement=replace(board_in_hand.placement, board_in_gripper=Pose.identity()))
    rng = np.random.default_rng(0)
    views = [world.sample(rng, lying, noise_px=0.1).view for _ in range(20)]
    found = solve_known_board(views, lying, lens, board.center)
    mm, deg = pose_difference(found.camera_in_base, truth)
    assert mm < found.uncertainty.mm and deg < found.uncertainty.deg and found.misfit.px < 0.3
    there = (found.camera_in_base @ truth.inverse()).apply(lying.apply(board.center)) - lying.apply(board.center)
    assert 1e3 * np.linalg.norm(there) < found.near_board.mm < 8.0 < found.uncertainty.mm
    touched = lying.apply(board.outline[:3]) + rng.normal(0.0, 0.0003, (3, 3))
    mm, deg = pose_difference(board_from_touches(board, touched), lying)
    assert mm < 1.0 and deg < 0.5
    turned = [world.sample(rng, lying @ Pose.from_xyz_rpy((0.02, 0.0, 0.0), (0, 0, 0)), 0.1).view]
    with pytest.raises(CalibrationError, match="must stand still"):
        solve_known_board(views[:1] + turned, lying, lens, board.center)


def test_touches_in_a_wrong_order_or_number_are_refused() -> None:
    board = Board()
    with pytest.raises(CalibrationError, match="touch top left, top right, bottom right in this order"):
        board_from_touches(board, board.outline[[0, 2, 1]])
    with pytest.raises(CalibrationError, match="three or four touched points"):
        board_from_touches(board, board.outline[:2])
    with pytest.raises(CalibrationError, match="three or four touched points"):
        board_from_touches(board, np.full((3, 3), np.nan))
