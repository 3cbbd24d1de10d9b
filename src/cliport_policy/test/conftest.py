"""A tiny demonstration set, drawn flat, in the format that cliport_benchmark generate writes."""

import json
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from cliport_perception.workspace import WorkspaceSpec

COLORS = {"red": (255, 87, 89), "blue": (78, 121, 167)}


def _png(image: np.ndarray) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def write_flat_set(folder: Path, observations: int, seed: int = 0) -> Path:
    """A red block and a blue bowl, drawn as squares; every third observation is a done one."""
    folder.mkdir(parents=True)
    workspace = WorkspaceSpec()
    rng = np.random.default_rng(seed)
    rows = []
    for i in range(observations):
        color = np.full((*workspace.shape, 3), 200, np.uint8)
        height = np.zeros(workspace.shape, np.float32)
        pick = (int(rng.integers(40, 120)), int(rng.integers(30, 130)))
        place = (int(rng.integers(200, 280)), int(rng.integers(30, 130)))
        for (row, col), name, half in ((pick, "red", 8), (place, "blue", 20)):
            color[row - half : row + half, col - half : col + half] = COLORS[name]
            height[row - half : row + half, col - half : col + half] = 0.04
        units = np.round((height - workspace.z_min) / 1e-4).astype(np.uint16)
        demo = {
            "instruction": "put the red blocks in a blue bowl",
            "block": "red",
            "bowl": "blue",
            "done": i % 3 == 2,
            "pick_row": pick[0],
            "pick_col": pick[1],
            "pick_yaw": 0.0,
            "pick_yaw_period": float(np.pi / 2),
            "place_row": place[0],
            "place_col": place[1],
            "place_yaw": 0.0,
        }
        rows.append(
            {
                "episode": i,
                "seed": i,
                "step": 0,
                "color_png": _png(color[..., ::-1]),
                "height_png": _png(units),
                "valid_png": _png(np.full(workspace.shape, 255, np.uint8)),
                "demos": [demo],
            }
        )
    pq.write_table(pa.Table.from_pylist(rows), folder / "part-00000.parquet")
    (folder / "meta.json").write_text(json.dumps({"version": 1, "workspace": workspace.to_dict()}))
    return folder


@pytest.fixture
def flat_set(tmp_path: Path) -> Path:
    return write_flat_set(tmp_path / "data", 6)
