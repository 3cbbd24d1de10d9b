"""Conversions from a drawn action to the arm's goal and to the step's record."""

from __future__ import annotations

import math
from dataclasses import replace

from cliport_core.action import ActionGoal
from cliport_core.outcome import ActionResult
from cliport_episodes.capture_setup import CaptureSetup
from cliport_episodes.demonstration import StepRecord
from demo_tool.draft_desk import DrawnAction
from demo_tool.live_view import LiveView
from demo_tool.station_config import StationConfig


def setup_of(view: LiveView, config: StationConfig) -> CaptureSetup:
    """Return the setup, which must be the same in all episodes of a data set."""
    return CaptureSetup(
        config.workspace, view.camera, view.frame, config.base_frame, view.camera_in_base, view.correction
    )


def goal_of(drawn: DrawnAction, instruction: str, plan_only: bool = False) -> ActionGoal:
    """Return the goal for the arm; plan_only: without moving."""
    return ActionGoal(drawn.action, instruction, drawn.view.stamp_ns, plan_only)


def record_of(
    step: int, drawn: DrawnAction, instruction: str, result: ActionResult | None, config: StationConfig
) -> StepRecord:
    """Return the record of step number `step`; result: None where the arm was not moved.

    A measurement of the result that is not a finite number is recorded as not made: the step has moved the arm.
    """
    pick, place = drawn.draft.pick, drawn.draft.place
    assert pick is not None and place is not None  # a drawn action is a whole draft
    return StepRecord(
        step=step,
        stamp_ns=drawn.view.stamp_ns,
        frame_id=config.base_frame,
        instruction=instruction,
        source=drawn.draft.source,
        pick_box=pick.box,
        place_box=place.box,
        pick_rotation=config.workspace.bin_of_yaw(drawn.action.pick.yaw),
        place_rotation=config.workspace.bin_of_yaw(drawn.action.place.yaw),
        n_rotations=config.workspace.n_rotations,
        action=drawn.action,
        result=None if result is None else _with_finite_measurements(result),
    )


def _with_finite_measurements(result: ActionResult) -> ActionResult:
    if not math.isfinite(result.gripper_width):
        result = replace(result, gripper_width=0.0)
    if result.grasp_centroid is not None and not all(map(math.isfinite, result.grasp_centroid)):
        result = replace(result, grasp_centroid=None)
    return result
