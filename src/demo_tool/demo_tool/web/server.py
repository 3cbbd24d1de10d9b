"""The web server in a thread of its own, on a socket that was bound before anything else was started."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Callable

import uvicorn
from starlette.applications import Starlette
from uvicorn.protocols.http.h11_impl import H11Protocol

from demo_tool.errors import DemoToolError
from demo_tool.web.session import MAX_MESSAGE

MAX_CONNECTIONS = 96
_FIRST_WORD_S = 10.0
_GRACE_S = 1


class AddressError(DemoToolError):
    """An address that cannot be listened on."""


class _BoundedProtocol(H11Protocol):
    """Hangs up on connections beyond the limit, and on those that ask for nothing."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.connections) > MAX_CONNECTIONS:
            transport.abort()
            return
        self.timeout_keep_alive_task = self.loop.call_later(_FIRST_WORD_S, self.timeout_keep_alive_handler)


def bind(host: str, port: int) -> socket.socket:
    """A socket that listens on the address; port 0 takes a free one.

    Raises:
        AddressError: the port is taken, or the address is none of this machine's.
    """
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        # the protocol by name, or asyncio leaves Nagle's algorithm on: 40 ms for every answer
        listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(128)
    except (OSError, OverflowError, UnicodeError) as error:
        raise AddressError(f"cannot listen on {host}, port {port} ({error}); choose another with --port") from error
    return listener


class WebServer:
    """Serves an application from `start` to `stop`."""

    def __init__(
        self, application: Starlette, listener: socket.socket, on_end: Callable[[BaseException], None]
    ) -> None:
        """on_end is told, from the server's thread, when it fails."""
        self._application, self._listener = application, listener
        self._on_end = on_end
        self._server = uvicorn.Server(
            uvicorn.Config(
                application,
                http=_BoundedProtocol,
                ws="websockets-sansio",
                ws_max_size=MAX_MESSAGE,
                ws_ping_interval=5.0,
                ws_ping_timeout=10.0,
                log_config=None,
                access_log=False,
                server_header=False,
                proxy_headers=False,
                timeout_graceful_shutdown=_GRACE_S,
            )
        )
        self._thread = threading.Thread(target=self._serve, name="web", daemon=True)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def stop(self) -> None:
        """End within about a second, with whatever is still being answered."""
        self._application.state.ending = True
        self._server.should_exit = True
        self._thread.join(timeout=2.0 * _GRACE_S)
        self._listener.close()

    def _serve(self) -> None:
        try:
            self._server.run(sockets=[self._listener])
        except (Exception, SystemExit) as error:  # uvicorn exits where it cannot start
            self._on_end(error)
