"""`ros2 run cliport_perception calibrate`: a camera's calibration from the printed board to the saved file."""

from __future__ import annotations

import argparse
import json
import math
import sys
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from cliport_core.command_line import CommandParser
from cliport_core.errors import CoreError
from cliport_core.pose import Pose
from cliport_perception.calibration.board import Board, parse_board
from cliport_perception.calibration.calibration_file import (
    CalibrationRecord,
    Method,
    load_calibration,
    write_kept,
)
from cliport_perception.calibration.easy_handeye import EasyHandeye, read_easy_handeye, write_easy_handeye
from cliport_perception.calibration.lens_simulation import simulate_lenses
from cliport_perception.calibration.saving import DEFAULT_OUT, say_saved
from cliport_perception.calibration.simulation import SimulationConfig, simulate
from cliport_perception.camera_file import CameraCalibration
from cliport_perception.camera_model import CameraModel
from cliport_perception.errors import CalibrationError
from panda_model.errors import PresetError
from panda_model.preset_files import DEFAULT_PRESET, load_preset


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return 0 when it was done, 1 on an error, 2 on a wrong command line, 130 on a signal."""
    argv = sys.argv[1:] if arguments is None else arguments
    own, ros = _split(argv)
    options = _parser().parse_args(own)
    try:
        board = parse_board(options.board)
        if options.print_board is not None:
            return _print_board(board, options)
        if options.simulate is not None:
            return _simulate(board, options)
        if options.simulate_lens is not None:
            return _simulate_lens(board, options)
        if options.find_intrinsics is not None:
            return _lens(board, options, ros)
        if options.static is not None or options.from_easy_handeye is not None:
            return _static(options)
        if options.to_easy_handeye is not None:
            return _to_easy_handeye(options)
        if options.verify is not None:
            return _verify(board, options, ros)
        return _live(board, options, ros)
    except (CoreError, PresetError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("error: interrupted; nothing was written", file=sys.stderr)
        return 130


def _split(argv: list[str]) -> tuple[list[str], list[str]]:
    """Return the program's own arguments and those of ROS."""
    at = argv.index("--ros-args") if "--ros-args" in argv else len(argv)
    return argv[:at], argv[at:]


def _print_board(board: Board, options: argparse.Namespace) -> int:
    from cliport_perception.calibration.print_sheet import print_board  # matplotlib takes a second to load

    print_board(board, options.print_board, options.paper)
    print(f"{options.print_board}: {board.describe()} on {options.paper}; print it at 100 % and check the ruler")
    return 0


def _simulate(board: Board, options: argparse.Namespace) -> int:
    if options.simulate < 1 or options.samples < 1 or not 0.0 <= options.outliers < 1.0:
        raise CalibrationError("--simulate and --samples must be 1 or more, --outliers a share from 0 to 1")
    config = SimulationConfig(options.samples, outlier_share=options.outliers, print_scale=options.print_scale)
    result = simulate(options.simulate, options.seed, board, config, _say_run)
    if options.out is not None:
        write_kept(options.out, json.dumps(result, indent=2) + "\n")
    print(json.dumps({key: value for key, value in result.items() if key not in ("runs", "config")}))
    return 0


def _simulate_lens(board: Board, options: argparse.Namespace) -> int:
    if options.simulate_lens < 1:
        raise CalibrationError("--simulate-lens must be 1 or more")
    result = simulate_lenses(options.simulate_lens, options.seed, board, lambda row: print(json.dumps(row), flush=True))
    if options.out is not None:
        write_kept(options.out, json.dumps(result, indent=2) + "\n")
    print(json.dumps({key: value for key, value in result.items() if key != "runs"}))
    return 0


def _say_run(row: dict[str, Any]) -> None:
    if "error" in row:
        print(f"{row['number']}: refused: {row['error']}", flush=True)
        return
    print(
        f"{row['number']}: {row['error_mm']:.2f} mm (+-{row['uncertainty_mm']:.2f}), {row['error_deg']:.3f} deg "
        f"(+-{row['uncertainty_deg']:.3f}), {row['outliers']} outliers of {row['samples']}",
        flush=True,
    )


def _static(options: argparse.Namespace) -> int:
    """Write plain extrinsics, or those of easy_handeye2, as a calibration."""
    if options.intrinsics is None:
        raise CalibrationError("--intrinsics WIDTH HEIGHT FX FY CX CY are needed, as camera_info has them")
    width, height, fx, fy, cx, cy = options.intrinsics
    if width != int(width) or height != int(height):
        raise CalibrationError(f"--intrinsics: WIDTH and HEIGHT must be whole numbers of pixels, got {width}, {height}")
    lens = CameraModel(int(width), int(height), fx, fy, cx, cy)
    if options.from_easy_handeye is not None:
        found = read_easy_handeye(options.from_easy_handeye)
        pose, frames = found.camera_in_base, (found.robot_base_frame, found.tracking_base_frame)
    else:
        base_frame = options.base_frame or load_preset(options.robot).base_frame
        pose, frames = _pose_of(options.static), (base_frame, options.camera_frame)
    record = CalibrationRecord(CameraCalibration(lens, pose), datetime.now(timezone.utc), Method.STATIC, *frames)
    return say_saved(options.out or DEFAULT_OUT, record)


def _pose_of(numbers: list[float]) -> Pose:
    x, y, z, qx, qy, qz, qw = numbers
    length = (qx * qx + qy * qy + qz * qz + qw * qw) ** 0.5
    if not abs(length - 1.0) < 0.01:
        raise CalibrationError(f"--static needs a rotation: QX QY QZ QW have length {length:.3g}, not 1")
    return Pose.from_quaternion_xyzw((qx, qy, qz, qw), (x, y, z))


