"""The web server's rules as plain functions: names, tokens, cookies, levels, numbers and headers."""

from __future__ import annotations

import hashlib
from types import SimpleNamespace

import anyio
import cv2
import h11
import numpy as np
import pytest
from starlette.exceptions import HTTPException

from demo_tool.web import jpeg, server
from demo_tool.web.access import AccessError, AccessRule, token_from
from demo_tool.web.arm_holder import GONE_AFTER_S, IDLE_AFTER_S, ArmHolder, Standing
from demo_tool.web.commands import Request
from demo_tool.web.connection_limit import ConnectionLimit
from demo_tool.web.guard import Guard
from demo_tool.web.jpeg import LEVELS, JpegCache, Level, encode, next_level
from demo_tool.web.pictures import Pictures
from demo_tool.web.session import MAX_MESSAGE, _request

TOKEN = "0123456789abcdef"  # as short as one may be


@pytest.mark.parametrize(
    ("host", "header", "known"),
    [
        ("127.0.0.1", "localhost", True),
        ("127.0.0.1", "127.8.9.10:80", True),
        ("127.0.0.1", "[::1]:80", True),
        ("127.0.0.1", "10.0.0.7", False),
        ("127.0.0.1", "host.example", False),
        ("0.0.0.0", "10.0.0.7", True),
        ("0.0.0.0", "host.example", False),
        ("robot.lan", "ROBOT.lan:8080", True),
        ("0.0.0.0", "", False),
        ("0.0.0.0", "[::1", False),
    ],
)
def test_hosts(host: str, header: str, known: bool) -> None:
    assert AccessRule.for_address(host, TOKEN).knows_host(header) is known


@pytest.mark.parametrize(
    ("origin", "demanded", "known"),
    [
        (None, True, False),
        (None, False, True),
        ("http://localhost:8080", True, True),
        ("HTTPS://LOCALHOST:8080", True, True),
        ("http://localhost:8081", False, False),
        ("ftp://localhost:8080", False, False),
    ],
)
def test_origins(origin: str | None, demanded: bool, known: bool) -> None:
    rule = AccessRule.for_address("localhost", None)
    assert rule.knows_origin(origin, "LocalHost:8080", demanded) is known


def test_tokens_and_cookies() -> None:
    rule = AccessRule.for_address("0.0.0.0", TOKEN)
    assert [rule.knows_token(token) for token in (TOKEN, TOKEN[:-1], "", None)] == [True, False, False, False]
    cookie = hashlib.sha256(f"demo_tool page {TOKEN}".encode()).hexdigest()
    assert [rule.knows_cookie(value) for value in (cookie, TOKEN, None)] == [True, False, False]
    free = AccessRule.for_address("127.0.0.1", None)
    assert free.knows_token(None) and free.knows_cookie(None) and not free.any_address
    assert AccessRule.for_address("127.0.0.1", TOKEN).token == TOKEN


def test_a_token_file_that_is_no_text_is_refused(tmp_path) -> None:
    path = tmp_path / "token"
    path.write_bytes(b"\xff\xfe")
    path.chmod(0o600)
    with pytest.raises(AccessError, match="cannot be used"):
        token_from(path)
    path.write_text(f" {TOKEN}\n")
    assert token_from(path) == TOKEN
    path.chmod(0o604)
    with pytest.raises(AccessError, match="others may read"):
        token_from(path)


@pytest.mark.parametrize(
    ("level", "took", "following"),
    [
        (3, 180.0, 3),
        (3, 180.1, 2),
        (0, 500.0, 0),
        (3, 40.0, 3),
        (3, 39.9, 4),
        (4, 1.0, 4),
        (0, 1.0, 1),
        (-3, 100.0, 0),
        (9, 100.0, 4),
        (9, 500.0, 3),
    ],
)
def test_the_quality_follows_the_time_of_transfer(level: int, took: float, following: int) -> None:
    assert next_level(level, took) == following


def test_levels_grow_from_a_phones_picture_to_a_large_screens() -> None:
    assert [level.width for level in LEVELS] == [320, 480, 640, 960, 1280]
    assert [level.quality for level in LEVELS] == [35, 45, 55, 65, 80]
    assert LEVELS[jpeg.START_LEVEL].width == 960


