"""Every stroke and every text of the pictures, computed by hand; what lies where in the large ones."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from matplotlib.figure import Figure

from cliport_core.action import PickPlaceAction
from cliport_core.heightmap import Heightmap
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy import explain_picture, overlays
from cliport_policy.data.batches import Batch
from cliport_policy.inference import AffordanceMaps, Explanation, Inference
from cliport_policy.observation import observation_tensor
from cliport_policy.reliability_plot import plot_reliability
from cliport_policy.training import sample_sheet as sheets
from panda_model import load_preset

WORKSPACE = WorkspaceSpec(pixel_size=0.0125)  # 64 x 32 pixels; 192 x 96 in a picture
PICK, PLACE = PlanarPose(0.45, 0.1, 0.5), PlanarPose(0.5, -0.2, -1.0)
INFERENCE = Inference(PickPlaceAction(PICK, PLACE), (40, 16), (16, 20), 0.75, 0.25, 0.125)
RED, GREEN, WHITE, BLACK, GRAY = (255, 60, 60), (60, 255, 90), (255, 255, 255), (0, 0, 0), (235, 235, 235)
Stroke = tuple[Any, ...]


@pytest.fixture
def strokes(monkeypatch: pytest.MonkeyPatch) -> list[Stroke]:
    """What is drawn, in order: (kind, its arguments); nothing of it is drawn in earnest."""
    found: list[Stroke] = []
    for kind in ("line", "circle", "putText"):
        monkeypatch.setattr(cv2, kind, lambda _, *arguments, kind=kind: found.append((kind, *arguments)))
    return found


def scene() -> Heightmap:
    rng = np.random.default_rng(0)
    color = rng.integers(0, 255, (64, 32, 3), dtype=np.uint8)
    height = rng.uniform(-0.05, 0.2, (64, 32)).astype(np.float32)
    return Heightmap(color, height, rng.random((64, 32)) > 0.1, WORKSPACE, 1)


def at(x: float, y: float) -> tuple[int, int]:
    """Three pixels of the picture a pixel of 12.5 mm: +x up, +y left."""
    return round((0.4 - y) * 240), round((0.65 - x) * 240)


def gripper(pose: PlanarPose, color: tuple[int, int, int], thickness: int) -> list[Stroke]:
    hand, found = load_preset().hand, []
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    for side in (-1, 1):
        x, y = pose.x + side * hand.opening / 2 * cos, pose.y + side * hand.opening / 2 * sin
        half = hand.finger_half_width
        ends = at(x + half * sin, y - half * cos), at(x - half * sin, y + half * cos)
        found += [
            ("line", *ends, color, thickness + 1, cv2.LINE_AA),
            ("line", at(pose.x, pose.y), at(x, y), color, thickness, cv2.LINE_AA),
        ]
    return [*found, ("circle", at(pose.x, pose.y), 3 + thickness, color, -1, cv2.LINE_AA)]


def overlay(kind: str, confidence: str) -> list[Stroke]:
    drawn = gripper(PICK, RED, 3 if kind == "pick" else 1) + gripper(PLACE, GREEN, 3 if kind == "place" else 1)
    text = f"{kind} {confidence}   done 0.12"
    font = cv2.FONT_HERSHEY_SIMPLEX
    drawn += [("putText", text, (10, 24), font, 0.6, *ink, cv2.LINE_AA) for ink in ((BLACK, 4), (WHITE, 1))]
    return drawn


def words(text: str, place: tuple[int, int] = (8, 21)) -> Stroke:
    return ("putText", text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.55, GRAY, 1, cv2.LINE_AA)


@pytest.mark.parametrize(("kind", "confidence"), [("pick", "0.75"), ("place", "0.25")])
def test_strokes_of_an_overlay(kind: str, confidence: str, strokes: list[Stroke]) -> None:
    overlays.render_overlay(scene(), None, INFERENCE, kind)
    assert strokes == overlay(kind, confidence)


def test_heat_is_mixed_by_its_root(strokes: list[Stroke]) -> None:
    """A quarter of the peak is half of the heat; 65 % of it is seen at the peak."""
    table = Heightmap(
        np.full((64, 32, 3), 100, np.uint8), np.zeros((64, 32), np.float32), scene().valid | True, WORKSPACE
    )
    for share, heat in ((1.0, 255), (0.25, 127), (0.0, 0)):
        cells = np.full((64, 32), share, np.float32)
        cells[0, 0] = 1.0
        shown = overlays.render_overlay(table, cells, INFERENCE, "pick")[20, 20]
        color = cv2.applyColorMap(np.uint8([[heat]]), cv2.COLORMAP_JET)[0, 0, ::-1].astype(float)
        mix = 0.65 * share**0.5
        np.testing.assert_allclose(shown, 100 * (1 - mix) + color * mix, atol=1)


def test_heights_are_colours_up_to_fifteen_centimetres() -> None:
    seen = scene()
    seen.height[:5, 0] = (-0.1, 0.0, 0.075, 0.15, 0.3)
    seen.valid[:6, 0] = (True, True, True, True, True, False)
    shown = explain_picture.render_height(seen)[::-1, ::-1][1::3, 1::3]  # (32, 64), columns first
    expected = cv2.applyColorMap(np.uint8([[0], [0], [127], [255], [255]]), cv2.COLORMAP_VIRIDIS)[:, 0, ::-1]
    np.testing.assert_array_equal(shown[0, :5], expected)
    assert (shown[0, 5] == 40).all()


def test_the_crop_shows_what_lies_around_the_pick_with_x_up(strokes: list[Stroke]) -> None:
    color = np.full((320, 160, 3), 10, np.uint8)
    color[161:, 81:] = (200, 100, 50)  # +y and +x of the pick: to the left and up
    valid = np.ones((320, 160), bool)
    valid[:161, :81] = False  # to the right and down
    seen = Heightmap(color, np.zeros((320, 160), np.float32), valid, WorkspaceSpec(), 0)
    crop = explain_picture.render_crop(seen, (160, 80), 0.0)
    assert (crop[:186, :186] == (200, 100, 50)).all() and (crop[198:, 198:] == 0).all()
    assert (crop[:186, 198:] == 10).all() and (crop[198:, :186] == 10).all()
    assert strokes == [
        ("line", (168, 96), (216, 96), RED, 3, cv2.LINE_AA), ("line", (192, 192), (192, 96), RED, 1, cv2.LINE_AA),
        ("line", (168, 288), (216, 288), RED, 3, cv2.LINE_AA), ("line", (192, 192), (192, 288), RED, 1, cv2.LINE_AA),
    ]  # fmt: skip


def test_rotations_are_bars_from_the_inner_circle(strokes: list[Stroke]) -> None:
    """0 degrees up, 90 left; the likeliest reaches the outer circle."""
    picture = explain_picture.render_rotations(np.array([0.1, 0.4, 0.2, 0.3], np.float32), RED)
    assert picture.shape == (384, 384, 3) and (picture == (24, 24, 28)).all()
    frames = [("circle", (192, 192), radius, (110, 110, 120), 1, cv2.LINE_AA) for radius in (48, 180)]
    bars = [((192, 144), (192, 111), GRAY), ((144, 192), (12, 192), RED), ((192, 240), (192, 306), GRAY),
            ((240, 192), (339, 192), GRAY)]  # fmt: skip
    assert strokes == [*frames, *(("line", *bar, 50, cv2.LINE_AA) for bar in bars)]
    strokes.clear()
    explain_picture.render_rotations(np.full(150, 1 / 150, np.float32), RED)
    assert {stroke[4] for stroke in strokes if stroke[0] == "line"} == {2}
    strokes.clear()
    explain_picture.render_rotations(None, RED)
    assert strokes == [*frames, words("none", (172, 198))]


@pytest.mark.parametrize("recorded", [False, True])
def test_an_explanation_from_its_parts(recorded: bool, strokes: list[Stroke]) -> None:
    seen, cells = scene(), np.ones((64, 32), np.float32)
    inference = replace(INFERENCE, maps=AffordanceMaps(cells, 2 * cells))
    explanation = Explanation(inference, np.array([0.25, 0.75], np.float32), np.array([0.5, 0.5], np.float32))
    picture = explain_picture.render_explanation(seen, "put it there", explanation, (PLACE, PICK) if recorded else None)
    texts = [stroke for stroke in strokes if stroke[0] == "putText"]
    second = words("as recorded" if recorded else "height, 0 to 15 cm")
    assert [text for text in texts if text[4] == 0.55] == [
        words("what is seen"), second, words("pick affordance"), words("place affordance"),
        words("at the pick, turned"), words("gripper yaw: 180 degrees, 0.75"), words("place - pick: 0 degrees, 0.50"),
        words("put it there"),
        words("pick 0.75 at (0.450, 0.100) m   place 0.25 at (0.500, -0.200) m   done 0.12"),
    ]  # fmt: skip
    assert strokes[:1] == [words("what is seen")]
    if recorded:
        assert strokes[1:12] == [*gripper(PLACE, RED, 2), *gripper(PICK, GREEN, 2), second]
    background, title = (24, 24, 28), np.full((30, 384, 3), (24, 24, 28))
    other = overlays.render_scene(seen) if recorded else explain_picture.render_height(seen)
    upper = np.hstack([overlays.render_scene(seen), other])
    lower = np.hstack([overlays.render_overlay(seen, each, inference, "pick") for each in (cells, 2 * cells)])
    np.testing.assert_array_equal(picture[90:186, :384], upper)
    np.testing.assert_array_equal(picture[216:312, :384], lower)
    crop = explain_picture.render_crop(seen, (40, 16), 0.5)
    np.testing.assert_array_equal(picture[342:726, :384], crop)
    assert picture.shape == (726, 3 * 384, 3) and (picture[:, 384:] == background).all()
    assert (picture[:90, :384] == background).all() and (picture[186:216, :384] == title).all()


def test_without_a_rotator_there_is_no_best_yaw(strokes: list[Stroke]) -> None:
    explanation = Explanation(INFERENCE, None, np.array([0.1, 0.2, 0.7], np.float32))
    explain_picture.render_explanation(scene(), "x", explanation)
    assert words("gripper yaw: this network has no rotator") in strokes
    assert words("place - pick: 240 degrees, 0.70") in strokes


def _samples(n: int) -> Batch:
    row, col = torch.tensor([[20.0, 10.0]]), torch.tensor([[40.0, 25.0]])
    flags = torch.arange(n)
    return Batch(
        torch.cat([observation_tensor(scene())] * n), [f"do {i}" for i in range(n)], flags == 1, row.expand(n, -1),
        torch.full((n,), 0.25), torch.full((n,), math.pi), col.expand(n, -1), torch.full((n,), 0.5), flags,
        absent=flags == 2,
    )  # fmt: skip


def test_a_sheet_of_samples(strokes: list[Stroke], monkeypatch: pytest.MonkeyPatch) -> None:
    drawn: list[tuple[Heightmap, PlanarPose, PlanarPose]] = []

    def note(seen: Heightmap, pick: PlanarPose, place: PlanarPose) -> np.ndarray:
        drawn.append((seen, pick, place))
        return np.full((96, 192, 3), 7, np.uint8)

    monkeypatch.setattr(sheets, "render_grippers", note)
    sheet = sheets.sample_sheet(_samples(4), WORKSPACE)
    tile = 30 + 240  # 480 pixels wide, and half as high, under a line
    assert sheet.shape == (2 * tile, 3 * 480, 3)
    assert (
        (sheet[tile:, 480:] == 0).all() and (sheet[30:tile, :480] == 7).all() and (sheet[tile + 30 :, :480] == 7).all()
    )
    small = cv2.resize(overlays.render_scene(drawn[0][0]), (480, 240), interpolation=cv2.INTER_AREA)
    for i in (1, 2):
        np.testing.assert_array_equal(sheet[30:tile, 480 * i : 480 * (i + 1)], small)
    assert strokes == [words(text) for text in ("do 0", "do 1   (finished)", "do 2   (not here)", "do 3")]
    seen, pick, place = drawn[0]
    truth = scene()
    np.testing.assert_array_equal(seen.valid, truth.valid)
    np.testing.assert_array_equal(seen.color, truth.color * truth.valid[..., None])
    np.testing.assert_allclose(seen.height, truth.height * truth.valid, atol=1e-6)
    for pose, (row, col), yaw in ((pick, (20, 10), 0.25), (place, (40, 25), 0.75)):
        assert (pose.x, pose.y) == pytest.approx(WORKSPACE.pixel_to_xy(row, col)) and pose.yaw == pytest.approx(yaw)
    assert sheets.sample_sheet(_samples(14), WORKSPACE).shape == (4 * tile, 3 * 480, 3)


def test_the_plot_of_reliability(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Confidences 0.05 and 0.07 share a bin, as 0.95 and 1.0 do; its share of right answers is drawn at their mean."""
    figures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, dpi: figures.append(figure))
    confidence, right = np.array([0.05, 0.07, 0.45, 0.95, 1.0]), np.array([True, False, False, True, True])
    plot_reliability(np.array([0.9, 0.95]), np.array([0.05]), confidence, right, tmp_path / "new" / "plot.png")
    bars, curve = figures[0].axes
    assert (tmp_path / "new").is_dir() and figures[0].get_size_inches().tolist() == [9, 3.6]
    heights = [[patch.get_height() for patch in group] for group in bars.containers]
    assert heights == [[1, *[0] * 9], [*[0] * 9, 2]]
    assert [text.get_text() for text in bars.get_legend().get_texts()] == ["unfinished", "finished"]
    diagonal, dots = (line.get_xydata().tolist() for line in curve.lines)
    assert diagonal == [[0, 0], [1, 1]]
    np.testing.assert_allclose(dots, [[0.06, 0.5], [0.45, 0.0], [0.975, 1.0]])
    notes = [(text.get_text(), *text.xy) for text in curve.texts]
    assert [note[0] for note in notes] == ["2", "1", "2"]
    np.testing.assert_allclose([note[1:] for note in notes], dots)
    assert curve.get_xlim() == (0, 1.02) and curve.get_ylim() == (0, 1.05)
