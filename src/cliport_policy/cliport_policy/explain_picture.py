"""One picture of what a policy sees, scores and decides, turned as all overlays: +x up, +y left.

See docs/paper.md, "Pictures of affordances".
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from cliport_core.heightmap import Heightmap
from cliport_core.pose import PlanarPose
from cliport_policy.inference import Explanation
from cliport_policy.networks.rotation import rotated_windows
from cliport_policy.overlays import PICK_COLOR, PLACE_COLOR, draw_gripper, render_overlay, render_scene

CROP_PIXELS = 64
DETAIL = 384  # side of the pictures in the bottom row
TITLE = 30  # height of a line of text
_BACKGROUND, _TEXT_COLOR, _FRAME_COLOR = (24, 24, 28), (235, 235, 235), (110, 110, 120)
_FULL_HEIGHT = 0.15  # m: shown brightest

Picture = NDArray[np.uint8]


def render_explanation(
    heightmap: Heightmap,
    instruction: str,
    explanation: Explanation,
    recorded: tuple[PlanarPose, PlanarPose] | None = None,
) -> Picture:
    """Draw an explanation as one picture, (H, W, 3) RGB.

    It shows colour and height, the affordances of pick and place, the crop at the pick as the gripper would be turned
    to it, and the probabilities of the gripper's yaws and of the rotations from pick to place.

    recorded: the pick and the place that someone else chose; they take the height's place.
    """
    inference = explanation.inference
    action, maps = inference.action, inference.maps
    scenes = [
        titled("what is seen", render_scene(heightmap)),
        titled(f"height, 0 to {100 * _FULL_HEIGHT:.0f} cm", render_height(heightmap))
        if recorded is None
        else titled("as recorded", render_grippers(heightmap, *recorded)),
        titled("pick affordance", render_overlay(heightmap, maps.pick if maps else None, inference, "pick")),
        titled("place affordance", render_overlay(heightmap, maps.place if maps else None, inference, "place")),
    ]
    details = [
        titled("at the pick, turned", render_crop(heightmap, inference.pick_pixel, action.pick.yaw)),
        titled("gripper yaw" + _best(explanation.yaws), render_rotations(explanation.yaws, PICK_COLOR)),
        titled("place - pick" + _best(explanation.rotations), render_rotations(explanation.rotations, PLACE_COLOR)),
    ]
    summary = (
        f"pick {inference.pick_confidence:.2f} at ({action.pick.x:.3f}, {action.pick.y:.3f}) m   "
        f"place {inference.place_confidence:.2f} at ({action.place.x:.3f}, {action.place.y:.3f}) m   "
        f"done {inference.done_probability:.2f}"
    )
    rows = [_side_by_side(scenes[:2]), _side_by_side(scenes[2:]), _side_by_side(details)]
    width = max(row.shape[1] for row in rows)
    pictures = [_line(instruction, width), _line(summary, width)]
    pictures += [_pad_width(row, width) for row in rows]
    return np.vstack(pictures)


def render_height(heightmap: Heightmap) -> Picture:
    """Draw heights as colours, unseen cells dark grey, in render_scene's size."""
    share = np.clip(heightmap.height / _FULL_HEIGHT, 0, 1)
    colors = cv2.applyColorMap((share * 255).astype(np.uint8), cv2.COLORMAP_VIRIDIS)[..., ::-1]
    shown = Heightmap(np.ascontiguousarray(colors), heightmap.height, heightmap.valid, heightmap.workspace)
    return render_scene(shown)


def render_grippers(heightmap: Heightmap, pick: PlanarPose, place: PlanarPose) -> Picture:
    """Draw the scene with the gripper at a pick and a place, in render_scene's size."""
    picture = render_scene(heightmap)
    draw_gripper(picture, heightmap.workspace, pick, PICK_COLOR)
    draw_gripper(picture, heightmap.workspace, place, PLACE_COLOR)
    return picture


def render_crop(heightmap: Heightmap, pixel: tuple[int, int], yaw: float) -> Picture:
    """Draw the 64 pixels around a pick, turned so that the gripper closes along the picture's vertical."""
    scene = torch.from_numpy(heightmap.color * heightmap.valid[..., None]).permute(2, 0, 1)[None].float()
    centers, angles = torch.tensor([pixel], dtype=torch.float32), torch.tensor([[yaw]])
    window = rotated_windows(scene, centers, angles, CROP_PIXELS)[0, 0].permute(2, 1, 0).flip(0, 1)  # +x up, +y left
    crop = np.ascontiguousarray(window.round().to(torch.uint8).numpy())
    picture: Picture = cv2.resize(crop, (DETAIL, DETAIL), interpolation=cv2.INTER_NEAREST)  # type: ignore[assignment]
    middle, reach, half = DETAIL // 2, DETAIL // 4, DETAIL // 16
    for side in (-1, 1):
        at = middle + side * reach
        cv2.line(picture, (middle - half, at), (middle + half, at), PICK_COLOR, 3, cv2.LINE_AA)
        cv2.line(picture, (middle, middle), (middle, at), PICK_COLOR, 1, cv2.LINE_AA)
    return picture


def render_rotations(probabilities: NDArray[np.float32] | None, color: tuple[int, int, int]) -> Picture:
    """Draw the probabilities (k,) of turns by i * 360 / k degrees as bars around a circle.

    No turn points upwards, and turns grow to the left. None is drawn as a choice that does not exist.
    """
    picture = np.full((DETAIL, DETAIL, 3), _BACKGROUND, np.uint8)
    middle, inner, outer = DETAIL // 2, DETAIL // 8, DETAIL // 2 - 12
    for radius in (inner, outer):
        cv2.circle(picture, (middle, middle), radius, _FRAME_COLOR, 1, cv2.LINE_AA)
    if probabilities is None:
        _write(picture, "none", (middle - 20, middle + 6))
        return picture
    k, best = len(probabilities), int(np.argmax(probabilities))
    share = np.nan_to_num(probabilities / max(float(probabilities.max()), 1e-12))
    for i in range(k):
        angle = 2 * math.pi * i / k
        length = inner + float(share[i]) * (outer - inner)
        ends = [(round(middle - r * math.sin(angle)), round(middle - r * math.cos(angle))) for r in (inner, length)]
        cv2.line(picture, ends[0], ends[1], color if i == best else _TEXT_COLOR, max(2, 200 // k), cv2.LINE_AA)
    return picture


def _best(probabilities: NDArray[np.float32] | None) -> str:
    if probabilities is None:
        return ": this network has no rotator"
    best = int(np.argmax(probabilities))
    return f": {360 * best / len(probabilities):.0f} degrees, {float(probabilities[best]):.2f}"


def titled(title: str, picture: Picture) -> Picture:
    """Return a picture with a line of text above it."""
    return np.vstack([_line(title, picture.shape[1]), picture])


def _line(text: str, width: int) -> Picture:
    line = np.full((TITLE, width, 3), _BACKGROUND, np.uint8)
    _write(line, text, (8, TITLE - 9))
    return line


def _write(picture: Picture, text: str, at: tuple[int, int]) -> None:
    cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.55, _TEXT_COLOR, 1, cv2.LINE_AA)


def _side_by_side(pictures: list[Picture]) -> Picture:
    return np.hstack(pictures)


def _pad_width(picture: Picture, width: int) -> Picture:
    rest = np.full((picture.shape[0], width - picture.shape[1], 3), _BACKGROUND, np.uint8)
    return np.hstack([picture, rest])
