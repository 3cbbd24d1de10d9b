"""The ways down to a pose: configurations above a pose from which a straight motion leads down to it."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

from cliport_core.pose import Pose
from panda_executor.errors import InverseKinematicsError
from panda_executor.ik import hand_down_pose, tilted
from panda_executor.motions import Motion, MotionBuilder
from panda_executor.phase import Phase
from panda_executor.scene import Scene
from panda_model.limits import FloatArray

_USUAL_BRANCHES = 4  # of the inverse kinematics that are free and tried for one pose, to begin with


@dataclass(frozen=True)
class Target:
    """A pose of the hand pointing down: tcp x, y, z [m, base frame] and yaw [rad]; above_z: where it begins [m]."""

    x: float
    y: float
    z: float
    above_z: float
    yaw: float

    def pose(self) -> Pose:
        """Return the pose itself."""
        return hand_down_pose(self.x, self.y, self.z, self.yaw)

    def above(self, lean: float, rise: float = 0.0) -> Pose:
        """Return where the motion down to it begins, at a lean [rad], `rise` [m] higher than usual."""
        return tilted(hand_down_pose(self.x, self.y, self.above_z + rise, self.yaw), lean)


@dataclass(frozen=True, eq=False)
class Approach:
    """A branch of the arm above a pose, and the straight motion down to it."""

    above: FloatArray
    down: Motion


def usual_approaches(
    motions: MotionBuilder, phase: Phase, target: Target, scene: Scene, reference: FloatArray
) -> Iterator[Approach]:
    """Yield the cheapest free branches above a pose; the hand leans only where none is free upright.

    Close to its base the arm cannot fold enough to keep the hand upright at every height: there it leans
    outwards above the object and rights itself on the way down.
    """
    goal = target.pose()
    for lean in motions.config.lean:
        motions.budget.check()
        try:
            solutions = motions.ik.solve_all(target.above(lean), reference)
        except InverseKinematicsError:
            continue
        free = [solution for solution in solutions if scene.is_valid(solution.positions)]
        found = False
        for solution in free[:_USUAL_BRANCHES]:
            down = motions.straight(phase, solution.positions, goal, scene)
            if down is not None:
                found = True
                yield Approach(solution.positions, down)
        if found:
            return


def more_approaches(
    motions: MotionBuilder, phase: Phase, target: Target, scene: Scene, reference: FloatArray
) -> Iterator[Approach]:
    """Yield ways down from each height to each branch that is free at the pose itself, those of one height together.

    Near things there are fewer free branches at the pose than above it: so the straight motions are looked for
    upwards from it, at each height with the least lean that passes.
    """
    motions.budget.check()
    try:
        solutions = motions.ik.solve_all(target.pose(), reference, finely=True)
    except InverseKinematicsError:
        return
    free = [solution.positions for solution in solutions if scene.is_valid(solution.positions)]
    for rise, positions in itertools.product((0.0, *motions.config.more_rise), free):
        for lean in motions.config.lean:
            up = motions.straight(phase, positions, target.above(lean, rise), scene)
            if up is not None:
                down = motions.reversed(phase, up, scene)
                yield Approach(down.trajectory.positions[0], down)
                break


def pairs(picks: Iterator[Approach], places: Iterator[Approach]) -> Iterator[tuple[Approach, Approach]]:
    """Yield every pair, those of the first ones first; none is looked for before its turn comes."""
    first, second = _Found(picks), _Found(places)
    for total in itertools.count():
        left = False
        for number in range(total + 1):
            pick = first.get(number)
            place = second.get(total - number) if pick is not None else None
            if pick is not None and place is not None:
                left = True
                yield pick, place
        if not left:
            return


class _Found:
    """Approaches in their order, found no sooner than they are asked for."""

    def __init__(self, source: Iterator[Approach]) -> None:
        self._source, self._found = source, list[Approach]()

    def get(self, number: int) -> Approach | None:
        """Return one of them, None where there are fewer."""
        while number >= len(self._found):
            new = next(self._source, None)
            if new is None:
                return None
            self._found.append(new)
        return self._found[number]
