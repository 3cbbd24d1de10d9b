"""The benchmark's goals and scores once more, from its rules alone: numbers in, a score out, nothing of the simulator.

Things are rows as scripted_poses.json has them; draw_scripts.py draws that file.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

SCRIPTS = Path(__file__).with_name("scripted_poses.json")
SIDE = 0.282843  # of the rope's square, and the rope's length [m]
FRONT_RIGHT, FRONT_LEFT, BACK_RIGHT, BACK_LEFT = (
    np.array(corner) * SIDE / 2 for corner in ((1, 1), (-1, 1), (1, -1), (-1, -1))
)
ROPE_SIDES = {
    "front left tip to front right tip": (FRONT_RIGHT, FRONT_LEFT),
    "front right tip to back right corner": (FRONT_RIGHT, BACK_RIGHT),
    "front left tip to back left corner": (FRONT_LEFT, BACK_LEFT),
    "back right corner to back left corner": (BACK_LEFT, BACK_RIGHT),
}
PERIODS = {  # of kitting shapes [degrees]; 0: the yaw does not count
    "letter E shape": 360, "letter L shape": 360, "ring": 0, "hexagon": 60, "heart": 360, "letter M shape": 360,
}  # fmt: skip
HANOI = ((0, 2), (1, 1), (0, 1), (2, 2), (0, 0), (1, 2), (0, 2))  # ring to peg, move by move
ROWS = ((("purple", "blue", "green"), (-0.05, 0.0, 0.05)), (("yellow", "orange"), (-0.025, 0.025)), (("red",), (0.0,)))
PALLET_BOXES = 18

Places = list[tuple[float, float, float]]  # x, y [m], yaw [rad]


@dataclass
class Thing:
    """A row of the file: a name, a colour, whether it is fixed, where it is (x, y, z, roll, pitch, yaw), and the box
    around it in its own frame [m, rad]."""

    name: str
    color: str
    fixed: bool
    pose: list[float]
    low: list[float]
    high: list[float]

    def at(self, x: float, y: float, turn: float = 0.0) -> tuple[float, float, float]:
        """A place in this thing's frame, seen from the base."""
        c, s = math.cos(self.pose[5]), math.sin(self.pose[5])
        return self.pose[0] + c * x - s * y, self.pose[1] + s * x + c * y, self.pose[5] + turn


@dataclass
class PoseGoal:
    """Each thing is to be at one of its places, nearer than `near` [m] and turned less than 15 degrees up to its
    period [degrees, 0: the yaw does not count]."""

    share: float
    places: dict[int, Places]
    near: float = 0.01
    periods: dict[int, float] | float = 0.0

    def value(self, things: list[Thing]) -> float:
        """Share of the things that are where they belong."""
        return sum(self._is_right(i, things[i].pose) for i in self.places) / len(self.places)

    def _is_right(self, i: int, pose: list[float]) -> bool:
        period = self.periods[i] if isinstance(self.periods, dict) else self.periods
        for x, y, yaw in self.places[i]:
            turn = math.degrees(abs(pose[5] - yaw)) % period if period else 0.0
            if math.dist((x, y), pose[:2]) < self.near and min(turn, period - turn) < 15.0:
                return True
        return False


@dataclass
class ZoneGoal:
    """The things' points are to be in a box of that size about a fixed thing, below cap in its frame [m]."""

    share: float
    things: list[int]
    zone: int
    size: tuple[float, float]
    cap: float = 0.30
    point: tuple[float, float, float] | None = None  # the only one, in the thing's frame

    def value(self, things: list[Thing]) -> float:
        """Share of the points inside."""
        inside = total = 0
        zone = things[self.zone]
        for i in self.things:
            for point in self._points(things[i]):
                total += 1
                x, y, z = rotation(*things[i].pose[3:]) @ point + things[i].pose[:3] - zone.pose[:3]
                c, s = math.cos(zone.pose[5]), math.sin(zone.pose[5])
                x, y = c * x + s * y, c * y - s * x
                inside += abs(x) < self.size[0] / 2 and abs(y) < self.size[1] / 2 and z < self.cap
        return inside / total

    def _points(self, thing: Thing) -> list[Any]:
        if self.point is not None:
            return [np.array(self.point)]
        counts = [max(1, math.ceil(round((b - a) / 0.02, 6))) for a, b in zip(thing.low, thing.high, strict=True)]
        return [np.array(thing.low) + 0.02 * np.array(index) for index in np.ndindex(*counts)]


