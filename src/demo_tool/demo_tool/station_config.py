"""Configuration of the station."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from cliport_core.workspace import WorkspaceSpec
from panda_model import ArmModel, HandModel, load_preset


def ready_pose(arm: ArmModel) -> dict[str, float]:
    """Return the positions of the arm's joints at its ready pose by their names [rad]."""
    return dict(zip(arm.arm_joints, map(float, arm.ready), strict=True))


@dataclass(frozen=True)
class BoxConfig:
    """Limits for the cloud in a box; lengths in m, as the executor's grasp has them.

    min_height: least height of an object above the table; table_z: height of the table; min_points, min_share: least
    number and share of a box's pixels with depth; hand: the grasping hand.
    """

    min_height: float = 0.008
    table_z: float = 0.0
    min_points: int = 12
    min_share: float = 0.2
    hand: HandModel = field(default_factory=lambda: load_preset().hand)

    @property
    def finger_height(self) -> float:
        """Depth of the cloud below an object's top that counts [m]: the length of the pads (paper, appendix D)."""
        return self.hand.pad_length


@dataclass(frozen=True)
class StationConfig:
    """Limits and times of the station, with the graph's workspace and base_frame; times in s, timeouts in wall time.

    max_age: greatest age of a usable picture; silence: time without pictures after which the camera counts as gone;
    settle: rest after a motion before a picture counts; lost: absence after which the executor counts as lost;
    answer_timeout: until a goal is accepted; goal_timeout: until it ends; cancel_timeout: until a cancel is confirmed;
    proposal_timeout: until the policy has answered; min_free: least free space on the disk for a step [bytes];
    crop: edge of the policy's crop around its proposal [heightmap cells]; home: positions of the joints by name at
    which the arm rests; home_tolerance: how far from it each joint may be [rad]; reach_delay: for which a drawing is
    left alone before the arm is asked whether it can do it.
    """

    workspace: WorkspaceSpec = field(default_factory=WorkspaceSpec)
    base_frame: str = field(default_factory=lambda: load_preset().base_frame)
    box: BoxConfig = field(default_factory=BoxConfig)
    max_age: float = 1.0
    silence: float = 3.0
    settle: float = 0.1
    lost: float = 1.0
    answer_timeout: float = 5.0
    goal_timeout: float = 120.0
    cancel_timeout: float = 5.0
    proposal_timeout: float = 45.0
    min_free: int = 64_000_000
    crop: int = 32
    home: Mapping[str, float] = field(default_factory=lambda: ready_pose(load_preset()))
    home_tolerance: float = 0.05
    reach_delay: float = 0.3
