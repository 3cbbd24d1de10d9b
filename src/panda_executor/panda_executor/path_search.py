"""Paths in joint space: the straight line where it is free, a search with simplification elsewhere."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from ompl import base, geometric, util

from panda_executor.budget import Budget
from panda_executor.config import SearchAlgorithm, SearchConfig
from panda_executor.errors import PlanningError
from panda_executor.scene import Scene
from panda_model.limits import ARM_DOF, FloatArray

MakePlanner = Callable[[base.SpaceInformation], base.Planner]
_RESOLUTION = 0.02  # between two configurations that are checked on a line [rad]

# OMPL complains at each new seed that one was used before; the objects made after it do follow the new one.
util.setLogLevel(util.LOG_NONE)


def line_is_free(scene: Scene, start: FloatArray, goal: FloatArray, resolution: float = _RESOLUTION) -> bool:
    """Return True if the straight line in joint space, ends included, is valid at every `resolution` [rad]."""
    count = int(np.ceil(float(np.abs(goal - start).max()) / resolution)) + 1
    # The middle first: that is where a line that is not free fails most often.
    shares = np.linspace(0.0, 1.0, max(count, 2))
    order = np.argsort(np.abs(shares - 0.5), kind="stable")
    return all(scene.is_valid(start + share * (goal - start)) for share in shares[order])


def find_path(
    scene: Scene,
    start: FloatArray,
    goal: FloatArray,
    config: SearchConfig,
    clock: Callable[[], float] = time.monotonic,
    budget: Budget | None = None,
    make_planner: MakePlanner | None = None,
) -> FloatArray:
    """Find waypoints (N, 7) [rad] from start to goal; the segments between them are valid at every 0.02 rad.

    Deterministic for a seed as long as max_checks ends the search before time_limit does.

    Args:
        budget: of the whole request's planning.
        make_planner: another planner of OMPL's than the configuration's, to compare them.

    Raises:
        PlanningError: when an end is not valid, or no path was found within the bounds.
    """
    budget = budget or Budget(clock=clock)
    budget.check()
    for name, positions in (("start", start), ("end", goal)):
        problem = scene.problem(positions)
        if problem is not None:
            raise PlanningError(f"the motion cannot {name} there: {problem}")
    if line_is_free(scene, start, goal):
        return np.stack([start, goal])
    path = _Search(scene, config, clock, budget, np.stack([start, goal]), make_planner).solve(start, goal)
    budget.check()
    return path


class _Search:
    """One search; OMPL's objects live as long as it does.

    It looks around its ends (2, 7) only: ways round what stands on a table need no more, and in the whole range
    of seven joints most searches would end at their bounds with nothing found.
    """

    def __init__(
        self,
        scene: Scene,
        config: SearchConfig,
        clock: Callable[[], float],
        budget: Budget,
        ends: FloatArray,
        make_planner: MakePlanner | None = None,
    ) -> None:
        self._make_planner = make_planner
        util.RNG.setSeed(config.seed)
        self._scene, self._config, self._clock, self._budget = scene, config, clock, budget
        self._checks = 0
        self._searching = True
        lower = np.maximum(scene.model.limits.lower, ends.min(axis=0) - config.margin)
        upper = np.minimum(scene.model.limits.upper, ends.max(axis=0) + config.margin)
        space = base.RealVectorStateSpace(ARM_DOF)
        bounds = base.RealVectorBounds(ARM_DOF)
        for joint in range(ARM_DOF):
            bounds.setLow(joint, float(lower[joint]))
            bounds.setHigh(joint, float(upper[joint]))
        space.setBounds(bounds)
        self._space = space
        self._information = base.SpaceInformation(space)
        self._information.setStateValidityChecker(self._is_valid)
        # A share of the space's extent; a joint moves at most as far as the whole configuration does.
        extent = float(np.linalg.norm(upper - lower))
        self._information.setStateValidityCheckingResolution(_RESOLUTION / extent)

    def _is_valid(self, state: base.State) -> bool:
        self._checks += 1
        if self._searching and self._checks > self._config.max_checks:
            return False
        if self._budget.is_spent():  # also ends the shortening of a path that was found
            return False
        return self._scene.is_valid(self._positions(state))

    @staticmethod
    def _positions(state: base.State) -> FloatArray:
        return np.array([state[joint] for joint in range(ARM_DOF)])

    def _state(self, positions: FloatArray) -> base.State:
        state = self._space.allocState()
        for joint in range(ARM_DOF):
            state[joint] = float(positions[joint])
        return state

    def _planner(self) -> base.Planner:
        if self._make_planner is not None:
            return self._make_planner(self._information)
        if self._config.algorithm is SearchAlgorithm.RRT_CONNECT:
            planner = geometric.RRTConnect(self._information)
        else:
            planner = geometric.RRTstar(self._information)
            planner.setGoalBias(self._config.goal_bias)
        planner.setRange(self._config.step)
        return planner

    def solve(self, start: FloatArray, goal: FloatArray) -> FloatArray:
        problem = base.ProblemDefinition(self._information)
        problem.setStartAndGoalStates(self._state(start), self._state(goal), 1e-4)
        planner = self._planner()
        planner.setProblemDefinition(problem)
        planner.setup()
        deadline = self._clock() + self._config.time_limit
        enough = self._config.max_checks

        def done() -> bool:
            if self._budget.is_spent():
                return True
            if problem.hasExactSolution() and self._checks > enough // 4:
                return True
            return self._checks > enough or self._clock() > deadline

        planner.solve(base.PlannerTerminationCondition(done))
        self._searching = False
        self._budget.check()
        if not problem.hasExactSolution():
            raise PlanningError(
                f"no way round the obstacles was found in {self._checks} checks; clear the table or raise search_time"
            )
        path = problem.getSolutionPath()
        simplifier = geometric.PathSimplifier(self._information)
        simplifier.reduceVertices(path)
        simplifier.partialShortcutPath(path, self._config.shortcuts, self._config.shortcuts)
        simplifier.collapseCloseVertices(path)
        waypoints = [self._positions(path.getState(i)) for i in range(path.getStateCount())]
        waypoints[0], waypoints[-1] = start, goal
        return np.stack(waypoints)
