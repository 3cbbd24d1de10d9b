"""Every number of the executor's core in one value."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum

from panda_executor.grasp import GraspConfig
from panda_executor.placement import PlacementConfig
from panda_executor.scene import SceneConfig
from panda_executor.table_plane import TableConfig
from panda_executor.timing import TimingConfig
from panda_model import ArmModel, HandModel, JointLimits


class AfterFailure(Enum):
    """The arm's behaviour once it stands still after a motion or the gripper failed.

    STAY: nothing. KEEP: rise and go to the ready pose, with what it holds. OPEN: let go first.
    """

    STAY = "stay"
    KEEP = "keep"
    OPEN = "open"


class SearchAlgorithm(Enum):
    """The algorithms that a path may be searched with: the paper's, and a quicker one that takes the first way."""

    RRT_STAR = "rrt_star"
    RRT_CONNECT = "rrt_connect"


@dataclass(frozen=True)
class SearchConfig:
    """Bounds of a search; the path that it finds is shortened.

    time_limit: seconds at most; max_checks: validity checks at most; step: the longest [rad]; goal_bias: share of
    samples at the goal; margin: how far a joint may leave the range between start and goal [rad]; shortcuts: attempts
    to shorten the path that was found; seed: of the samples.
    """

    algorithm: SearchAlgorithm = SearchAlgorithm.RRT_CONNECT

    time_limit: float = 1.0
    max_checks: int = 4000
    step: float = 1.2
    goal_bias: float = 0.15
    margin: float = 0.8
    shortcuts: int = 40
    seed: int = 1


@dataclass(frozen=True)
class DragConfig:
    """Settings of sweep and fold. Lengths in m, speed in m/s.

    tip_clearance: fingertips to table; speed: of the tcp along the table; corridor: half width of the ground along
    the line whose things are to be moved, not avoided; low: how high they may stand; fold_lift: raised this much
    while it is moved (the rope tasks' 20 mm), 0 to stay on the table.
    """

    tip_clearance: float = 0.003
    speed: float = 0.25
    corridor: float = 0.07
    low: float = 0.045
    fold_lift: float = 0.02


@dataclass(frozen=True)
class ExecutorConfig:
    """Settings of the executor's core.

    approach_height: of the tcp above the higher of grasp and release [m]; more_rise: from so much higher, too,
    where no way was found from there [m]; clearance: added round the hand while it travels [m]; straightness: how far
    the tcp may be off the line of a straight motion, as to and from objects [m]; lean: angles at which
    the hand may lean outwards above an object close to the base [rad]; missed_width: fingers closer than this hold
    nothing [m]; grip_force, open_force [N];
    start_tolerance: how far the arm may be measured from a motion's planned start [rad]; planning_time: a request
    that takes longer to plan is given up [s]; centre_grasp: whether the middle of what is held goes to the place; else
    it ends as far from there as the pick was off; moved_share: an object is looked for anew before the hand goes down
    to it when this share of its cells is seen to be empty; follow_from: and grasped where it is now when it went this
    far, or looked for anew, too, where a person approved the plan [m].
    """

    scene: SceneConfig = field(default_factory=SceneConfig)
    grasp: GraspConfig = field(default_factory=GraspConfig)
    placement: PlacementConfig = field(default_factory=PlacementConfig)
    timing: TimingConfig = field(default_factory=TimingConfig)
    table: TableConfig = field(default_factory=TableConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    drag: DragConfig = field(default_factory=DragConfig)
    approach_height: float = 0.12
    straightness: float = 0.005
    more_rise: tuple[float, ...] = (-0.05, 0.08, 0.18)
    clearance: float = 0.01
    lean: tuple[float, ...] = (0.0, 0.3, 0.6)
    missed_width: float = 0.005
    grip_force: float = 20.0
    open_force: float = 20.0
    start_tolerance: float = 0.08
    planning_time: float = 4.0
    centre_grasp: bool = True
    after_failure: AfterFailure = AfterFailure.KEEP
    moved_share: float = 0.5
    follow_from: float = 0.004

    @classmethod
    def for_arm(cls, arm: ArmModel) -> ExecutorConfig:
        """Return the defaults with this arm's hand."""
        config = cls()
        return replace(config, grasp=replace(config.grasp, hand=arm.hand))

    @property
    def hand(self) -> HandModel:
        """The hand that grasps."""
        return self.grasp.hand

    def motion_limits(self, limits: JointLimits) -> JointLimits:
        """Return the arm's limits times the configured scaling."""
        timing = self.timing
        return limits.scaled(timing.velocity_scaling, timing.acceleration_scaling, timing.jerk_scaling)
