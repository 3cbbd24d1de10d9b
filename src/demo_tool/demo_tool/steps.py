"""A choice and how it ended -> the record of a step."""

from __future__ import annotations

from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.demonstration import StepRecord
from demo_tool.draft_desk import Choice
from demo_tool.live_view import LiveView
from demo_tool.ports import ArmResult, PickPlaceGoal
from demo_tool.station_config import StationConfig


def setup_of(view: LiveView, config: StationConfig) -> CaptureSetup:
    """What must be the same in all episodes of a data set."""
    return CaptureSetup(config.workspace, view.camera, view.frame, config.base_frame, view.camera_in_base)


def goal_of(choice: Choice, instruction: str, plan_only: bool = False) -> PickPlaceGoal:
    """What the arm is asked for."""
    return PickPlaceGoal(
        choice.pick, choice.place, choice.primitive, instruction, choice.view.stamp_ns, plan_only=plan_only
    )


def record_of(
    step: int, choice: Choice, instruction: str, result: ArmResult | None, config: StationConfig
) -> StepRecord:
    """Step number `step`; result None: the arm was not moved."""
    pick, place = choice.draft.pick, choice.draft.place
    assert pick is not None and place is not None  # a choice is a whole draft
    return StepRecord(
        step=step,
        stamp_ns=choice.view.stamp_ns,
        frame_id=config.base_frame,
        instruction=instruction,
        primitive=choice.primitive,
        source=choice.draft.source,
        pick_box=pick.box,
        place_box=place.box,
        pick_rotation=config.workspace.bin_of_yaw(choice.pick.yaw),
        place_rotation=config.workspace.bin_of_yaw(choice.place.yaw),
        n_rotations=config.workspace.n_rotations,
        pick=choice.pick,
        place=choice.place,
        executed=result is not None,
        outcome=int(result.outcome) if result is not None else 0,
        message=result.message if result is not None else "",
        grasp_centroid=result.grasp_centroid if result is not None else None,
        gripper_width=result.gripper_width if result is not None else 0.0,
    )