@pytest.mark.parametrize(
    ("width", "max_width", "size"),
    [(100, 4096, (20, 40)), (40, 4096, (20, 40)), (20, 4096, (10, 20)), (100, 10, (5, 10)), (100, 1, (1, 1))],
)
def test_a_picture_is_reduced_to_the_narrowest(width: int, max_width: int, size: tuple[int, int]) -> None:
    file = encode(np.zeros((20, 40, 3), np.uint8), Level(width, 80), max_width)
    assert cv2.imdecode(np.frombuffer(file, np.uint8), cv2.IMREAD_COLOR).shape == (*size, 3)


def test_the_six_last_files_are_kept() -> None:
    cache, picture = JpegCache(), np.zeros((4, 4, 3), np.uint8)
    files = [cache.file("color", number, picture, LEVELS[0], 4) for number in range(7)]
    assert cache.file("color", 1, picture, LEVELS[0], 4) is files[1]
    assert cache.file("color", 0, picture, LEVELS[0], 4) is not files[0]
    assert cache.file("color", 1, picture, LEVELS[0], 4) is not files[1], "the oldest goes first"
    assert cache.file("color", 6, picture, LEVELS[1], 4) is not files[6]


def test_the_hold_ends_a_moment_after_its_time() -> None:
    holder, same = ArmHolder(), "".join(("fir", "st"))  # a page's name comes anew with each request
    assert holder.standing("first") is Standing.NOBODY and holder.may_take_over("first", 0.0)
    holder.join("first", 10.0)
    assert not holder.may_take_over(same, 1e6) and holder.take_over(same, 1e6)
    assert not holder.may_take_over("second", 10.0 + IDLE_AFTER_S)
    assert holder.may_take_over("second", 10.1 + IDLE_AFTER_S)
    holder.act("second", 100.0)
    holder.leave("second", 100.0)
    holder.give_up("second")
    assert holder.standing(same) is Standing.ME and holder.may_take_over("second", 10.1 + IDLE_AFTER_S)
    holder.act(same, 100.0)
    holder.leave(same, 100.0)
    assert not holder.may_take_over("second", 100.0 + GONE_AFTER_S)
    assert holder.may_take_over("second", 100.1 + GONE_AFTER_S)
    assert holder.take_over("second", 100.1 + GONE_AFTER_S)
    assert not holder.may_take_over("first", 100.2 + GONE_AFTER_S), "who has just come is not gone"
    holder.give_up("".join(("sec", "ond")))
    assert holder.standing("second") is Standing.NOBODY


@pytest.mark.parametrize(
    ("query", "told"),
    [
        ({}, (0, 960, 3)),
        ({"after": "7", "width": "4096", "level": "4"}, (7, 1280, 4)),
        ({"level": "3", "took": "181"}, (0, 640, 2)),
        ({"level": "3", "took": "39"}, (0, 1280, 4)),
        ({"width": "4097"}, "width must be a whole number from 0 to 4096"),
        ({"level": "5"}, "level must be a whole number from 0 to 4"),
        ({"took": "600001"}, "took must be a whole number from 0 to 600000"),
        ({"after": str(2**53 + 1)}, f"after must be a whole number from 0 to {2**53}"),
        ({"after": str(2**53)}, (2**53, 960, 3)),
        ({"after": "\u0663"}, f"after must be a whole number from 0 to {2**53}"),
    ],
)
def test_a_picture_is_asked_for_with_numbers(query: dict[str, str], told: object) -> None:
    asked: list[int] = []

    def picture(name: str, after: int, timeout: float) -> tuple[int, int, np.ndarray]:
        asked.append(after)
        return 8, 99, np.zeros((2, 2000, 3), np.uint8)

    async def ask() -> tuple[int, int, int] | str:
        request = SimpleNamespace(path_params={"name": "color"}, query_params=query)
        try:
            answer = await Pictures(SimpleNamespace(picture=picture)).live(request)  # type: ignore[arg-type]
        except HTTPException as refusal:
            return str(refusal.detail) if refusal.status_code == 400 else ""
        assert (answer.headers["X-Sequence"], answer.headers["X-Stamp-Ns"]) == ("8", "99")
        width = cv2.imdecode(np.frombuffer(answer.body, np.uint8), cv2.IMREAD_COLOR).shape[1]
        return asked[0], width, int(answer.headers["X-Level"])

    assert anyio.run(ask) == told


