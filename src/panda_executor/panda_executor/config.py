"""Every number of the executor's core in one value."""

from __future__ import annotations

from dataclasses import dataclass, field

from panda_executor.grasp import GraspConfig
from panda_executor.limits import READY_POSITIONS, JointLimits
from panda_executor.placement import PlacementConfig
from panda_executor.scene import SceneConfig
from panda_executor.timing import TimingConfig


@dataclass(frozen=True)
class SearchConfig:
    """RRT*: seconds and validity checks at most, longest step [rad], share of samples at the goal,
    how far a joint may leave the range between start and goal [rad], attempts to shorten what was found, seed."""

    time_limit: float = 1.0
    max_checks: int = 4000
    step: float = 1.2
    goal_bias: float = 0.15
    margin: float = 0.8
    shortcuts: int = 40
    seed: int = 1


@dataclass(frozen=True)
class DragConfig:
    """Sweep and fold. Lengths in m, speed in m/s.

    tip_clearance: fingertips to table; speed: of the tcp along the table; corridor: half width of the ground along
    the line whose things are to be moved, not avoided; low: how high they may stand; fold_opening: of the fingers
    on the way in, narrow enough for a bead among its neighbours; fold_lift: raised this much while it is moved
    (the rope tasks' 20 mm), 0 to stay on the table.
    """

    tip_clearance: float = 0.003
    speed: float = 0.25
    corridor: float = 0.07
    low: float = 0.045
    fold_opening: float = 0.03
    fold_lift: float = 0.02


@dataclass(frozen=True)
class ExecutorConfig:
    """approach_height: of the tcp above the higher of grasp and release [m]; clearance: added round the hand
    while it travels [m]; lean: angles at which the hand may lean outwards above an object close to the base
    [rad]; missed_width: fingers closer than this hold nothing [m]; grip_force, open_force [N];
    release_opening: of the fingers after a grasp that failed [m]; start_tolerance [rad];
    planning_time: a request that takes longer to plan is given up [s].
    """

    scene: SceneConfig = field(default_factory=SceneConfig)
    grasp: GraspConfig = field(default_factory=GraspConfig)
    placement: PlacementConfig = field(default_factory=PlacementConfig)
    timing: TimingConfig = field(default_factory=TimingConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    drag: DragConfig = field(default_factory=DragConfig)
    ready: tuple[float, ...] = tuple(float(v) for v in READY_POSITIONS)
    approach_height: float = 0.12
    clearance: float = 0.01
    lean: tuple[float, ...] = (0.0, 0.3, 0.6)
    missed_width: float = 0.005
    grip_force: float = 20.0
    open_force: float = 20.0
    release_opening: float = 0.08
    start_tolerance: float = 0.03
    planning_time: float = 4.0

    def motion_limits(self, limits: JointLimits) -> JointLimits:
        """The arm's limits times the configured scaling."""
        timing = self.timing
        return limits.scaled(timing.velocity_scaling, timing.acceleration_scaling, timing.jerk_scaling)
