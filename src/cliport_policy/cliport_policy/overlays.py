"""Pictures for people: affordances and grippers drawn over the scene seen from above.

Pictures are turned as someone behind the robot sees the table: +x up, +y to the left.
"""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cliport_core.heightmap import Heightmap
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.inference import Inference
from panda_model import load_preset

SCALE = 3  # picture pixels per heightmap pixel
PICK_COLOR = (255, 60, 60)  # RGB
PLACE_COLOR = (60, 255, 90)
_HEAT_SHARE = 0.65  # share of heat in the mix at the highest affordance
_HAND = load_preset().hand


def render_scene(heightmap: Heightmap) -> NDArray[np.uint8]:
    """Draw the colours from above as (cols * SCALE, rows * SCALE, 3) RGB; unseen cells are dark grey."""
    color = np.where(heightmap.valid[..., None], heightmap.color, np.uint8(40))
    return _enlarge(_turn(color), cv2.INTER_NEAREST)


def render_overlay(
    heightmap: Heightmap, affordance: NDArray[np.float32] | None, inference: Inference, kind: str
) -> NDArray[np.uint8]:
    """Draw the scene with one affordance map (rows, cols) as heat and the gripper at pick and place, RGB.

    kind: "pick" or "place", named in the picture and drawn thick; affordance None leaves the heat out.
    """
    picture = render_scene(heightmap)
    if affordance is not None:
        picture = _add_heat(picture, affordance)
    for name, pose, color in (
        ("pick", inference.action.pick, PICK_COLOR),
        ("place", inference.action.place, PLACE_COLOR),
    ):
        draw_gripper(picture, heightmap.workspace, pose, color, 3 if name == kind else 1)
    confidence = inference.pick_confidence if kind == "pick" else inference.place_confidence
    text = f"{kind} {confidence:.2f}   done {inference.done_probability:.2f}"
    for color, thickness in (((0, 0, 0), 4), ((255, 255, 255), 1)):
        cv2.putText(picture, text, (10, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.6, color, thickness, cv2.LINE_AA)
    return picture


def draw_gripper(
    picture: NDArray[np.uint8],
    workspace: WorkspaceSpec,
    pose: PlanarPose,
    color: tuple[int, int, int],
    thickness: int = 2,
) -> None:
    """Draw two fingers, closing along the yaw's direction, and a dot between them into a picture."""
    along = np.array([math.cos(pose.yaw), math.sin(pose.yaw)])
    across = np.array([-along[1], along[0]])
    centre = np.array([pose.x, pose.y])

    def at(xy: NDArray[np.float64]) -> tuple[int, int]:
        return picture_point(workspace, float(xy[0]), float(xy[1]))

    for side in (-1.0, 1.0):
        finger = centre + side * 0.5 * _HAND.opening * along
        half = _HAND.finger_half_width * across
        cv2.line(picture, at(finger - half), at(finger + half), color, thickness + 1, cv2.LINE_AA)
        cv2.line(picture, at(centre), at(finger), color, thickness, cv2.LINE_AA)
    cv2.circle(picture, at(centre), 3 + thickness, color, -1, cv2.LINE_AA)


def picture_point(workspace: WorkspaceSpec, x: float, y: float) -> tuple[int, int]:
    """Return a position [m, base frame] in a picture, as OpenCV's (right, down)."""
    right = (workspace.y_max - y) / workspace.pixel_size * SCALE
    down = (workspace.x_max - x) / workspace.pixel_size * SCALE
    return round(right), round(down)


def save_png(path: str | Path, picture: NDArray[np.uint8]) -> None:
    """Write an RGB picture.

    Raises:
        OSError: if the file can't be written.
    """
    done, data = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    if not done:
        raise OSError(f"cannot encode a picture of shape {picture.shape} as PNG")
    Path(path).write_bytes(data.tobytes())


def _add_heat(picture: NDArray[np.uint8], affordance: NDArray[np.float32]) -> NDArray[np.uint8]:
    peak = float(affordance.max()) if affordance.size else 0.0
    if not math.isfinite(peak) or peak <= 0.0:
        return picture
    # the square root makes the second best visible beside a sharp peak
    heat = _enlarge(_turn(np.sqrt(np.clip(affordance / peak, 0.0, 1.0)).astype(np.float32)), cv2.INTER_LINEAR)
    colors = cv2.applyColorMap((heat * 255).astype(np.uint8), cv2.COLORMAP_JET)[..., ::-1]
    share = (_HEAT_SHARE * heat)[..., None]
    mixed: NDArray[np.uint8] = (picture * (1.0 - share) + colors * share).astype(np.uint8)
    return mixed


def _turn(cells: NDArray[np.generic]) -> NDArray[np.generic]:
    """Turn (rows, cols, ...) along y and x to a picture with +x up and +y to the left."""
    return np.swapaxes(cells, 0, 1)[::-1, ::-1]


def _enlarge(cells: NDArray[np.generic], interpolation: int) -> NDArray[np.uint8]:
    size = (cells.shape[1] * SCALE, cells.shape[0] * SCALE)
    result: NDArray[np.uint8] = cv2.resize(np.ascontiguousarray(cells), size, interpolation=interpolation)
    return result