@pytest.mark.parametrize(
    "text", ["{}", "3", "[", '{"id": 1, "command": "x"}', '{"id": "1", "command": "x", "arguments": {}}']
)
def test_what_is_no_request(text: str) -> None:
    assert _request(text) is None


def test_a_request() -> None:
    text = '{"id": 3, "command": "pick", "arguments": {"rotation": 2}}'
    assert _request(text) == Request(3, "pick", {"rotation": 2})
    assert len('{"text": ""}') + 6 * 500 < MAX_MESSAGE == 65536, "an instruction of escapes fits in"


def sent(rule: AccessRule, limit: ConnectionLimit | None = None, **scope: object) -> tuple[int, dict[str, str]]:
    """Return status and headers of the guard's answer to a request; 200 where it lets it in."""
    messages: list[dict] = []

    async def application(scope: object, receive: object, send) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def send(message) -> None:
        messages.append(message)

    defaults = {"type": "http", "method": "GET", "path": "/", "query_string": b"", "scheme": "http", "client": None}
    guard = Guard(application, rule, limit or ConnectionLimit())
    anyio.run(guard, {**defaults, "headers": [(b"host", b"localhost:8080")], **scope}, None, send)
    return messages[0]["status"], {k.decode(): v.decode() for k, v in messages[0]["headers"]}


def test_a_cookie_is_kept_for_thirty_days_and_by_https_alone_where_it_came_so() -> None:
    rule = AccessRule.for_address("127.0.0.1", TOKEN)
    asked = {"query_string": f"token={TOKEN}".encode()}
    status, headers = sent(rule, **asked)
    assert status == 303 and headers["location"] == "/" and headers["cache-control"] == "no-store"
    parts = headers["set-cookie"].split("; ")
    assert parts[0] == f"demo_tool={rule.cookie()}" and {"HttpOnly", "Max-Age=2592000", "SameSite=lax"} < set(parts)
    assert "Secure" not in parts
    assert "Secure" in sent(rule, **asked, scheme="https")[1]["set-cookie"].split("; ")
    for other in ({"method": "HEAD"}, {"path": "/x"}, {"query_string": b"token=x"}):
        assert sent(rule, **{**asked, **other})[0] == (303 if "method" in other else 401)


def test_who_is_let_in_is_counted_as_admitted() -> None:
    limit, closed = ConnectionLimit(), []
    rule = AccessRule.for_address("127.0.0.1", None)
    limit.add(("10.0.0.1", 1), lambda: closed.append(1))
    assert sent(rule, limit, client=["10.0.0.1", 1])[0] == 200
    for port in range(2, 18):
        limit.add(("10.0.0.1", port), lambda port=port: closed.append(port))
    assert closed == []
    status, headers = sent(rule, limit, headers=[(b"host", b"x" * 100)], client=["10.0.0.1", 2])
    assert status == 421 and headers["x-frame-options"] == "DENY"
    limit.add(("10.0.0.1", 18), lambda: closed.append(18))
    assert closed == [2], "who is refused stays pending"


@pytest.mark.parametrize(
    ("their_state", "trailing", "deadline", "events"),
    [
        (h11.IDLE, (b"", False), "old", ["cancelled"]),  # a request is answered, and no other has begun
        (h11.IDLE, (b"", True), None, []),
        (h11.IDLE, (b"GET", False), None, ["called in 5.0 s"]),
        (h11.IDLE, (b"GET", False), "old", []),  # the first byte's deadline holds
        (h11.SEND_BODY, (b"", False), "old", ["cancelled"]),
    ],
)
def test_the_deadline_of_a_requests_head(monkeypatch, their_state, trailing, deadline, events: list[str]) -> None:
    heard: list[str] = []
    monkeypatch.setattr(server.H11Protocol, "data_received", lambda protocol, data: None)
    protocol = object.__new__(server._BoundedProtocol)
    protocol.conn = SimpleNamespace(their_state=their_state, trailing_data=trailing)
    protocol.loop = SimpleNamespace(call_later=lambda seconds, call: heard.append(f"called in {seconds} s"))
    protocol.transport = SimpleNamespace(abort=None)
    timer = SimpleNamespace(cancel=lambda: heard.append("cancelled"))
    protocol._deadline = timer if deadline else None
    protocol.data_received(b"")
    assert heard == events
