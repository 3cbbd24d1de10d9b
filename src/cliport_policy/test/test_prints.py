"""Prints of what is picked: found by colour and outline, turned as they lie, and taken before all other places."""

import math
from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from cliport_core.heightmap import Heightmap
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.fits import share_of_prints, with_prints
from cliport_policy.networks.policy_network import Goal
from cliport_policy.networks.rotation import bin_angles
from cliport_policy.observation import observation_tensor
from cliport_policy.peaks import CellGrid, Peak, best_rotation, mass_of
from cliport_policy.places import Places, Printed
from cliport_policy.policy import Policy, load_policy
from cliport_policy.shapes.prints import Outline, Print, covered_at, outline_at, prints_at
from cliport_policy.sides import Side
from cliport_policy.turns import likeliest_turn

SPEC = WorkspaceSpec()
GRID = CellGrid(SPEC, 2)
ANGLES = bin_angles(36)
PICK = (60, 40)
HOOK = np.array([(-12, -9), (12, -9), (12, -2), (-4, -2), (-4, 9), (-12, 9)])  # an L, (row, col)
TRIANGLE = np.array([(-12, -9), (12, -2), (-4, 9)])


class Scene:
    """Table with a dark print here and there on a brown plate, and a hook that is to be put on one."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self.color = np.full((*SPEC.shape, 3), (165, 120, 95), np.uint8)
        self.height = np.zeros(SPEC.shape, np.float32)
        self._noise = rng.normal(0, 3, self.color.shape)
        self._draw(HOOK, PICK, 0.3, (78, 121, 167), 0.02)

    def show(self, shape: NDArray[np.int64], at: tuple[int, int], turn: float, stands: float = 0.0) -> None:
        """Show a shape, turned by an angle [rad] against the hook."""
        self._draw(shape, at, 0.3 + turn, (50, 50, 50), stands)

    def _draw(
        self, shape: NDArray[np.int64], at: tuple[int, int], angle: float, color: tuple[int, int, int], height: float
    ) -> None:
        x, y = shape[:, 1], shape[:, 0]
        turned = np.stack([math.cos(angle) * x - math.sin(angle) * y, math.sin(angle) * x + math.cos(angle) * y], 1)
        corners = np.rint(np.add(turned, at[::-1])).astype(np.int32)
        cv2.fillPoly(self.color, [corners], color)
        cv2.fillPoly(self.height, [corners], height)

    def heightmap(self) -> Heightmap:
        """Return what is seen."""
        color = np.clip(self.color + self._noise, 0, 255).astype(np.uint8)
        return Heightmap(color, self.height, np.ones(SPEC.shape, np.bool_), SPEC)

    def image(self) -> torch.Tensor:
        """Return what is seen as a network sees it."""
        return observation_tensor(self.heightmap())


def outline_of(scene: Scene, pick: tuple[int, int] = PICK, yaw: float = 0.0) -> Outline:
    found = outline_at(scene.image(), pick, yaw, SPEC.pixel_size)
    assert found is not None
    return found


def prints_of(scene: Scene, *places: tuple[int, int], pick: tuple[int, int] = PICK) -> list[Print]:
    return prints_at(scene.image(), outline_of(scene, pick), places, ANGLES, SPEC.pixel_size)


def test_a_print_is_found_beside_a_place_turned_and_told_from_others() -> None:
    scene = Scene()
    scene.show(HOOK, (200, 60), math.radians(120))
    scene.show(TRIANGLE, (200, 110), 0.0)
    hook, triangle, far = prints_of(scene, (203, 58), (200, 110), (218, 60))
    (row, col), cos, sin = outline_of(scene).held, math.cos(math.radians(120)), math.sin(math.radians(120))
    held = 200 + cos * row + sin * col, 60 - sin * row + cos * col  # x goes along columns, y along rows
    assert math.dist(hook.pixel, held) < 1.5 and hook.turn == pytest.approx(math.radians(120), abs=0.06)
    assert hook.contrast > 40 and triangle.contrast < 8
    assert far.contrast < 8, "so far beside a place nothing is looked for"


def test_an_outline_is_of_the_whole_thing_wherever_it_is_picked() -> None:
    scene = Scene()
    blue = np.argwhere(scene.height > 0)
    for pick in ((56, 37), (52, 30)):
        found = outline_of(scene, pick)
        assert set(map(tuple, found.inside.astype(int) + pick)) <= set(map(tuple, blue))
        assert not set(map(tuple, found.around.astype(int) + pick)) & set(map(tuple, blue))
    assert outline_at(scene.image(), (120, 40), 0.0, SPEC.pixel_size) is None, "nothing stands there"
    scene.height[:] = 0.0
    scene.height[50:70, 40:42] = 0.02
    assert outline_at(scene.image(), PICK, 0.0, SPEC.pixel_size) is None, "too thin to say anything"


def test_of_two_things_side_by_side_the_outline_is_that_of_the_one_that_is_picked() -> None:
    scene = Scene()
    scene.height[:] = 0.0
    scene.height[40:56, 30:50] = scene.height[58:74, 30:50] = 0.02
    for row, middle in ((58, 65.5), (55, 47.5)):  # at an edge each, three pixels from the other
        assert abs(outline_of(scene, (row, 40)).inside[:, 0].mean() + row - middle) < 1


@pytest.mark.parametrize(
    ("corners", "yaw", "held"),
    [
        ([(-9, -6), (9, -6), (9, 6), (-9, 6)], 0.3, (0, 0)),
        ([(-9, -6), (9, -6), (-9, 12)], 0.0, (-3, 2)),  # midway between what jaws of 21 mm touch, which close along x
        ([(-9, -6), (9, -6), (-9, 12)], math.pi / 2, (-1, 0)),
        ([(-10, -10), (10, -10), (10, -6), (-6, -6), (-6, 10), (-10, 10)], 0.0, (-3.6, 0)),  # in its corner
        ([(-9, -20), (9, -20), (9, 20), (-9, 20)], 0.0, (-3, -8)),  # too wide: where it is picked
    ],
)
def test_a_thing_is_held_between_what_jaws_touch(
    corners: list[tuple[int, int]], yaw: float, held: tuple[int, int]
) -> None:
    scene, pick = Scene(), (57, 32)
    scene.height[:] = 0.0
    cv2.fillPoly(scene.height, [np.array([(col + 40, row + 60) for row, col in corners], np.int32)], 0.02)
    found = outline_of(scene, pick, yaw)
    assert math.dist(np.add(found.held, pick), np.add(PICK, held)) < 1


@pytest.mark.parametrize(
    ("yaw", "square"), [(0.3, 0.3), (0.5, 0.3), (0.3 + 1.4, 0.3 + math.pi / 2), (0.3 - 0.25, 0.3), (0.8, 0.8)]
)
def test_jaws_that_are_nearly_square_with_a_thing_are_made_so(yaw: float, square: float) -> None:
    assert outline_of(Scene(), yaw=yaw).yaw == pytest.approx(square, abs=0.05)


def test_what_is_held_off_its_pick_is_put_as_far_off() -> None:
    scene = Scene()
    scene.color[:, :, :] = (165, 120, 95)
    scene.height[:] = 0.0
    scene._draw(TRIANGLE, PICK, 0.3, (78, 121, 167), 0.02)
    scene.show(TRIANGLE, (200, 60), math.radians(90))
    held = [np.add(outline_of(scene, pick).held, pick) for pick in (PICK, (57, 39))]
    at = [prints_of(scene, (200, 60), pick=pick)[0] for pick in (PICK, (57, 39))]
    assert math.dist(*held) < 1 and math.dist(at[0].pixel, at[1].pixel) < 2
    assert [one.turn for one in at] == pytest.approx([math.radians(90)] * 2, abs=0.06)


def test_where_something_stands_there_is_no_print_but_a_hole_is_one() -> None:
    for stands, found in ((0.02, False), (-0.01, True)):
        scene = Scene()
        scene.show(HOOK, (200, 60), 0.0, stands)
        assert (prints_of(scene, (200, 60))[0].contrast > 8) == found


def test_what_hides_a_print_is_known_by_its_outline_and_what_it_lies_on() -> None:
    scene = Scene()
    scene.height[150:] += 0.005  # a plate
    scene.show(HOOK, (200, 60), math.radians(120))
    on_plate, beside, other = (250, 40), (110, 60), (250, 110)
    for shape, at in ((HOOK, on_plate), (HOOK, beside), (TRIANGLE, other)):
        scene.show(shape, at, math.radians(70), 0.025)
    outline = outline_of(scene)
    found = prints_at(scene.image(), outline, [(200, 60)], ANGLES, SPEC.pixel_size)[0]
    covered = covered_at(scene.image(), outline, PICK, found, SPEC.pixel_size)
    assert len(covered) == 1 and math.dist(covered[0], on_plate) < 6
    assert math.dist(found.centre, (200, 60)) < 6


def test_the_middle_of_three_prints_is_known_where_one_of_them_is_covered() -> None:
    scene = Scene()
    scene.height[150:] += 0.005
    at = [(180, 60), (220, 64), (260, 60)]
    for pixel in at[:2]:
        scene.show(HOOK, pixel, 0.0)
    scene.show(HOOK, at[2], 1.0, 0.025)
    pick, image = Peak(PICK, GRID.disc(GRID.cell_of(PICK))), scene.image()
    chooser = Places(SimpleNamespace(cell_size=2), GRID, fits_prints=True)  # type: ignore[arg-type]
    for side, expected in ((Side.MIDDLE, at[1]), (Side.LEFT, at[0]), (Side.RIGHT, at[1])):
        found = chooser.on_prints(image, pick, None, _likely({at[0]: 0.6, at[1]: 0.4}), side)
        assert found is not None
        mass = mass_of(found.places[0])
        assert math.dist(GRID.peak(mass[best_rotation(mass)]).pixel, expected) < 8


def test_which_print_lies_at_a_side_their_middles_say_and_not_where_they_are_held() -> None:
    scene, left, right = Scene(), (200, 60), (203, 90)
    scene.show(HOOK, left, math.radians(180))  # held below its middle, the other above
    scene.show(HOOK, right, 0.0)
    pick, image = Peak(PICK, GRID.disc(GRID.cell_of(PICK))), scene.image()
    prints = prints_of(scene, left, right)
    assert prints[0].centre[0] < prints[1].centre[0] and prints[0].pixel[0] > prints[1].pixel[0]
    chooser = Places(SimpleNamespace(cell_size=2), GRID, fits_prints=True)  # type: ignore[arg-type]
    for side, expected in ((Side.LEFT, left), (Side.RIGHT, right)):
        found = chooser.on_prints(image, pick, None, _likely({left: 0.5, right: 0.5}), side)
        assert found is not None
        mass = mass_of(found.places[0])
        assert math.dist(GRID.peak(mass[best_rotation(mass)]).pixel, expected) < 6


@pytest.mark.parametrize("side", [None, Side.LEFT])
def test_a_print_that_a_thing_hides_in_part_is_found_beneath_it(side: Side | None) -> None:
    scene, print_at, pick = Scene(), (200, 60), (206, 57)
    scene.height[:] = 0.0
    scene.color[:] = (165, 120, 95)
    scene.show(HOOK, print_at, math.radians(20))
    scene.show(HOOK, (260, 60), 1.0)
    scene._draw(HOOK, (204, 57), 0.3, (78, 121, 167), 0.02)
    chooser = Places(SimpleNamespace(cell_size=2), GRID, fits_prints=True)  # type: ignore[arg-type]
    peak = Peak(pick, GRID.disc(GRID.cell_of(pick)))
    found = chooser.on_prints(scene.image(), peak, None, _likely({print_at: 0.9, (260, 60): 0.1}), side)
    assert found is not None
    mass = mass_of(found.places[0])
    place = GRID.peak(mass[best_rotation(mass)])
    assert math.degrees(likeliest_turn(mass[:, place.near].sum(1))) == pytest.approx(20, abs=8)
    turn = math.radians(20)
    held = np.subtract(found.pick.pixel, (204, 57)) @ np.array(
        [[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]
    )
    assert math.dist(place.pixel, np.add(print_at, held)) < 3


def test_where_the_first_two_places_show_nothing_no_more_are_looked_at() -> None:
    scene = Scene()
    scene.show(HOOK, (120, 100), 0.0)
    assert prints_of(scene, (200, 60), (240, 60), (120, 100)) == []
    assert len(prints_of(scene, (120, 100), (200, 60), (240, 60))) == 3


def _print(contrast: float, pixel: tuple[int, int] = (100, 60), turn: float = 0.1) -> Print:
    return Print(pixel, turn, contrast, pixel)


def test_contrast_says_which_print_and_the_transport_half_as_loud() -> None:
    shares = torch.tensor([0.81, 0.09]).log()
    assert share_of_prints(shares, []) is None and share_of_prints(shares, [_print(7.9), _print(1.0)]) is None
    for contrasts, odds in (((50.0, 90.0), 3.0), ((10.0, 20.0), 3.0 / 4), ((0.2, 20.0), 3.0 / 400)):
        found = share_of_prints(shares, [_print(contrast) for contrast in contrasts])
        assert found is not None and float((found[0] - found[1]).exp()) == pytest.approx(odds, rel=1e-4)
        assert float(found.exp().sum()) == pytest.approx(1.0)


def test_what_is_put_on_a_print_lies_there_and_is_turned_so() -> None:
    prints = [_print(9.0, (100, 61), math.radians(273)), _print(9.0, (31, 50), math.radians(-3))]
    mass = mass_of(with_prints(torch.randn(36, *GRID.shape), prints, torch.tensor([0.7, 0.3]).log(), 2))
    assert best_rotation(mass) == 27 and float(mass[27:29].sum()) == pytest.approx(0.7, abs=1e-3)
    assert float(mass[[35, 0]].sum()) == pytest.approx(0.3, abs=1e-3)
    for one, rotation in zip(prints, (27, 0), strict=True):
        found = GRID.peak(mass[rotation])
        assert math.dist(found.pixel, one.pixel) <= 1
        assert math.remainder(likeliest_turn(mass[:, found.near].sum(1)) - one.turn, 2 * math.pi) == pytest.approx(
            0.0, abs=1e-3
        )


def _likely(odds: dict[tuple[int, int], float]) -> torch.Tensor:
    logits = torch.full((1, 36, *GRID.shape), -20.0)
    for pixel, share in odds.items():
        logits[(0, 0, *GRID.cell_of(pixel))] = math.log(share)
    return logits


def test_a_print_is_taken_before_a_place_that_is_likelier_and_of_equal_ones_that_at_the_side() -> None:
    scene = Scene()
    near, far, other = (180, 60), (260, 60), (220, 110)
    scene.show(HOOK, near, math.radians(60))
    scene.show(HOOK, far, math.radians(-60))
    scene.show(TRIANGLE, other, 0.0)
    pick, image = Peak((56, 37), GRID.disc(GRID.cell_of(PICK))), scene.image()
    chooser = Places(SimpleNamespace(cell_size=2), GRID, fits_prints=True)  # type: ignore[arg-type]
    likely = _likely({other: 0.9, near: 0.08, far: 0.02})
    found = chooser.on_prints(image, pick, None, likely, None)
    assert found is not None
    assert math.dist(found.pick.pixel, np.add(pick.pixel, outline_of(scene, pick.pixel).held)) < 1
    assert found.pick.near is pick.near and found.yaws is None
    across = torch.zeros(1, 36)
    across[0, 9] = 1.0  # the jaws close along y
    turned = chooser.on_prints(image, pick, across, _likely({near: 1.0}), None)
    expected = np.add(pick.pixel, outline_of(scene, pick.pixel, math.pi / 2).held)
    assert turned is not None and math.dist(turned.pick.pixel, expected) < 1
    assert math.dist(turned.pick.pixel, found.pick.pixel) > 1
    assert turned.yaws is not None  # the hook lies at 0.3 rad: so do the jaws that close along y, now
    assert likeliest_turn(mass_of(turned.yaws[0])) == pytest.approx(0.3 + math.pi / 2, abs=0.05)
    for side, pixel, rotation in ((None, near, 6), (Side.LEFT, near, 6), (Side.RIGHT, far, 30), (Side.MIDDLE, near, 6)):
        at = chooser.on_prints(image, pick, None, likely, side)
        assert at is not None
        mass = mass_of(at.places[0])
        assert best_rotation(mass) == rotation and math.dist(GRID.peak(mass[rotation]).pixel, pixel) < 6
    assert chooser.on_prints(image, pick, None, _likely({other: 1.0}), None) is None, "no print of it is likely"
    assert chooser.on_prints(image, pick, None, _likely({near: 0.8, PICK: 0.2}), None) is None, (
        "it hides what is under it"
    )
    assert chooser.on_prints(image, pick, None, _likely({near: 0.9, PICK: 0.1}), None) is not None
    without = Places(SimpleNamespace(cell_size=2), GRID, fits_prints=False)  # type: ignore[arg-type]
    assert without.on_prints(image, pick, None, _likely({near: 1.0}), None) is None


def test_only_a_policy_that_fits_prints_looks_for_them_and_asks_no_aligner_then(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    policy, asked = load_policy("default", precision="float32"), list[str]()
    here, along = _likely({(200, 60): 1.0}), torch.zeros(1, 36)
    here[0, 1] = here[0, 0]  # a turn of 5 degrees, between two rotations, and jaws at 95
    along[0, 9:11] = 30.0

    def on_prints(
        self: Places, image: object, pick: Peak, yaws: object, places: torch.Tensor, side: Side | None
    ) -> Printed | None:
        asked.append("prints")
        return Printed(pick._replace(pixel=(60, 41)), along, here) if self._fits_prints else None

    def with_fits(
        self: Places, image: object, goal: Goal, pick: object, yaws: object, places: torch.Tensor
    ) -> torch.Tensor:
        asked.append("fits")
        return places

    monkeypatch.setattr(Places, "on_prints", on_prints)
    monkeypatch.setattr(Places, "with_fits", with_fits)
    without = replace(policy.card, network=replace(policy.card.network, fits_prints=False))  # type: ignore[type-var]
    for one in (policy, Policy(policy._network, policy._anchors, without, policy._encoder)):
        action = one.infer(Scene().heightmap(), "put the blue letter L shape in the letter L shape hole").action
        moved = math.dist((action.pick.x, action.pick.y), SPEC.pixel_to_xy(60, 41))
        yaws = [math.degrees(action.pick.yaw), math.degrees(action.place.yaw)]
        assert (moved < 1e-6) == (yaws == pytest.approx([95.0, 100.0], abs=0.01)) == (one is policy)
    assert asked == ["prints", "prints", "fits"]
