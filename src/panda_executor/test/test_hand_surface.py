"""The points that stand for the hand and its load: where they lie, how dense they are, and none too few."""

from __future__ import annotations

import numpy as np
import pytest

from panda_executor.hand_geometry import Box, HandShape, HeldObject, _boxes, _hand_surface, _thinned
from panda_model import load_preset

HAND = load_preset().hand
UNDERSIDE, SIDE = 0.0045, 0.016  # spacing of the points [m]


def rows(points: np.ndarray) -> list[tuple[int, ...]]:
    """Return points in hundredths of a millimetre, sorted."""
    return sorted(map(tuple, np.round(points * 1e5).astype(int).tolist()))


def test_the_boxes_are_where_the_hand_is() -> None:
    palm, flange, *fingers = _boxes(HAND, 0.04)
    assert palm.lower == pytest.approx((-0.032, -0.103, -0.1334)) and palm.upper == (0.032, 0.103, -0.0375)
    assert flange.lower == pytest.approx((-0.045, -0.045, -0.2334)) and flange.upper == (0.045, 0.045, -0.1034)
    expected = [
        ((-0.0105, -0.0352, -0.0375), (0.0105, -0.02, 0.0095)),
        ((-0.0105, -0.046, -0.0375), (0.0105, -0.02, -0.0235)),
        ((-0.0105, 0.02, -0.0375), (0.0105, 0.0352, 0.0095)),
        ((-0.0105, 0.02, -0.0375), (0.0105, 0.046, -0.0235)),
    ]
    for box, (lower, upper) in zip(fingers, expected, strict=True):
        assert box.lower == pytest.approx(lower) and box.upper == pytest.approx(upper)
    assert _boxes(HAND, None) == _boxes(HAND, HAND.opening) == HandShape(HAND).boxes()


def test_a_grown_box_is_larger_on_each_side() -> None:
    grown = Box((-1.0, -2.0, -3.0), (4.0, 5.0, 6.0)).grown(0.25)
    assert grown == Box((-1.25, -2.25, -3.25), (4.25, 5.25, 6.25))


def test_a_boxs_points_lie_on_its_underside_and_its_sides() -> None:
    box = Box((-0.01, -0.02, -0.03), (0.02, 0.02, 0.01))
    points = box.surface()
    assert (points >= np.array(box.lower) - 1e-12).all() and (points <= np.array(box.upper) + 1e-12).all()
    under = points[points[:, 2] == 0.01]
    steps_x, steps_y = np.linspace(-0.01, 0.02, 8), np.linspace(-0.02, 0.02, 10)  # 4.3 and 4.4 mm apart
    assert {(round(x, 6), round(y, 6)) for x, y, _ in under} >= {
        (round(x, 6), round(y, 6)) for x in steps_x for y in steps_y
    }
    for axis in (0, 1):
        for side in (box.lower[axis], box.upper[axis]):
            other = 1 - axis
            face = points[points[:, axis] == side]
            assert {round(v, 6) for v in face[:, 2]} == {round(v, 6) for v in np.linspace(-0.03, 0.01, 4)}
            higher = face[face[:, 2] < 0.0]
            count = 3 if other == 0 else 4  # 30 and 40 mm in steps of 16 at most
            assert len(np.unique(np.round(higher[:, other], 6))) == count
    assert len(points[points[:, 2] < -0.025]) == 2 * 3 + 2 * 4


@pytest.mark.parametrize(("width", "margin"), [(None, 0.0), (0.013, 0.0), (0.0314, 0.01), (0.0, 0.0053)])
def test_the_hands_surface_is_that_of_its_boxes_with_each_point_once(width: float | None, margin: float) -> None:
    boxes = [box.grown(margin).surface() for box in _boxes(HAND, width)]
    expected = np.unique(np.round(np.concatenate(boxes), 5), axis=0)
    found = _hand_surface(HAND, width, margin)
    assert rows(found) == rows(expected)
    assert not found.flags.writeable
    np.testing.assert_array_equal(HandShape(HAND, width, margin=margin).points, found)


CELLS = np.array([[x, y] for x in np.arange(-0.02, 0.021, 0.0025) for y in np.arange(-0.01, 0.031, 0.0025)])


def test_one_point_is_kept_of_each_square() -> None:
    for spacing in (UNDERSIDE, SIDE):
        kept = _thinned(CELLS, spacing)
        squares = {tuple(s) for s in np.floor(CELLS / spacing).astype(int).tolist()}
        assert len(kept) == len(squares)
        assert {tuple(s) for s in np.floor(kept / spacing).astype(int).tolist()} == squares
        assert {tuple(p) for p in kept.tolist()} <= {tuple(p) for p in CELLS.tolist()}


@pytest.mark.parametrize(("above", "top"), [(0.02, -0.02), (0.09, -HAND.palm_above_tcp)])
def test_a_load_reaches_from_its_underside_to_its_top_or_the_palm(above: float, top: float) -> None:
    held = HeldObject(CELLS, 0.03, above)
    points = held.surface(HAND.palm_above_tcp)
    levels = np.unique(points[:, 2])
    assert levels[[0, -1]] == pytest.approx([top, 0.03])
    assert len(levels) == max(2, int(np.ceil((0.03 - top) / SIDE)) + 1)
    np.testing.assert_allclose(np.diff(levels), (0.03 - top) / (len(levels) - 1))
    for level in levels:
        spacing = UNDERSIDE if level == levels[-1] else SIDE
        assert rows(points[points[:, 2] == level, :2]) == rows(_thinned(CELLS, spacing))
    outline = held.outline(HAND)
    assert np.unique(outline[:, 2]) == pytest.approx([top, 0.03])
    assert rows(outline[:, :2]) == sorted(2 * rows(_thinned(CELLS, SIDE)))


def test_a_margin_is_kept_round_the_load() -> None:
    """Round one cell the points lie on a ring of eight, as far away as the margin, and as far below."""
    one = HeldObject(np.array([[0.001, 0.002]]), 0.03, 0.01)
    points = one.surface(HAND.palm_above_tcp, 0.01)
    assert points[:, 2].max() == pytest.approx(0.04) and points[:, 2].min() == pytest.approx(-0.02)
    away = np.linalg.norm(points[:, :2] - [0.001, 0.002], axis=1)
    np.testing.assert_allclose(away, 0.01)
    under = points[points[:, 2] == points[:, 2].max(), :2] - [0.001, 0.002]
    angles = np.sort(np.degrees(np.arctan2(under[:, 1], under[:, 0])).round(3) % 360.0)
    assert set(angles) <= {0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0} and len(angles) >= 6


def test_a_shape_has_its_hands_points_and_its_loads() -> None:
    held = HeldObject(CELLS, 0.03, 0.02)
    shape = HandShape(HAND, 0.04, held, 0.005)
    bare = HandShape(HAND, 0.04, margin=0.005)
    assert rows(shape.points) == rows(np.concatenate([bare.points, held.surface(HAND.palm_above_tcp, 0.005)]))
    assert rows(shape.load) == rows(held.outline(HAND)) and not shape.points.flags.writeable
    middle, radius = shape.load_ball
    np.testing.assert_allclose(middle, (shape.load.min(axis=0) + shape.load.max(axis=0)) / 2.0)
    away = np.linalg.norm(shape.load - middle, axis=1)
    assert away.max() < radius <= away.max() + 2e-9
    assert bare.load.shape == (0, 3) and 0.0 <= bare.load_ball[1] < 1e-8
    np.testing.assert_array_equal(bare.load_ball[0], np.zeros(3))
