"""Feed of the station's view, watched once for all open pages."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

import anyio
from anyio.to_thread import run_sync

from demo_tool.station import Station

logger = logging.getLogger(__name__)

HEARTBEAT_S = 1.0
_MIN_PERIOD_S = 1.0 / 15.0


class StateFeed:
    """Newest view of the station; waiters are woken at most 15 times a second and at least every second."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self._waiting: asyncio.Event = asyncio.Event()
        self._waits, self._looks = anyio.CapacityLimiter(1), anyio.CapacityLimiter(1)  # one look after the other
        self.view: Mapping[str, Any]  # while it is running

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Watch the station while the body runs."""
        self.view = self._station.view(None)
        watch = asyncio.create_task(self._watch())
        try:
            yield
        finally:
            watch.cancel()
            self.wake()

    async def next(self) -> Mapping[str, Any]:
        """Wait until something has changed or a second has passed; return the view."""
        await self._waiting.wait()
        return self.view

    async def refresh(self) -> Mapping[str, Any]:
        """Read the present view, wake all who wait and return it."""
        self.view = await run_sync(self._station.view, None, abandon_on_cancel=True, limiter=self._looks)
        self.wake()
        return self.view

    def wake(self) -> None:
        """Wake all who wait, as something outside the station has changed."""
        self._waiting.set()
        self._waiting = asyncio.Event()

    async def _watch(self) -> None:
        seen = 0
        while True:
            try:
                changed = partial(self._station.wait_change, seen, HEARTBEAT_S)
                seen = await run_sync(changed, abandon_on_cancel=True, limiter=self._waits)
                await self.refresh()
            except Exception:  # a defect must not leave all pages without a heartbeat
                logger.exception("the state could not be read")
                await asyncio.sleep(HEARTBEAT_S)
            await asyncio.sleep(_MIN_PERIOD_S)
