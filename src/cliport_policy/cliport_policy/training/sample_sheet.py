"""Sheet of training samples, reworded, moved and repainted, with their labels, to look over before training."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from cliport_core.heightmap import Heightmap
from cliport_core.pose import PlanarPose
from cliport_core.workspace import WorkspaceSpec
from cliport_policy.data.batches import Batch
from cliport_policy.explain_picture import render_grippers, titled
from cliport_policy.observation import unscaled
from cliport_policy.overlays import render_scene

MAX_SAMPLES = 12
_COLUMNS = 3
_WIDTH = 480  # pixels of one sample


def sample_sheet(batch: Batch, workspace: WorkspaceSpec) -> NDArray[np.uint8]:
    """Draw up to 12 samples of a batch under their sentences, with the grippers at pick and place: (H, W, 3) RGB."""
    count = min(len(batch.phrases), MAX_SAMPLES)
    pictures = [_sample(batch, i, workspace) for i in range(count)]
    pictures += [np.zeros_like(pictures[0])] * (-count % _COLUMNS)
    return np.vstack([np.hstack(pictures[i : i + _COLUMNS]) for i in range(0, len(pictures), _COLUMNS)])


def _sample(batch: Batch, i: int, workspace: WorkspaceSpec) -> NDArray[np.uint8]:
    channels = unscaled(batch.images[i : i + 1].float())[0].permute(1, 2, 0).numpy()  # (H, W, 4)
    color = np.rint(255 * np.clip(channels[..., :3], 0, 1)).astype(np.uint8)
    scene = Heightmap(color, channels[..., 3], batch.images[i, 4].numpy() > 0.5, workspace)
    acts, yaw = bool(batch.acts[i]), float(batch.pick_yaw[i])
    if not acts:
        picture = render_scene(scene)
    else:
        pick = _pose(workspace, batch.pick[i], yaw)
        place = _pose(workspace, batch.place[i], yaw + float(batch.rotation[i]))
        picture = render_grippers(scene, pick, place)
    height = round(_WIDTH * picture.shape[0] / picture.shape[1])
    small = cv2.resize(picture, (_WIDTH, height), interpolation=cv2.INTER_AREA)
    remark = "" if acts else "   (finished)" if batch.done[i] else "   (not here)"
    return titled(batch.phrases[i] + remark, small)


def _pose(workspace: WorkspaceSpec, pixel: Tensor, yaw: float) -> PlanarPose:
    x, y = workspace.pixel_to_xy(float(pixel[0]), float(pixel[1]))
    return PlanarPose(x, y, yaw)
