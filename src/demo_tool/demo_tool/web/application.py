"""ASGI application with the page's addresses."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from http import HTTPStatus
from pathlib import Path

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles

from demo_tool.station import Station
from demo_tool.web.access import AccessRule
from demo_tool.web.arm_holder import ArmHolder
from demo_tool.web.commands import Commands
from demo_tool.web.connection_limit import ConnectionLimit
from demo_tool.web.guard import Guard
from demo_tool.web.pictures import Pictures
from demo_tool.web.session import Sessions
from demo_tool.web.state_feed import StateFeed

STATIC = Path(__file__).resolve().parents[1] / "static"
_REVALIDATE = {"Cache-Control": "no-cache"}


def make_application(station: Station, rule: AccessRule) -> Starlette:
    """Make the ASGI application around a station: the page, its files, its pictures, its websocket."""
    holder = ArmHolder()
    feed = StateFeed(station)
    commands = Commands(station, holder)
    pictures = Pictures(station)
    connection_limit = ConnectionLimit()

    async def page(_: Request) -> Response:
        return FileResponse(STATIC / "index.html", headers=_REVALIDATE)

    async def stop(_: Request) -> Response:
        """Stop the arm even while the page reconnects its websocket."""
        await commands.stop()
        return Response(status_code=HTTPStatus.NO_CONTENT)

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        async with feed.running():
            yield

    application = Starlette(
        routes=[
            Route("/", page),
            Route("/stop", stop, methods=["POST"]),
            Route("/picture/{name}.jpg", pictures.live),
            Route("/episode/{data_set}/{name}/{step:int}.jpg", pictures.of_step),
            Route("/episode/{data_set}/{name}/{step:int}/motion/{frame:int}.jpg", pictures.of_motion),
            Route("/statistics.png", pictures.statistics),
            WebSocketRoute("/session", Sessions(feed, commands, holder).serve),
            Mount("/static", StaticFiles(directory=STATIC)),
        ],
        middleware=[Middleware(Guard, rule=rule, connection_limit=connection_limit)],
        lifespan=lifespan,
    )
    application.state.connection_limit = connection_limit  # where the server counts connections
    application.state.ending = False  # True while the server stops: long polls end then
    return application
