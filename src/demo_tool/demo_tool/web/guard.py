"""What every request and websocket passes before anything looks at it, and the headers of every answer."""

from __future__ import annotations

from http import HTTPStatus

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from demo_tool.web.access import AccessRule

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
    """Refuses a foreign Host, a foreign Origin and a missing token; trades a token in the address for a cookie."""

    def __init__(self, app: ASGIApp, rule: AccessRule) -> None:
        self._app = app
        self._rule = rule

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        answer = self._answer(HTTPConnection(scope))
        if answer is None:
            await self._app(scope, receive, send if scope["type"] == "websocket" else _with_headers(send))
        elif scope["type"] == "websocket":
            await WebSocket(scope, receive, send).send_denial_response(answer)
        else:
            await answer(scope, receive, _with_headers(send))

    def _answer(self, asked: HTTPConnection) -> Response | None:
        """The answer to those who get no further, else None."""
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
        answer.set_cookie(COOKIE, self._rule.cookie(), max_age=30 * 86400, httponly=True, samesite="strict")
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
