"""Film of the arm's motion: the camera's pictures a few times a second, small, for who looks at the step later."""

from __future__ import annotations

import logging
import threading

import cv2
import numpy as np

from cliport_core.image_files import encode_jpeg
from cliport_episodes.motion_video import MotionVideo
from demo_tool.errors import EXPECTED_ERRORS
from demo_tool.picture_feed import Picture, PictureFeed

PERIOD = 0.25  # between two pictures, at first [s]
MOST_FRAMES = 240  # then every other one goes, and the period doubles: the whole motion stays
WIDTH = 320  # greatest [pixels]
_QUALITY = 60
_WAIT = 0.2  # longest wait for a picture [s]; the end of a motion waits as long
_LOG = logging.getLogger(__name__)


class MotionFilm:
    """Film of one motion at a time, taken in a thread of its own. Nothing that fails here reaches the caller."""

    def __init__(self, feed: PictureFeed) -> None:
        """feed: pictures (H, W, 3) RGB."""
        self._feed = feed
        self._end = threading.Event()
        self._thread: threading.Thread | None = None
        self._frames: list[tuple[int, bytes]] = []  # with their stamps [ns]
        self._size = (0, 0)
        self._period = PERIOD

    def begin(self) -> None:
        """Begin a film, unless one is being taken; does not wait."""
        if self._thread is None:
            self._frames, self._period = [], PERIOD
            self._end.clear()
            self._thread = threading.Thread(target=self._take, name="film", daemon=True)
            self._thread.start()

    def end(self) -> None:
        """End the film; does not wait."""
        self._end.set()

    def taken(self) -> MotionVideo | None:
        """Return the film that was ended, None where there is none; waits for its last picture."""
        if self._thread is None:
            return None
        self._end.set()
        self._thread.join()
        self._thread = None
        if not self._frames:
            return None
        stamps, frames = zip(*self._frames, strict=True)
        period = 1e-9 * (stamps[-1] - stamps[0]) / (len(stamps) - 1) if len(stamps) > 1 else self._period
        return MotionVideo(frames, period, *self._size)

    def _take(self) -> None:
        sequence = 0
        try:
            while not self._end.is_set():
                picture = self._feed.get(sequence, _WAIT)
                if picture is None:
                    continue
                sequence = picture.sequence
                self._add(picture)
                self._end.wait(self._period)
        except (*EXPECTED_ERRORS, cv2.error) as error:  # a camera whose pictures cannot be decoded
            _LOG.warning("the motion is not filmed any further: %s", error)

    def _add(self, picture: Picture) -> None:
        pixels = picture.pixels
        height, width = pixels.shape[:2]
        if width > WIDTH:
            size = (WIDTH, max(1, round(height * WIDTH / width)))
            pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
        size = (pixels.shape[1], pixels.shape[0])
        if self._frames and size != self._size:
            return  # a camera that changed its size
        self._size = size
        self._frames.append((picture.stamp_ns, encode_jpeg(pixels, _QUALITY)))
        if len(self._frames) >= MOST_FRAMES:
            self._frames, self._period = self._frames[::2], 2.0 * self._period
