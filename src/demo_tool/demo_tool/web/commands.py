"""Commands of pages: permission, execution and answers."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import anyio
from anyio.to_thread import run_sync

from demo_tool.errors import DemoToolError
from demo_tool.station import Station
from demo_tool.web.arm_holder import ArmHolder, Standing

logger = logging.getLogger(__name__)

STOP = "stop"
FOR_ALL = frozenset({STOP, "episodes", "episode", "trash", "statistics"})
_TAKE_OVER, _GIVE_UP = "take_over", "give_up"
OWN_COMMANDS = frozenset({_TAKE_OVER, _GIVE_UP})  # obeyed here, not by the station


class NotHoldingError(DemoToolError):
    """A command from a page that does not hold the arm, which the command needs."""


@dataclass(frozen=True)
class Request:
    """A page's request; `number` identifies its answer."""

    number: int
    command: str
    arguments: Mapping[str, Any]

    @classmethod
    def from_json(cls, value: Any) -> Request | None:
        """Parse the request in a message's JSON; None where it is not one."""
        match value:
            case {"id": int(number), "command": str(command), "arguments": dict(arguments)}:
                return cls(number, command, arguments)
        return None


class Commands:
    """Executor of requests, in threads; a stop never waits behind another command."""

    def __init__(self, station: Station, holder: ArmHolder) -> None:
        self._station = station
        self._holder = holder
        self._others = anyio.CapacityLimiter(4)
        self._stops = anyio.CapacityLimiter(4)

    async def answer(self, page: str, request: Request) -> dict[str, Any]:
        """Execute a request and return the message that answers it; a refusal is one line for a person."""
        try:
            answer = await self._run(page, request)
        except DemoToolError as error:
            return {"id": request.number, "ok": False, "error": " ".join(str(error).split())}
        except Exception:
            logger.exception("command %r failed", request.command[:40])
            return {"id": request.number, "ok": False, "error": "the server failed at this: see its terminal"}
        return {"id": request.number, "ok": True, "answer": answer}

    async def stop(self) -> None:
        """Stop the arm; any page may."""
        await run_sync(self._station.command, STOP, {}, limiter=self._stops)

    async def _run(self, page: str, request: Request) -> Any:
        now = anyio.current_time()
        if request.command == STOP:
            return await self.stop()
        if request.command == _GIVE_UP:
            return self._holder.give_up(page)
        if request.command == _TAKE_OVER:
            if not self._holder.take_over(page, now):
                raise NotHoldingError("another page holds the arm: it must hand it on first, or be closed")
            return None
        if request.command not in FOR_ALL:
            standing = self._holder.standing(page)
            if standing is Standing.NOBODY:
                raise NotHoldingError("no page holds the arm: take over first")
            if standing is not Standing.ME:
                raise NotHoldingError("another page holds the arm: this one watches; take over first")
            self._holder.act(page, now)
        return await run_sync(self._station.command, request.command, request.arguments, limiter=self._others)
