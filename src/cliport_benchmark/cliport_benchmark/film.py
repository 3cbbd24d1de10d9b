"""A short video of an episode, with the sentence below the picture."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

import cv2

from cliport_benchmark.contact_sheet import Captioned, captioned
from cliport_benchmark.errors import DataFolderError
from cliport_benchmark.stage_camera import StageCamera
from sim_bridge.tasks import Task
from sim_bridge.world import SimWorld

EVERY = 0.1  # simulated time between two frames [s]
SPEED_UP = 3.0
_SIZE = (480, 400)
_SENTENCE_LINES = 2  # of text under the picture, at most
_END_S = 1.5  # time for which the end is shown [s]


class Film:
    """Records a world while the task set up in it is acted on; a context, at whose good end the file is there.

    Raises:
        DataFolderError: when the file cannot be written.
    """

    def __init__(self, path: Path, world: SimWorld, task: Task) -> None:
        self._world, self._task = world, task
        self._camera = StageCamera(*_SIZE, finer=2)
        self._path, self._part = path, path.with_name(f".{path.name}.part.mp4")
        self._writer, self._next = cv2.VideoWriter(), 0.0

    def __enter__(self) -> Film:
        return self

    def on_tick(self) -> None:
        """Take a frame when it is time for one."""
        if self._world.time >= self._next:
            self._next = self._world.time + EVERY
            self._take(1)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self._take(round(_END_S * SPEED_UP / EVERY))
        self._writer.release()
        if kind is None:
            self._part.replace(self._path)
        self._part.unlink(missing_ok=True)

    def _take(self, times: int) -> None:
        picture = Captioned(self._task.name, self._camera.picture(self._world), self._task.instruction)
        frame = captioned(picture, _SENTENCE_LINES)
        height, width = (size - size % 2 for size in frame.shape[:2])  # codecs want even sizes
        if not self._writer.isOpened():
            codec = cv2.VideoWriter.fourcc(*"vp09")
            if not self._writer.open(str(self._part), codec, SPEED_UP / EVERY, (width, height)):
                raise DataFolderError(f"cannot write {self._path}: no folder, no permission or no VP9 encoder")
        for _ in range(times):
            self._writer.write(cv2.cvtColor(frame[:height, :width], cv2.COLOR_RGB2BGR))