Goal = PoseGoal | ZoneGoal


def rotation(roll: float, pitch: float, yaw: float) -> Any:
    """About x, then y, then z."""
    (cr, cp, cy), (sr, sp, sy) = np.cos((roll, pitch, yaw)), np.sin((roll, pitch, yaw))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ about_y @ about_x


def goals_of(task: str, sentences: list[str], things: list[Thing], max_steps: int) -> list[Goal]:
    """A scene's goals, in their order, from what is said and what lies there."""
    fixed, loose = ([i for i, thing in enumerate(things) if thing.fixed is kind] for kind in (True, False))
    first = things[fixed[0]]
    if "rope" in task:
        side = next((s for words, s in ROPE_SIDES.items() if words in sentences[0]), (FRONT_RIGHT, FRONT_LEFT))
        slots = [first.at(*(side[0] + (j + 0.5) / 20 * (side[1] - side[0]))) for j in range(20)]
        return [PoseGoal(1.0, {i: [slots[j], slots[19 - j]] for j, i in enumerate(loose)}, near=0.02)]
    if task.startswith("assembling-kits"):
        return _kit_goals(sentences, things, fixed[1:], loose)
    if "bowl" in task or task == "place-red-in-green":
        block, bowl = re.search(r"the (\w+) blocks in a (\w+) bowl", sentences[0]).groups()  # type: ignore[union-attr]
        bowls = [things[i].at(0, 0) for i in _named(things, "bowl", bowl)]
        return [PoseGoal(1.0, dict.fromkeys(_named(things, "block", block), bowls), near=0.05)]
    if "pyramid" in task:
        return _pyramid_goals(sentences, things, loose)
    if "hanoi" in task:
        return [PoseGoal(1 / 7, {loose[ring]: [first.at(0, 0.12 * (peg - 1))]}) for ring, peg in HANOI]
    if task == "block-insertion":
        return [PoseGoal(1.0, {loose[0]: [first.at(0, 0)]}, periods=360)]
    if task == "align-box-corner":
        x, y, _ = np.subtract(things[loose[0]].high, things[loose[0]].low)
        quarter, q = ((x - y) / 2, (y - x) / 2), math.pi / 2
        places = [first.at(0, 0), first.at(0, 0, math.pi), first.at(*quarter, q), first.at(*quarter, -q)]
        return [PoseGoal(1.0, {loose[0]: places}, periods=360)]
    if task == "palletizing-boxes":
        return [ZoneGoal(1.0, loose, fixed[0], (0.30, 0.25))]
    if "piles" in task:
        name = re.search(r"into the (\w+) square", sentences[0]).group(1)  # type: ignore[union-attr]
        zone = next((i for i in fixed if things[i].color == name), fixed[0])
        edge = 0.12 if task == "sweeping-piles" else 0.15
        return [ZoneGoal(1.0, loose, zone, (edge, edge), point=(-0.005, -0.005, -0.005))]
    return _packing_goals(task, sentences, things, loose, max_steps)


def _packing_goals(task: str, sentences: list[str], things: list[Thing], loose: list[int], steps: int) -> list[Goal]:
    size = tuple(np.subtract(things[0].high, things[0].low)[:2] - 0.002)  # of the walls' middles; they are 2 mm thick
    if task == "packing-unseen-shapes":
        name = sentences[0].removeprefix("pack the ").removesuffix(" in the brown box")
        point = (-0.0015, -0.0015, things[loose[0]].low[2])
        return [ZoneGoal(1.0, [i for i in loose if things[i].name == name], 0, size, point=point)]
    if task.endswith("-seq"):
        return [ZoneGoal(1 / (steps - 1), [i], 0, size) for i in loose[: steps - 1]]
    if "google" in task:
        name = sentences[0].removeprefix("pack all the ").removesuffix(" objects in the brown box")
        return [ZoneGoal(1.0, [i for i in loose if things[i].name == name], 0, size)]
    if task == "packing-boxes":
        return [ZoneGoal(1.0, loose, 0, size, cap=0.08)]
    colors = sentences[0].split(" blocks into")[0].split()
    return [ZoneGoal(1.0, [i for i in loose if things[i].color in colors], 0, size, cap=0.0525)]


