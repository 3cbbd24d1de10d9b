"""Web server in a thread of its own, on a socket that was bound before anything else was started."""

from __future__ import annotations

import asyncio
import socket
import ssl
import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import h11
import uvicorn
from starlette.applications import Starlette
from uvicorn.protocols.http.h11_impl import H11Protocol

from demo_tool.errors import DemoToolError
from demo_tool.web.connection_limit import Client, ConnectionLimit
from demo_tool.web.session import MAX_MESSAGE

HEAD_S = 5.0  # time limit for a request, from its first byte to the end of its headers
_GRACE_S = 1


class AddressError(DemoToolError):
    """An address that cannot be listened on."""


@dataclass(frozen=True)
class TlsFiles:
    """A certificate (with its chain) and its private key, both PEM."""

    certificate: Path
    key: Path

    def check(self) -> None:
        """Raise AddressError when the files cannot be used."""
        try:
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(self.certificate, self.key, password="")
        except (OSError, ValueError) as error:  # an SSLError is an OSError
            raise AddressError(
                f"TLS with the certificate {self.certificate} and the key {self.key} cannot be used ({error}); "
                "name two PEM files that belong together with --tls-cert and --tls-key, the key without a password"
            ) from error


class _BoundedProtocol(H11Protocol):
    """A connection that is counted, and that ends when a request's headers take too long."""

    def __init__(self, connection_limit: ConnectionLimit, *arguments: Any, **named: Any) -> None:
        super().__init__(*arguments, **named)
        self._connection_limit = connection_limit
        self._client: Client | None = None
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self._expect_head()
        if self.client is not None:
            self._client = (self.client[0], self.client[1])
            self._connection_limit.add(self._client, transport.abort)

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        asking = self.conn.their_state is h11.IDLE and self.conn.trailing_data[0] != b""
        if not asking:
            self._forget_deadline()
        elif self._deadline is None:
            self._expect_head()

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self._leave()

    def handle_websocket_upgrade(self, event: h11.Request) -> None:
        """Stop counting: the guard answers the upgrade at once, and sessions count the pages."""
        self._leave()
        super().handle_websocket_upgrade(event)

    def _expect_head(self) -> None:
        self._deadline = self.loop.call_later(HEAD_S, self.transport.abort)

    def _forget_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _leave(self) -> None:
        self._forget_deadline()
        if self._client is not None:
            self._connection_limit.remove(self._client)


def bind(host: str, port: int) -> socket.socket:
    """Open a socket that listens on the address; port 0 takes a free one.

    Raises:
        AddressError: when the port is taken, or the address is none of this machine's.
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
    """Server of an application, from `start` to `stop`."""

    def __init__(
        self,
        application: Starlette,
        listener: socket.socket,
        on_end: Callable[[BaseException], None],
        tls: TlsFiles | None = None,
    ) -> None:
        """Prepare the server; on_end: called in its thread when it fails; tls: checked files, for HTTPS."""
        self._application, self._listener = application, listener
        self._on_end = on_end
        self._server = uvicorn.Server(
            uvicorn.Config(
                application,
                http=partial(_BoundedProtocol, application.state.connection_limit),  # type: ignore[arg-type]
                ssl_certfile=None if tls is None else tls.certificate,
                ssl_keyfile=None if tls is None else tls.key,
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
        """Start the server's thread."""
        self._thread.start()

    def stop(self) -> None:
        """Stop within about a second; pending requests are given that time."""
        self._application.state.ending = True
        self._server.should_exit = True
        self._thread.join(timeout=2.0 * _GRACE_S)
        self._listener.close()

    def _serve(self) -> None:
        try:
            self._server.run(sockets=[self._listener])
        except (Exception, SystemExit) as error:  # uvicorn exits where it cannot start
            self._on_end(error)