def _to_easy_handeye(options: argparse.Namespace) -> int:
    record = load_calibration(options.calibration)
    gripper = options.gripper_frame or load_preset(options.robot).tcp_frame
    frames = (record.base_frame, gripper, record.camera_frame, "board")
    pose = record.camera.camera_in_base
    write_easy_handeye(options.to_easy_handeye, EasyHandeye(options.calibration.stem, *frames, pose))
    print(f"{options.to_easy_handeye}: {record.camera_frame} in {record.base_frame}")
    return 0


def _verify(board: Board, options: argparse.Namespace, ros: list[str]) -> int:
    from cliport_perception.calibration.ros_verify import run_verify  # needs ROS, which the other ways do not

    return run_verify(board, options, ros)


def _lens(board: Board, options: argparse.Namespace, ros: list[str]) -> int:
    from cliport_perception.calibration.ros_lens import run_lens  # needs ROS, which the other ways do not
    from cliport_perception.calibration.ros_session import end_with_input, screen_voice

    if options.tied:
        end_with_input()
    return run_lens(board, options, ros, screen_voice())


def _live(board: Board, options: argparse.Namespace, ros: list[str]) -> int:
    from cliport_perception.calibration.ros_live import run_live  # needs ROS, which the other ways do not
    from cliport_perception.calibration.ros_session import end_with_input

    if options.tied:
        end_with_input()
    status = run_live(board, options, ros)
    if status == 0 and options.apply_depth:
        options.calibration = options.out or DEFAULT_OUT
        return _verify(board, options, ros)
    return status


def _finite(text: str) -> float:
    """Return a number of the command line; argparse says in one line what is none."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number")
    return number


def _parser() -> argparse.ArgumentParser:
    parser = CommandParser(prog="calibrate", description=__doc__)
    parser.add_argument("--board", default="charuco", metavar="FORM", help="charuco:5x4:40:30:4X4_50, the default")
    parser.add_argument("--out", type=Path, metavar="FILE", help=f"what is written; {DEFAULT_OUT}")
    parser.add_argument("--samples", type=int, default=30, help="how many to take; 30")
    parser.add_argument("--seed", type=int, default=0, help="of trial samples and of simulated set-ups; 0")
    parser.add_argument("--robot", default=DEFAULT_PRESET, help="preset whose frames are meant")
    parser.add_argument("--base-frame", default="", help="the arm's; that of the robot's preset")
    parser.add_argument("--gripper-frame", default="", help="in which the board is held; the preset's tcp")
    parser.add_argument("--camera-frame", default="camera_color_optical_frame", help="of --static; else the picture's")
    parser.add_argument("--tied", action="store_true", help="end with standard input: for a program that runs this")
    parser.add_argument("--move", action="store_true", help="let the executor move the hand from pose to pose: docs")
    parser.add_argument("--first", type=_finite, nargs=6, metavar=("X", "Y", "Z", "ROLL", "PITCH", "YAW"))
    parser.add_argument(
        "--carried", type=_finite, metavar="M", help="of --move: from the fingertips to the board's end"
    )
    ways = parser.add_mutually_exclusive_group()
    ways.add_argument("--print-board", type=Path, metavar="PDF", help="write the board at true scale, and end")
    ways.add_argument("--simulate", type=int, metavar="N", help="calibrate N random set-ups with a hidden truth")
    ways.add_argument("--static", type=_finite, nargs=7, metavar=("X", "Y", "Z", "QX", "QY", "QZ", "QW"))
    ways.add_argument("--from-easy-handeye", type=Path, metavar="FILE", help="read easy_handeye2's calibration")
    ways.add_argument("--to-easy-handeye", type=Path, metavar="FILE", help="write --calibration as easy_handeye2's")
    ways.add_argument("--board-at", type=_finite, nargs=6, metavar=("X", "Y", "Z", "ROLL", "PITCH", "YAW"))
    ways.add_argument("--touched", type=_finite, nargs=9, metavar="M", help="x, y, z of the tip at three corners: docs")
    ways.add_argument("--verify", type=Path, metavar="PNG", help="draw the model over what is seen, with numbers")
    parser.add_argument(
        "--apply-depth", action="store_true", help="of --verify, or after a calibration: correct depth from now on"
    )
    ways.add_argument("--find-intrinsics", type=Path, metavar="FILE", help="calibrate the lens: a camera_info file")
    ways.add_argument("--simulate-lens", type=int, metavar="N", help="calibrate N random lenses with a hidden truth")
    parser.add_argument("--camera-info", type=Path, metavar="FILE", help="the lens, where camera_info lacks it")
    parser.add_argument("--workspace", metavar="FILE", help="of --verify: your workspace's YAML")
    parser.add_argument("--calibration", type=Path, default=DEFAULT_OUT, help="the one to verify or convert")
    parser.add_argument("--paper", default="A4", help="of --print-board: A4, A3 or letter")
    parser.add_argument("--intrinsics", type=_finite, nargs=6, metavar=("WIDTH", "HEIGHT", "FX", "FY", "CX", "CY"))
    parser.add_argument("--outliers", type=_finite, default=0.0, help="of --simulate: share of samples grossly wrong")
    parser.add_argument("--print-scale", type=_finite, default=1.0, help="of --simulate: size of the print; 1")
    return parser


if __name__ == "__main__":
    sys.exit(main())
