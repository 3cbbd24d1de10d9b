"""Endpoints for pictures: live ones by long poll, recorded ones at once."""

from __future__ import annotations

from collections.abc import Callable
from http import HTTPStatus

import anyio
from anyio.to_thread import run_sync
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from demo_tool.errors import DemoToolError
from demo_tool.picture_feed import Picture
from demo_tool.station import PICTURES, Station
from demo_tool.web.jpeg import LEVELS, START_LEVEL, JpegCache, encode, next_level

MAX_POLLS = 24
_SLICE_S = 0.25  # one wait of a long poll; a page that is gone keeps a thread for as long
_SLICES = 12  # waits of a long poll
_MAX_WIDTH = 4096
_STILL = LEVELS[-1]


class Pictures:
    """Endpoints for the station's pictures."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._cache = JpegCache()
        self._polls = anyio.CapacityLimiter(MAX_POLLS)
        self._readings = anyio.CapacityLimiter(2)

    async def live(self, request: Request) -> Response:
        """Answer GET /picture/{name}.jpg?after=N&width=&level=&took= with the next picture after number N, or 204.

        width: the page's own [pixels]; level: the last picture's; took: its transfer time [ms]. The answer's X-Level is
        its level, to be sent with the next request. 503 says in words why there is no picture.
        """
        name = request.path_params["name"]
        if name not in PICTURES:
            known = ", ".join(PICTURES)
            raise HTTPException(HTTPStatus.NOT_FOUND, f"there is no picture of that name; there are {known}")
        after = _number(request, "after", 0, 2**53)
        max_width = _number(request, "width", _MAX_WIDTH, _MAX_WIDTH)
        level = _number(request, "level", START_LEVEL, len(LEVELS) - 1)
        if "took" in request.query_params:
            level = next_level(level, _number(request, "took", 0, 600_000))
        if self._polls.available_tokens < 1:
            raise HTTPException(HTTPStatus.SERVICE_UNAVAILABLE, f"{MAX_POLLS} pictures are being waited for")
        for _ in range(_SLICES):
            picture = await self._next(name, after)
            if picture is not None:
                sequence, stamp_ns, pixels = picture
                file = await run_sync(
                    self._cache.file, name, sequence, pixels, LEVELS[level], max_width, limiter=self._polls
                )
                numbers = {"X-Sequence": str(sequence), "X-Stamp-Ns": str(stamp_ns), "X-Level": str(level)}
                return Response(file, media_type="image/jpeg", headers=numbers)
            if request.app.state.ending or await request.is_disconnected():
                break
        return Response(status_code=HTTPStatus.NO_CONTENT)

    async def _next(self, name: str, after: int) -> Picture | None:
        try:
            return await run_sync(self._station.picture, name, after, _SLICE_S, limiter=self._polls)
        except DemoToolError as error:  # as for a camera whose encoding is not known
            raise HTTPException(HTTPStatus.SERVICE_UNAVAILABLE, str(error)) from error

    async def of_step(self, request: Request) -> Response:
        """Answer GET /episode/{data_set}/{name}/{step}.jpg with the camera's picture of a recorded step."""
        data_set, name, step = (request.path_params[key] for key in ("data_set", "name", "step"))

        def read() -> bytes:
            return encode(self._station.episode_picture(name, step, data_set), _STILL, _MAX_WIDTH)

        return await self._still(read, "image/jpeg")

    async def of_motion(self, request: Request) -> Response:
        """Answer GET /episode/{data_set}/{name}/{step}/motion/{frame}.jpg with a frame of a recorded step's motion."""
        data_set, name, step, frame = (request.path_params[key] for key in ("data_set", "name", "step", "frame"))
        return await self._still(lambda: self._station.motion_picture(name, step, frame, data_set), "image/jpeg")

    async def statistics(self, request: Request) -> Response:
        """Answer GET /statistics.png with the picture of the open data set's statistics."""
        return await self._still(self._station.statistics_picture, "image/png")

    async def _still(self, read: Callable[[], bytes], media_type: str) -> Response:
        try:
            return Response(await run_sync(read, limiter=self._readings), media_type=media_type)
        except DemoToolError as error:
            raise HTTPException(HTTPStatus.NOT_FOUND, str(error)) from error


def _number(request: Request, key: str, default: int, largest: int) -> int:
    text = request.query_params.get(key, str(default))
    if not (text.isascii() and text.isdigit() and len(text) <= 16 and int(text) <= largest):
        raise HTTPException(HTTPStatus.BAD_REQUEST, f"{key} must be a whole number from 0 to {largest}")
    return int(text)
