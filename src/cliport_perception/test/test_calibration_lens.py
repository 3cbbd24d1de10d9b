"""A lens from views of the board: what is asked for, what is found, what is refused, and its file."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml

from cliport_core.errors import ImageError
from cliport_core.pose import Pose
from cliport_perception import CameraModel
from cliport_perception.calibration import lens_simulation
from cliport_perception.calibration.board import Board
from cliport_perception.calibration.cli import main as calibrate
from cliport_perception.calibration.detection import Fault, Refusal
from cliport_perception.calibration.lens_file import read_lens, write_lens
from cliport_perception.calibration.lens_simulation import held_somewhere, pixel_errors
from cliport_perception.calibration.lens_solver import LensLimits, solve_lens
from cliport_perception.calibration.lens_views import LensProcedure, rough_camera
from cliport_perception.calibration.procedures import Voice
from cliport_perception.calibration.synthetic import SyntheticCamera
from cliport_perception.calibration.view import BoardView, fit_view
from cliport_perception.errors import CalibrationError

BOARD = Board()
LENS = CameraModel(960, 540, 560.0, 561.0, 474.0, 276.0, "plumb_bob", (-0.1, 0.05, 0.0008, -0.0006, 0.0))
SIZE = (540, 960)
CORNERS = np.stack([*np.meshgrid(np.arange(1, 5) * 0.04, np.arange(1, 4) * 0.04), np.zeros((3, 4))], -1).reshape(-1, 3)
PICTURE = np.zeros(SIZE, np.uint8)


def seen(pose: Pose, rng: np.random.Generator, noise_px: float = 0.05, lens: CameraModel = LENS) -> BoardView:
    """The view that a lens gives of the board at a pose, as the rough one explains it."""
    pixels = lens.project(pose.apply(CORNERS)) + rng.normal(0.0, noise_px, (len(CORNERS), 2))
    view = fit_view(CORNERS, pixels, rough_camera(*SIZE))
    assert view is not None
    return view


def many(count: int, seed: int = 0, noise_px: float = 0.05) -> list[BoardView]:
    rng = np.random.default_rng(seed)
    return [seen(held_somewhere(rng, BOARD, LENS), rng, noise_px) for _ in range(count)]


def frontal(x: float, y: float, z: float, tilt: tuple[float, float] = (0.0, 0.0)) -> Pose:
    turn = Pose.from_xyz_rpy((0.0, 0.0, 0.0), (*tilt, 0.0))
    return Pose(turn.rotation, np.array([x, y, z]) - turn.rotation @ BOARD.center)


def test_the_lens_is_found_within_what_is_claimed() -> None:
    found = solve_lens(many(30), SIZE)
    for name, sigma in zip(("fx", "fy", "cx", "cy"), found.sigmas, strict=True):
        error = getattr(found.camera, name) - getattr(LENS, name)
        assert abs(error) < 3.0 * sigma < 5.0, (name, error, sigma)
    off = pixel_errors(LENS, found.camera)
    assert np.median(off) < 1.0 and off.max() < 2.5
    assert 0.03 < found.fitted_px < 0.1 and 0.03 < found.held_out_px < 0.15 and found.odd == ()
    assert found.camera.distortion_model == "plumb_bob" and found.camera.distortion[4] == 0.0


def test_a_lens_that_is_another_is_measured_as_such() -> None:
    wide = CameraModel(960, 540, 570.0, 561.0, 474.0, 276.0, "plumb_bob", LENS.distortion)
    shifted = CameraModel(960, 540, 560.0, 561.0, 484.0, 276.0, "plumb_bob", LENS.distortion)
    assert pixel_errors(LENS, LENS).max() < 1e-2
    assert pixel_errors(LENS, wide).max() > 5.0
    assert np.median(pixel_errors(LENS, shifted)) < 3.0, "most of that is a turn of the camera"


def test_a_view_that_does_not_fit_is_left_out() -> None:
    views = many(24)
    rng = np.random.default_rng(9)
    views.insert(7, seen(held_somewhere(rng, BOARD, LENS), rng, noise_px=3.0))
    found = solve_lens(views, SIZE)
    assert found.odd == (7,) and found.fitted_px < 0.1


@pytest.mark.parametrize(
    ("views", "words"),
    [
        (lambda: many(11), "11 views that agree, at least 12 needed"),
        (lambda: many(30, noise_px=2.0), "held out are .* px off, 1 at most"),
        (
            lambda: [
                seen(frontal(0.01 * i - 0.1, 0.0, 0.6 + 0.001 * i), np.random.default_rng(i), 0.3) for i in range(20)
            ],
            "the focal length is open by|give no lens",
        ),
    ],
)
def test_views_that_leave_the_lens_open_are_refused(views: Callable[[], list[BoardView]], words: str) -> None:
    with pytest.raises(CalibrationError, match=words) as caught:
        solve_lens(views(), SIZE)
    assert "\n" not in str(caught.value)


def test_a_principal_point_that_is_open_is_refused() -> None:
    with pytest.raises(CalibrationError, match=r"principal point is open by .* px, 0.01 at most"):
        solve_lens(many(30), SIZE, LensLimits(max_center=0.01))


class Played:
    """A detector that sees what the test sets."""

    def __init__(self) -> None:
        self.next: BoardView | Refusal = Refusal(Fault.NOT_SEEN, "the board is not seen")

    def look(self, picture: Any) -> BoardView | Refusal:
        return self.next


class Bench:
    """A procedure over a played detector."""

    def __init__(self, count: int = 15) -> None:
        self.said, self.complaints = list[str](), list[str]()
        self.procedure = LensProcedure(BOARD, count, Voice(self.said.append, self.complaints.append))
        self.procedure._size, self.detector = SIZE, Played()
        self.procedure._detector = self.detector  # type: ignore[assignment]
        self.rng = np.random.default_rng(3)

    def hold(self, pose: Pose, pictures: int = 2, noise_px: float = 0.02) -> None:
        for _ in range(pictures):
            self.detector.next = seen(pose, self.rng, noise_px)
            self.procedure.on_picture(PICTURE)


def test_a_view_is_taken_when_the_board_is_held_still_somewhere_new() -> None:
    bench = Bench()
    bench.hold(frontal(0.0, 0.0, 0.6), 1)
    assert bench.complaints == ["the board is seen: hold it still"] and not bench.procedure.views
    bench.hold(frontal(0.02, 0.0, 0.6), 1)
    assert not bench.procedure.views, "it moved"
    bench.hold(frontal(0.02, 0.0, 0.6), 1)
    assert len(bench.procedure.views) == 1 and bench.said[0].startswith("view 1 of 15; tilt the board: bring its left")
    bench.hold(frontal(0.03, 0.0, 0.6))
    assert len(bench.procedure.views) == 1 and bench.complaints[-1].startswith("this view is taken; tilt the board")
    bench.hold(frontal(0.03, 0.0, 0.6, (0.3, 0.0)))
    bench.hold(frontal(0.15, 0.0, 0.6))
    assert len(bench.procedure.views) == 3
    bench.detector.next = Refusal(Fault.BLURRED, "the picture is blurred")
    bench.procedure.on_picture(PICTURE)
    bench.hold(frontal(0.3, 0.0, 0.6), 1)
    assert bench.complaints[-2:] == ["the picture is blurred", "the board is seen: hold it still"]


@pytest.mark.parametrize(
    ("tilt", "edge"), [((0.0, -0.5), "left"), ((0.0, 0.5), "right"), ((0.5, 0.0), "upper"), ((-0.5, 0.0), "lower")]
)
def test_the_edge_that_is_asked_for_is_the_one_that_is_near(tilt: tuple[float, float], edge: str) -> None:
    bench = Bench()
    for other in ((0.0, 0.5), (0.0, -0.5), (-0.5, 0.0), (0.5, 0.0)):
        if other != tilt:
            for x in (-0.2, 0.2):
                bench.hold(frontal(x, 0.0, 0.6, other))
    assert f"bring its {edge} edge towards the camera" in bench.procedure.missing()
    near = {"left": (0, -1), "right": (0, 1), "upper": (1, -1), "lower": (1, 1)}[edge]
    corners = frontal(0.0, 0.0, 0.6, tilt).apply(BOARD.outline)
    assert corners[corners[:, near[0]].argsort()[:: near[1]][-2:], 2].max() < 0.6, "that edge is nearer than the middle"
    for x in (-0.2, 0.2):
        bench.hold(frontal(x, 0.0, 0.6, tilt))
    assert "tilt" not in bench.procedure.missing()


def test_parts_of_the_picture_without_a_corner_are_asked_for() -> None:
    bench = Bench(count=1)
    for tilt in ((0.0, 0.5), (0.0, -0.5), (-0.5, 0.0), (0.5, 0.0)):
        for x in (-0.15, 0.15):
            bench.hold(frontal(x, 0.1, 0.45, tilt))
    assert bench.procedure.missing() == "bring the board into the picture's upper left part"
    assert not bench.procedure.is_complete
    for y in (-0.13, 0.0, 0.13):
        for x in (-0.28, -0.1, 0.1, 0.28):
            bench.hold(frontal(x, y, 0.4))
    assert bench.procedure.missing() == "" and bench.procedure.is_complete
    assert bench.procedure.extend() == 5 and not bench.procedure.is_complete


def test_real_pictures_are_read_without_knowing_the_lens() -> None:
    said: list[str] = []
    procedure = LensProcedure(BOARD, 15, Voice(said.append, said.append))
    drawn, rng = SyntheticCamera(BOARD, LENS), np.random.default_rng(0)
    for pose in (frontal(0.0, 0.0, 0.5), frontal(0.1, 0.05, 0.6, (0.4, 0.3))):
        for _ in range(2):
            procedure.on_picture(drawn.picture(pose, rng))
    assert len(procedure.views) == 2 and procedure.views[0].pixels.shape == (12, 2)
    assert procedure.views[1].tilt(BOARD.center) == pytest.approx(math.acos(math.cos(0.4) * math.cos(0.3)), abs=0.2)
    with pytest.raises(ImageError, match="the picture is"):
        procedure.on_picture(np.zeros((480, 640), np.uint8))


def test_the_figures_are_said() -> None:
    bench = Bench()
    bench.procedure.views = many(30)
    assert bench.procedure.solve().camera.fx == pytest.approx(560.0, abs=3.0)
    assert bench.said[0] == "30 views, 0 of them odd and left out"
    assert [line.split(":")[0] for line in bench.said[1:]] == [
        "fitted",
        "fx",
        "fy",
        "cx",
        "cy",
        "distortion (plumb_bob)",
    ]


def test_a_lens_comes_back_from_its_file_and_the_old_one_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "lens.yaml"
    assert write_lens(file, LENS) is None and read_lens(file) == LENS
    other = CameraModel(640, 480, 500.0, 500.0, 320.0, 240.0, "plumb_bob", (0.0,) * 5)
    kept = write_lens(file, other)
    assert kept is not None and read_lens(kept) == LENS and read_lens(file) == other
    storage = yaml.safe_load(file.read_text())
    assert storage["projection_matrix"]["data"] == [500.0, 0.0, 320.0, 0.0, 0.0, 500.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    assert (storage["camera_matrix"]["rows"], storage["projection_matrix"]["cols"]) == (3, 4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c.pop("camera_matrix"), "lacks camera_matrix"),
        (lambda c: c["camera_matrix"]["data"].pop(), "camera_matrix.data must be 9 finite numbers"),
        (lambda c: c["camera_matrix"].update(data=[float("nan")] * 9), "camera_matrix.data must be 9 finite numbers"),
        (lambda c: c.update(distortion_coefficients=3), "distortion_coefficients.data must be 0 or 4 or 5"),
        (lambda c: c.update(image_width=640.5), "image_width must be a whole number of pixels, got 640.5"),
        (lambda c: c.update(distortion_model="fish"), "'fish' is not supported"),
        (lambda c: c["camera_matrix"].update(data=[0.0] * 9), "focal lengths must be positive"),
    ],
)
def test_a_file_that_is_no_lens_is_refused_by_name(tmp_path: Path, change: Callable[[Any], Any], words: str) -> None:
    file = tmp_path / "lens.yaml"
    write_lens(file, LENS)
    content = yaml.safe_load(file.read_text())
    change(content)
    file.write_text(yaml.safe_dump(content))
    with pytest.raises(CalibrationError, match=words) as caught:
        read_lens(file)
    assert str(file) in str(caught.value) and "\n" not in str(caught.value)


def test_files_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    for name, content, words in (
        ("none", None, "No such file"), ("torn", b"a: [1", "is no YAML"), ("bytes", b"\xff\xfe\x00", "it is not text"),
        ("list", b"[1]", "lacks image_width"),
    ):  # fmt: skip
        file = tmp_path / name
        if content is not None:
            file.write_bytes(content)
        with pytest.raises(CalibrationError, match=words):
            read_lens(file)


def test_one_simulated_lens_is_found(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = CameraModel(640, 360, 480.0, 480.5, 321.0, 178.0, "plumb_bob", (-0.1, 0.05, 0.0005, 0.0, 0.0))
    monkeypatch.setattr(lens_simulation, "random_setup", lambda rng, board: SimpleNamespace(camera=small))
    monkeypatch.setattr(lens_simulation, "_VIEWS", 15)
    out = tmp_path / "lens.json"
    assert calibrate(["--simulate-lens", "1", "--seed", "4", "--out", str(out)]) == 0
    found = yaml.safe_load(out.read_text())
    assert found["found"] == 1 and found["greatest_focal_percent"] < 1.0 and found["greatest_worst_px"] < 3.0
    assert calibrate(["--simulate-lens", "0"]) == 1
    assert "--simulate-lens must be 1 or more" in capsys.readouterr().err
