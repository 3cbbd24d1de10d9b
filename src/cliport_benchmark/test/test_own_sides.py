"""Left and right of a rope's square: the policy's rule and the simulator's sides are the same."""

import math

from cliport_core import PlanarPose
from cliport_policy.sides import at_own_side, own_side_named
from sim_bridge.tasks.align_rope import SIDES


def test_what_the_rule_calls_left_is_the_square_s_left() -> None:
    (*front, _), *_, (*back, _) = SIDES
    named = {words: own_side_named(f"align the rope from {words}") for *_, words in SIDES}
    assert [own is not None for own in named.values()] == [False, True, True, False]
    for yaw in (0.0, 1.1, -2.5):
        square = PlanarPose(0.45, -0.1, yaw).as_pose()

        def seen(corners: list[tuple[float, float]], square=square) -> list[tuple[float, float]]:
            return [tuple(square.apply([(0.1 * x, 0.1 * y, 0.0)])[0][:2]) for x, y in corners]

        for begin, end, words in SIDES:
            own = named[words]
            if own is not None:
                across = [(-x, y) for x, y in (begin, end)]
                found = at_own_side(own.side, seen(front), seen(back), seen([begin, end, *across]))
                assert found == [0, 1], (words, math.degrees(yaw))
