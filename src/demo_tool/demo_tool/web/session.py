"""Websockets of the open pages: changes of the view go out, commands come in."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

import anyio
from starlette.responses import PlainTextResponse
from starlette.websockets import WebSocket, WebSocketDisconnect

from demo_tool.web.arm_holder import ArmHolder
from demo_tool.web.commands import STOP, Commands, Request
from demo_tool.web.state_feed import StateFeed

MAX_PAGES = 16
MAX_PENDING_REQUESTS = 16
MAX_MESSAGE = 64 * 1024  # bytes; the longest command is an instruction that is refused in words
OPENED_AGAIN = 4001  # close code: the same page has connected anew, or was duplicated
NOT_UNDERSTOOD = 4002
_PAGE_NAME = re.compile(r"[A-Za-z0-9-]{8,64}")


@dataclass
class _PageState:
    """State of one page: the view that it was sent; in_order: held by the command that is being executed."""

    view: dict[str, Any] = field(default_factory=dict)
    in_order: asyncio.Lock = field(default_factory=asyncio.Lock)


class Sessions:
    """Websockets of all open pages."""

    def __init__(self, feed: StateFeed, commands: Commands, holder: ArmHolder) -> None:
        self._feed, self._commands, self._holder = feed, commands, holder
        self._open: dict[str, WebSocket] = {}

    async def serve(self, websocket: WebSocket) -> None:
        """Serve one page from its opening to its end."""
        page = websocket.query_params.get("page", "")
        if not _PAGE_NAME.fullmatch(page):
            await websocket.send_denial_response(PlainTextResponse("no such page\n", HTTPStatus.BAD_REQUEST))
            return
        if len(self._open) >= MAX_PAGES and page not in self._open:
            text = f"{MAX_PAGES} pages are open: close one\n"
            await websocket.send_denial_response(PlainTextResponse(text, HTTPStatus.SERVICE_UNAVAILABLE))
            return
        await websocket.accept()
        earlier, self._open[page] = self._open.get(page), websocket
        if earlier is not None:
            await _close(earlier, OPENED_AGAIN)
        self._holder.join(page, anyio.current_time())
        self._feed.wake()
        try:
            await self._talk(websocket, page)
        finally:
            if self._open.get(page) is websocket:
                del self._open[page]
                self._holder.leave(page, anyio.current_time())

    async def _talk(self, websocket: WebSocket, page: str) -> None:
        shown = _PageState()
        push = asyncio.create_task(self._push(websocket, page, shown))
        answers: set[asyncio.Task[None]] = set()
        try:
            while True:
                request = _request(await _received(websocket))
                if request is None or (len(answers) >= MAX_PENDING_REQUESTS and request.command != STOP):
                    await _close(websocket, NOT_UNDERSTOOD)
                    return
                task = asyncio.create_task(self._answer(websocket, page, request, shown))
                answers.add(task)
                task.add_done_callback(answers.discard)
        except WebSocketDisconnect:
            return
        finally:
            push.cancel()

    async def _answer(self, websocket: WebSocket, page: str, request: Request, shown: _PageState) -> None:
        if request.command == STOP:
            answer = await self._commands.answer(page, request)
        else:
            async with shown.in_order:
                answer = await self._commands.answer(page, request)
        await self._show(websocket, page, shown, await self._feed.refresh())  # an answer must not precede its effect
        await _send(websocket, answer)

    async def _push(self, websocket: WebSocket, page: str, shown: _PageState) -> None:
        """Send changes while the page is open, and an empty one every second as a heartbeat."""
        view = self._feed.view
        while await self._show(websocket, page, shown, view):
            view = await self._feed.next()

    async def _show(self, websocket: WebSocket, page: str, shown: _PageState, view: Mapping[str, Any]) -> bool:
        """Send the difference to what the page has; return True if it could be sent."""
        whole = {**view, **self._standing(page)}
        news = {key: value for key, value in whole.items() if key not in shown.view or shown.view[key] != value}
        shown.view.update(news)
        return await _send(websocket, {"view": news})

    def _standing(self, page: str) -> Mapping[str, Any]:
        return {
            "holder": self._holder.standing(page).value,
            "may_take_over": self._holder.may_take_over(page, anyio.current_time()),
            "pages": len(self._open),
        }


async def _received(websocket: WebSocket) -> str:
    """Return the next text. Raises WebSocketDisconnect where there is none, or a binary message came."""
    try:
        return await websocket.receive_text()
    except (RuntimeError, KeyError) as error:  # RuntimeError: a failed send has closed it already; KeyError: binary
        raise WebSocketDisconnect from error


def _request(text: str) -> Request | None:
    try:
        return Request.from_json(json.loads(text))
    except (ValueError, RecursionError):
        return None


async def _send(websocket: WebSocket, message: Mapping[str, Any]) -> bool:
    """Send a message; return True if it could be sent: a page that is gone is no error."""
    try:
        await websocket.send_text(json.dumps(message, allow_nan=False, separators=(",", ":")))
    except (RuntimeError, WebSocketDisconnect):
        return False
    return True


async def _close(websocket: WebSocket, code: int) -> None:
    try:
        await websocket.close(code)
    except (RuntimeError, WebSocketDisconnect):
        return  # it has closed itself