def _kit_goals(sentences: list[str], things: list[Thing], holes: list[int], loose: list[int]) -> list[Goal]:
    periods = {i: PERIODS[things[i].name] for i in loose}
    if len(sentences) == 1:
        fits = {i: [things[j].at(0, 0) for j in holes if things[j].name == f"{things[i].name} hole"] for i in loose}
        return [PoseGoal(1.0, fits, periods=periods)]
    goals: list[Goal] = []
    for sentence in sentences:
        color, name, where = re.match(r"put the (\w+) (.+) in the (.+) hole", sentence).groups()  # type: ignore[union-attr]
        thing = next(i for i in loose if (things[i].color, things[i].name) == (color, name))
        same = [j for j in holes if things[j].name == f"{name} hole"]
        (hole,) = [j for j in same if _which(j, same, things) == where.removesuffix(name).strip()]
        goals.append(PoseGoal(0.2, {thing: [things[hole].at(0, 0)]}, periods=periods))
    return goals


def _which(hole: int, same: list[int], things: list[Thing]) -> str:
    away = [np.subtract(things[j].pose[:2], things[hole].pose[:2]) for j in same if j != hole]
    if not away:
        return ""
    rules = {
        "top": lambda d: d[0] > 0 and abs(d[0]) > abs(d[1]),
        "bottom": lambda d: d[0] < 0 and abs(d[0]) > abs(d[1]),
        "left": lambda d: d[1] > 0,
        "right": lambda d: d[1] < 0,
    }
    return next((word for word, rule in rules.items() if all(map(rule, away))), "middle")


def _pyramid_goals(sentences: list[str], things: list[Thing], loose: list[int]) -> list[Goal]:
    stand = next(thing for thing in things if thing.fixed)
    slots = [stand.at(0, y) for _, row in ROWS for y in row]
    if len(sentences) == 6:
        colors = [sentence.split()[2] for sentence in sentences]
        named = [next(i for i in loose if things[i].color == color) for color in colors]
        return [PoseGoal(1 / 6, {i: [slot]}, periods=90) for i, slot in zip(named, slots, strict=True)]
    goals: list[Goal] = []
    for colors, row in ROWS:
        places = [stand.at(0, y) for y in row]
        here = [i for i in loose if things[i].color in colors]
        goals.append(PoseGoal(len(row) / 6, dict.fromkeys(here, places), periods=90))
    return goals


def _named(things: list[Thing], name: str, color: str) -> list[int]:
    return [i for i, thing in enumerate(things) if (thing.name, thing.color) == (name, color)]


def scores_of(goals: list[Goal], things: list[Thing], script: list[list[list[float]]]) -> list[float]:
    """The score after each step: what was completed before, and the present goal's part; only then is that one taken
    off if less than a hundredth is missing. The last score stands when nothing is left or it is above 0.99."""
    left, progress, scores = list(goals), 0.0, []
    for moves in script:
        for i, *pose in moves:
            things[int(i)].pose = pose
        step = left[0].share * left[0].value(things)
        scores.append(progress + step)
        if abs(left[0].share - step) < 0.01:
            progress += left.pop(0).share
        if not left or scores[-1] > 0.99:
            break
    return scores


def recorded() -> dict[str, Any]:
    """What the file holds, by task."""
    found: dict[str, Any] = json.loads(SCRIPTS.read_text())
    return found


def things_in(record: dict[str, Any]) -> list[Thing]:
    """A scene's things, as they lie at first."""
    return [Thing(*row) for row in record["things"]]
