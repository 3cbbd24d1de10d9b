"""The depth camera's scale and offset, and the table's height, taken over into a calibration."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

from cliport_core.workspace import WorkspaceSpec
from cliport_perception.calibration.calibration_file import CalibrationRecord
from cliport_perception.calibration.depth_check import DepthCheck, check_depth
from cliport_perception.calibration.result import SIGMAS, Acceptance
from cliport_perception.calibration.verification import Frame
from cliport_perception.depth_correction import AS_MEASURED, DepthCorrection
from cliport_perception.errors import CalibrationError
from cliport_perception.table_watch import TablePlane, TableWatch


class AppliedDepth(NamedTuple):
    """A calibration with depth corrected, and the table's plane as it is seen then."""

    record: CalibrationRecord
    plane: TablePlane

    def in_words(self) -> list[str]:
        """Return what is in the file now, in a line."""
        depth, table_z = self.record.depth or AS_MEASURED, self.record.table_z or 0.0
        return [
            f"applied: depth = {depth.scale:.4f} x measured {1e3 * depth.offset:+.1f} mm, table_z {table_z:.4f} m in "
            f"{self.record.base_frame}; give perception, executor and page this file as their parameter calibration"
        ]


def apply_depth(
    found: DepthCheck | None, frame: Frame, record: CalibrationRecord, workspace: WorkspaceSpec
) -> AppliedDepth:
    """Return the calibration with the scale, offset and table height that a frame shows.

    found: the frame's check; frame: its depth is corrected as the record says already.

    Raises:
        CalibrationError: when the frame does not tell them well enough, or something else than depth is wrong.
    """
    if found is None:
        raise CalibrationError("depth cannot be applied: too little of the table is seen; clear it, and try again")
    limits = Acceptance()
    open_mm = 0.0 if found.mended is None else SIGMAS * 1e3 * found.mended.sigma
    if not open_mm <= limits.mm:
        raise CalibrationError(
            f"depth is not applied: the board leaves the table's height open by {open_mm:.1f} mm (at most "
            f"{limits.mm:g}); hold it nearer, take a larger one, or take it away where the table is at z = 0"
        )
    step = DepthCorrection(1.0 if found.scale is None else found.scale.value, found.offset.value)
    corrected = step.apply(frame.depth)
    plane = TableWatch(record.camera.intrinsics, record.camera.camera_in_base, workspace).measure(corrected)
    again = None if plane is None else check_depth(corrected, frame.board, record.camera, workspace, plane)
    if plane is None or again is None:
        raise CalibrationError(
            "depth is not applied: no table is seen once it is corrected; calibrate the camera again"
        )
    tilt = math.degrees(math.atan(math.hypot(plane.slope_x, plane.slope_y)))
    if tilt > limits.deg:
        raise CalibrationError(
            f"depth is not applied: the table stays tilted by {tilt:.1f} degrees (at most {limits.deg:g}), which is "
            "the camera's pose and not its depth; calibrate the camera again"
        )
    total = step.after(record.depth or AS_MEASURED)
    rounded = DepthCorrection(round(total.scale, 6), round(total.offset, 6))
    return AppliedDepth(replace(record, depth=rounded, table_z=round(again.table.value, 4)), plane)
