from __future__ import annotations

import math

import cv2
import numpy as np
import pytest

from cliport_perception import CameraModel, CameraModelError

PLUMB_BOB = (0.09, -0.2, 0.0008, -0.0005, 0.08)
RATIONAL = (0.52, -2.6, 0.0006, -0.0003, 1.5, 0.40, -2.4, 1.4)  # as an Azure Kinect's


def model(name: str, coefficients: tuple[float, ...]) -> CameraModel:
    return CameraModel(960, 540, 540.0, 542.0, 478.3, 268.9, name, coefficients)


@pytest.mark.parametrize(
    ("name", "coefficients"),
    [("plumb_bob", PLUMB_BOB), ("rational_polynomial", RATIONAL), ("plumb_bob", (0.0,) * 5), ("", ())],
)
def test_rays_project_back_onto_their_pixels(name: str, coefficients: tuple[float, ...]) -> None:
    camera = model(name, coefficients)
    rays = camera.rays()
    assert rays.shape == (540, 960, 3)
    assert rays.dtype == np.float32
    assert np.all(rays[..., 2] == 1.0)
    d = np.array(coefficients) if coefficients else np.zeros(5)
    rows, cols = np.mgrid[0:540:13, 0:960:17]
    points = rays[rows, cols].reshape(-1, 1, 3).astype(np.float64) * 1.3
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.matrix, d)
    np.testing.assert_allclose(pixels[:, 0, 0], cols.ravel(), atol=0.02)
    np.testing.assert_allclose(pixels[:, 0, 1], rows.ravel(), atol=0.02)


def test_project_gives_row_and_column() -> None:
    camera = model("plumb_bob", PLUMB_BOB)
    pixels = camera.project(2.0 * camera.rays()[[10, 500], [900, 30]])
    np.testing.assert_allclose(pixels, [[10, 900], [500, 30]], atol=0.02)


def test_rays_are_cached_and_read_only() -> None:
    camera = model("plumb_bob", PLUMB_BOB)
    assert camera.rays() is camera.rays()
    assert not camera.rays().flags.writeable


@pytest.mark.parametrize(
    ("change", "text"),
    [({"fx": 0.0}, "calibrated"), ({"cy": math.nan}, "calibrated"), ({"width": 0}, "empty"),
     ({"distortion_model": "equidistant", "distortion": (0.1,) * 4}, "plumb_bob, rational_polynomial"),
     ({"distortion": (0.1, 0.2)}, "coefficients")],
)  # fmt: skip
def test_unusable_cameras_are_refused(change: dict[str, object], text: str) -> None:
    values: dict[str, object] = {"width": 64, "height": 48, "fx": 50.0, "fy": 50.0, "cx": 32.0, "cy": 24.0}
    with pytest.raises(CameraModelError, match=text):
        CameraModel(**{**values, **change})  # type: ignore[arg-type]
