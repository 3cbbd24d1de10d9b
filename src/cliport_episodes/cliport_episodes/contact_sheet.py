"""Contact sheet: all steps of an episode in one picture, with the pick and place of each."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import numpy as np

from cliport_core.pose import PlanarPose
from cliport_episodes.demonstration import PixelBox
from cliport_episodes.drawing import FAINT, INK, PICK_COLOR, PLACE_COLOR, Color, Picture, save_png, write_text
from cliport_episodes.edits import verdict_words
from cliport_episodes.errors import BagError
from cliport_episodes.observation import Observation
from cliport_episodes.reader import Episode, Step

_WIDTH = 480  # width of one step [pixels]
_CAPTION = 56  # height of the words below it [pixels]
_COLUMNS = 3
_REACH = 0.04  # half the length of the bar that shows a yaw [m]


def draw_contact_sheet(episode: Episode, path: Path) -> None:
    """Write the sheet as PNG: box, position and yaw of pick (red) and place (green), and the scene at the end.

    Raises:
        DiskError: when the file cannot be written.
    """
    camera = episode.setup.camera
    height = round(_WIDTH * camera.height / camera.width)
    cells = [_step_cell(step, height) for step in episode.steps]
    if episode.final is not None:
        cells.append(_cell(_scaled(episode.final.color, height), "after the last step", ""))
    columns = min(_COLUMNS, max(1, len(cells)))
    rows = max(1, math.ceil(len(cells) / columns))
    cell_height = height + _CAPTION
    sheet: Picture = np.full((40 + rows * cell_height, columns * (_WIDTH + 8), 3), 255, dtype=np.uint8)
    verdict = verdict_words(episode.success)
    write_text(sheet, f"{episode.name}   {len(episode.steps)} steps, {verdict}", 26, 8, 18)
    for number, cell in enumerate(cells):
        top, left = 40 + number // columns * cell_height, number % columns * (_WIDTH + 8)
        sheet[top : top + cell_height, left : left + _WIDTH] = cell
    save_png(sheet, path)


def _step_cell(step: Step, height: int) -> Picture:
    record = step.record
    words = f"{record.step}  {record.instruction}"
    details = f"{record.action.primitive.label}, {record.source.name.lower()}, {record.ending}"
    try:
        observation = step.observation()
    except BagError as error:
        return _cell(np.full((height, _WIDTH, 3), 200, dtype=np.uint8), words, str(error))
    picture = _scaled(observation.color, height)
    scale = _WIDTH / observation.camera.width
    for box, pose, color in (
        (record.pick_box, record.action.pick, PICK_COLOR),
        (record.place_box, record.action.place, PLACE_COLOR),
    ):
        if box is not None:
            _draw_box(picture, box, scale, color)
        _draw_pose(picture, observation, step, pose, scale, color)
    return _cell(picture, words, details)


def _draw_box(picture: Picture, box: PixelBox, scale: float, color: Color) -> None:
    top_left = round(box.left * scale), round(box.top * scale)
    bottom_right = round(box.right * scale), round(box.bottom * scale)
    cv2.rectangle(picture, top_left, bottom_right, color, 2)


def _draw_pose(
    picture: Picture, observation: Observation, step: Step, pose: PlanarPose, scale: float, color: Color
) -> None:
    """Draw a bar along the pose's yaw, on the surface that the camera saw there."""
    workspace = step.setup.workspace
    z = 0.0
    if workspace.contains_xy(pose.x, pose.y):
        z = float(observation.heightmap(workspace).height[workspace.xy_to_pixel(pose.x, pose.y)])
    reach = _REACH * np.array([math.cos(pose.yaw), math.sin(pose.yaw), 0.0])
    points = np.array([pose.x, pose.y, z]) + np.array([-1.0, 0.0, 1.0])[:, None] * reach
    in_camera = observation.camera_in_base.inverse().apply(points)
    if np.any(in_camera[:, 2] <= 0.0):  # behind the camera
        return
    pixels = np.clip(observation.camera.project(in_camera) * scale, -1e4, 1e4).round().astype(int)
    start, middle, end = ((int(col), int(row)) for row, col in pixels)
    for ink, thickness in (((255, 255, 255), 3), (color, 1)):  # thin: what is picked should be seen
        cv2.line(picture, start, end, ink, thickness, cv2.LINE_AA)
        cv2.circle(picture, middle, 1 + thickness, ink, -1, cv2.LINE_AA)


def _scaled(color: Picture, height: int) -> Picture:
    return np.asarray(cv2.resize(color, (_WIDTH, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _cell(picture: Picture, words: str, details: str) -> Picture:
    caption: Picture = np.full((_CAPTION, _WIDTH, 3), 255, dtype=np.uint8)
    write_text(caption, words, 20, 4, 16, INK)
    write_text(caption, details, 42, 4, 14, FAINT)
    return np.vstack([picture, caption])
