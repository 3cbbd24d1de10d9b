from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import yaml

from cliport_core import PixelOutsideError, WorkspaceError, WorkspaceSpec

SHIPPED = Path(__file__).resolve().parents[3] / "calibration" / "workspace.yaml"


def test_default_grid_is_320_by_160() -> None:
    spec = WorkspaceSpec()
    assert spec.shape == (spec.rows, spec.cols) == (320, 160)


def test_every_pixel_centre_returns_to_its_pixel() -> None:
    spec = WorkspaceSpec()
    for row in range(spec.rows):
        for col in range(0, spec.cols, 7):
            assert spec.xy_to_pixel(*spec.pixel_to_xy(row, col)) == (row, col)


def test_any_inside_point_is_within_half_a_pixel_of_its_pixel() -> None:
    spec = WorkspaceSpec()
    rng = np.random.default_rng(0)
    for x, y in rng.uniform((spec.x_min, spec.y_min), (spec.x_max, spec.y_max), (500, 2)):
        centre = spec.pixel_to_xy(*spec.xy_to_pixel(x, y))
        assert max(abs(centre[0] - x), abs(centre[1] - y)) <= spec.pixel_size / 2 + 1e-9


def test_corners_follow_the_axes() -> None:
    spec = WorkspaceSpec()
    assert spec.pixel_to_xy(0, 0) == pytest.approx((0.25125, -0.39875))
    assert spec.pixel_to_xy(319, 159) == pytest.approx((0.64875, 0.39875))


@pytest.mark.parametrize("xy", [(0.2499, 0.0), (0.65, 0.0), (0.4, 0.4), (0.4, -0.41), (math.nan, 0.0)])
def test_positions_outside_are_refused_with_the_bounds(xy: tuple[float, float]) -> None:
    spec = WorkspaceSpec()
    assert not spec.contains_xy(*xy)
    with pytest.raises(PixelOutsideError, match=r"x 0.25..0.65, y -0.4..0.4"):
        spec.xy_to_pixel(*xy)


def test_yaw_bins_round_trip_over_any_turn() -> None:
    spec = WorkspaceSpec()
    for index in range(spec.n_rotations):
        for turn in (-2, 0, 3):
            assert spec.bin_of_yaw(spec.yaw_of_bin(index) + turn * 2 * math.pi) == index
    assert spec.bin_of_yaw(math.radians(-4.9)) == 0
    assert spec.bin_of_yaw(math.radians(-5.1)) == 35


def test_dict_and_file_round_trip(tmp_path: Path) -> None:
    spec = WorkspaceSpec(x_min=0.3, x_max=0.5, pixel_size=0.005, n_rotations=12)
    assert WorkspaceSpec.from_dict(spec.to_dict()) == spec
    path = tmp_path / "workspace.yaml"
    path.write_text(yaml.safe_dump({"workspace": spec.to_dict()}))
    assert WorkspaceSpec.load(path) == spec


@pytest.mark.skipif(not SHIPPED.exists(), reason="the repository's calibration folder is not here")
def test_the_shipped_workspace_is_the_default() -> None:
    assert WorkspaceSpec.load(SHIPPED) == WorkspaceSpec()


@pytest.mark.parametrize(
    "values",
    [{"x_min": 0.7}, {"pixel_size": 0.003}, {"pixel_size": -1}, {"n_rotations": 0}, {"z_max": math.nan},
     {"x_minimum": 0.2}, {"x_min": "left"}, {"x_min": None}],
)  # fmt: skip
def test_impossible_values_are_refused(values: dict[str, object]) -> None:
    with pytest.raises(WorkspaceError):
        WorkspaceSpec.from_dict(values)


@pytest.mark.parametrize("text", [None, "- 1\n", "workspace: 3\n", "workspace: {x_min: [}\n", "\x00"])
def test_bad_files_end_in_one_line_that_names_them(tmp_path: Path, text: str | None) -> None:
    path = tmp_path / "w.yaml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(WorkspaceError, match=r"w\.yaml") as caught:
        WorkspaceSpec.load(path)
    assert "\n" not in str(caught.value)


def test_points_as_arrays_agree_with_single_ones() -> None:
    workspace = WorkspaceSpec()
    points = np.random.default_rng(0).uniform((0.2, -0.5, 0.0), (0.7, 0.5, 0.1), (50, 4, 3))
    inside = workspace.contains(points)
    assert 0 < inside.sum() < inside.size
    pixels = workspace.to_pixels(points)
    for index in np.ndindex(inside.shape):
        x, y, _ = points[index]
        assert inside[index] == workspace.contains_xy(x, y)
        if inside[index]:
            assert tuple(pixels[index]) == workspace.xy_to_pixel(x, y)


def test_a_border_narrows_and_widens_the_bounds() -> None:
    workspace = WorkspaceSpec()
    edge = (workspace.x_min + 0.01, 0.0)
    assert workspace.contains(edge)
    assert not workspace.contains(edge, border=0.02)
    assert workspace.contains((workspace.x_min - 0.01, 0.0), border=-0.02)


@pytest.mark.parametrize(
    "spec", [WorkspaceSpec(), WorkspaceSpec(x_min=0.1, x_max=0.7, y_min=-0.3, y_max=0.3, pixel_size=0.003)]
)
def test_no_rounding_moves_a_point_over_the_upper_bounds(spec: WorkspaceSpec) -> None:
    just_inside = (np.nextafter(spec.x_max, 0.0), np.nextafter(spec.y_max, 0.0))
    assert spec.contains(just_inside)
    assert spec.to_pixels(just_inside).tolist() == [spec.rows - 1, spec.cols - 1]
    assert spec.xy_to_pixel(*just_inside) == (spec.rows - 1, spec.cols - 1)
    assert not spec.contains((spec.x_max, 0.0)) and not spec.contains((spec.x_min, spec.y_max))
    assert spec.to_pixels((spec.x_max, spec.y_max)).tolist() == [spec.rows, spec.cols]
    assert spec.to_pixels((np.nextafter(spec.x_min, 0.0), np.nextafter(spec.y_min, -1.0))).tolist() == [-1, -1]


@pytest.mark.parametrize("pixels", [1e-8, 0.4, 0.5, 1.5, 2.00001])
def test_less_than_a_pixel_or_a_part_of_one_makes_no_grid(pixels: float) -> None:
    with pytest.raises(WorkspaceError, match="not a whole number"):
        WorkspaceSpec(x_min=0.0, x_max=pixels * 0.0025)
    assert WorkspaceSpec(x_min=0.0, x_max=0.0025).cols == 1
