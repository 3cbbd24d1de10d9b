"""Every number of the station in one value."""

from __future__ import annotations

from dataclasses import dataclass, field

from cliport_perception.workspace import WorkspaceSpec


@dataclass(frozen=True)
class BoxConfig:
    """How a box's cloud is read; lengths in m, as the executor's grasp has them.

    finger_height: how far below its top an object is looked at (paper, appendix D); min_height: what rises less
    above the table is the table; table_z: of the table; min_points, min_share: of a box's pixels, with depth;
    widest: what the opened fingers go round.
    """

    finger_height: float = 0.0185
    min_height: float = 0.008
    table_z: float = 0.0
    min_points: int = 12
    min_share: float = 0.2
    widest: float = 0.075


@dataclass(frozen=True)
class StationConfig:
    """workspace and base_frame: the graph's own. Times in s, those ending in _timeout of wall time.

    max_age: how old a picture may be; silence: without pictures the camera is gone after this;
    settle: rest after a motion, before a picture counts; lost: an executor
    that is not there for so long is lost; answer_timeout: until a goal is taken; goal_timeout: until it is over;
    cancel_timeout: until a cancel is confirmed; proposal_timeout: until the policy has answered;
    min_free: of the disk, without which nothing is begun [bytes]; crop: edge of the policy's crop around its
    proposal [heightmap cells].
    """

    workspace: WorkspaceSpec = field(default_factory=WorkspaceSpec)
    base_frame: str = "panda_link0"
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
