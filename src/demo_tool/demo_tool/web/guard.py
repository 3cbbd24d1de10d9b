"""Middleware that checks every request and websocket first, and sets the headers of every answer."""

from __future__ import annotations

from http import HTTPStatus

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from demo_tool.web.access import AccessRule
from demo_tool.web.connection_limit import ConnectionLimit

COOKIE = "demo_tool"
SECURITY_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


class Guard:
    """Middleware that refuses foreign Hosts, foreign Origins and missing tokens; a token is exchanged for a cookie."""

    def __init__(self, app: ASGIApp, rule: AccessRule, connection_limit: ConnectionLimit) -> None:
        self._app, self._rule, self._connection_limit = app, rule, connection_limit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, answer or refuse one connection of the ASGI server."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        answer = self._answer(HTTPConnection(scope))
        if answer is None:
            self._connection_limit.admit(scope["client"] and tuple(scope["client"]))
            await self._app(scope, receive, send if scope["type"] == "websocket" else _with_headers(send))
        elif scope["type"] == "websocket":
            await WebSocket(scope, receive, send).send_denial_response(answer)
        else:
            await answer(scope, receive, _with_headers(send))

    def _answer(self, asked: HTTPConnection) -> Response | None:
        """Return the answer to a request that is not let in, else None."""
        host = asked.headers.get("host", "")
        if not self._rule.knows_host(host):
            return _refusal(HTTPStatus.MISDIRECTED_REQUEST, f"this server is not called '{host[:80]}'")
        commands = asked.scope["type"] == "websocket" or asked.scope["method"] not in {"GET", "HEAD"}
        if not self._rule.knows_origin(asked.headers.get("origin"), host, demanded=commands):
            return _refusal(HTTPStatus.FORBIDDEN, "another site's page may not ask here")
        if self._rule.knows_cookie(asked.cookies.get(COOKIE)):
            return None
        token = asked.query_params.get("token")
        if commands or asked.url.path != "/" or not self._rule.knows_token(token):
            text = "a token is asked for: open the address that the command printed, it ends in ?token=…"
            return _refusal(HTTPStatus.UNAUTHORIZED, text)
        answer = RedirectResponse("/", HTTPStatus.SEE_OTHER)  # so that the token does not stay in the address bar
        # lax: strict is not sent where a link elsewhere led here; what commands also needs this site's Origin
        secure = asked.url.scheme in {"https", "wss"}
        answer.set_cookie(COOKIE, self._rule.cookie(), 30 * 86400, httponly=True, samesite="lax", secure=secure)
        return answer


def _refusal(status: HTTPStatus, text: str) -> Response:
    return PlainTextResponse(text + "\n", status)


def _with_headers(send: Send) -> Send:
    async def send_with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in SECURITY_HEADERS.items():
                headers[name] = value
            headers.setdefault("Cache-Control", "no-store")
        await send(message)

    return send_with_headers
