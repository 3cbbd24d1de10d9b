"""Who is let in: a real server, asked as a browser, another site's page or a program would ask."""

import http.client
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from web_workplace import DATA_SET, PATIENCE, Workplace, workplace
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from demo_tool.web.access import AccessError, AccessRule, token_from
from demo_tool.web.server import AddressError, bind
from demo_tool.web.session import MAX_MESSAGE, MAX_PAGES

TOKEN = "a-long-enough-token"


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workplace]:
    with workplace(tmp_path_factory.mktemp("open")) as made:
        yield made


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workplace]:
    with workplace(tmp_path_factory.mktemp("guarded"), token=TOKEN, host="0.0.0.0") as made:
        yield made


def ask(place: Workplace, path: str, method: str = "GET", **headers: str) -> tuple[int, http.client.HTTPMessage, str]:
    connection = http.client.HTTPConnection("127.0.0.1", place.port, timeout=PATIENCE)
    try:
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read().decode("utf-8", "replace")
    finally:
        connection.close()


def open_page(place: Workplace, name: str, origin: str | None = "", **headers: str) -> ClientConnection:
    own = place.url if origin == "" else origin
    uri = f"ws://127.0.0.1:{place.port}/session?page={name}"
    return connect(uri, origin=own, additional_headers=headers, open_timeout=PATIENCE, close_timeout=1)  # type: ignore[arg-type]


def call(page: ClientConnection, command: str, **arguments: object) -> dict:
    page.send(json.dumps({"id": 7, "command": command, "arguments": arguments}))
    while True:
        message = json.loads(page.recv(timeout=PATIENCE))
        if message.get("id") == 7:
            return message


def hear_out(page: ClientConnection) -> None:
    while True:
        page.recv(timeout=PATIENCE)


def test_every_answer_forbids_what_the_page_does_not_need(place: Workplace) -> None:
    for path in ("/", "/static/app.js", "/picture/color.jpg?after=0", "/picture/none.jpg", "/nothing"):
        _, headers, _ = ask(place, path)
        policy = headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy and "frame-ancestors 'none'" in policy and "unsafe" not in policy
        assert headers["X-Content-Type-Options"] == "nosniff"
        assert headers["Referrer-Policy"] == "no-referrer"
        assert headers["Cross-Origin-Resource-Policy"] == "same-origin"


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8080", "192.168.1.7", "localhost.evil.example", "", "[::1"]
)
def test_another_name_of_this_machine_is_refused(place: Workplace, host: str) -> None:
    assert ask(place, "/", Host=host)[0] in {400, 421}
    with pytest.raises(InvalidStatus):
        open_page(place, "rebound-page", origin=f"http://{host}", Host=host).close()


@pytest.mark.parametrize("host", ["localhost:9000", "127.0.0.1:80", "[::1]:8080", "LOCALHOST"])
def test_a_tunnel_may_have_another_port(place: Workplace, host: str) -> None:
    assert ask(place, "/", Host=host)[0] == 200


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", "http://127.0.0.1:1", "http://localhost.evil.example"]
)
def test_other_sites_pages_command_nothing(place: Workplace, origin: str) -> None:
    stops = place.arm.stops
    assert ask(place, "/stop", "POST", Origin=origin)[0] == 403
    with pytest.raises(InvalidStatus) as refusal:
        open_page(place, "foreign-page", origin=origin).close()
    assert refusal.value.response.status_code == 403
    assert ask(place, "/picture/color.jpg", Origin=origin)[0] == 403
    assert place.arm.stops == stops


def test_who_commands_must_say_where_from(place: Workplace) -> None:
    assert ask(place, "/stop", "POST")[0] == 403
    with pytest.raises(InvalidStatus):
        open_page(place, "silent-page", origin=None).close()


def test_stop_works_without_the_websocket(tmp_path: Path) -> None:
    with workplace(tmp_path) as own:
        assert ask(own, "/stop", "POST", Origin=own.url)[0] == 204
        assert own.arm.stopped and own.station.view(None)["state"] == "stopped"


def test_beyond_loopback_nothing_is_answered_without_the_token(guarded: Workplace) -> None:
    for path in ("/", "/?token=wrong", "/static/app.js", "/picture/color.jpg", f"/stop?token={TOKEN}"):
        status, _, text = ask(guarded, path)
        assert status == 401 and "token" in text
    assert ask(guarded, "/stop", "POST", Origin=guarded.url)[0] == 401
    with pytest.raises(InvalidStatus) as refusal:
        open_page(guarded, "no-token-page", Cookie="demo_tool=0123").close()
    assert refusal.value.response.status_code == 401
    assert not guarded.arm.stops


def test_the_token_is_traded_for_a_cookie_that_only_this_site_sends(guarded: Workplace) -> None:
    status, headers, _ = ask(guarded, f"/?token={TOKEN}")
    assert status == 303 and headers["Location"] == "/"
    cookie = headers["Set-Cookie"]
    assert "HttpOnly" in cookie and "SameSite=lax" in cookie and "Secure" not in cookie and TOKEN not in cookie
    value = cookie.split(";")[0]
    assert ask(guarded, "/", Cookie=value)[0] == 200
    assert ask(guarded, "/stop", "POST", Cookie=value, Origin="http://evil.example")[0] == 403
    with open_page(guarded, "guarded-page", Cookie=value) as page:
        assert "view" in json.loads(page.recv(timeout=PATIENCE))


def test_settings_that_would_leave_the_page_open_are_refused() -> None:
    assert AccessRule.for_address("127.0.0.1", None).token is None
    made = {AccessRule.for_address("0.0.0.0", None).token for _ in range(2)}
    assert len(made) == 2 and all(token and len(token) >= 16 for token in made)
    for token in ("short", "x" * 15, "with blanks in it and more", "ключ-который-длинен"):
        with pytest.raises(AccessError, match="16"):
            AccessRule.for_address("0.0.0.0", token)
    assert AccessRule.for_address("0.0.0.0", None, ["robot.lan"]).knows_host("robot.lan:8080")
    assert not AccessRule.for_address("0.0.0.0", None).knows_host("robot.lan")
    shared = AccessRule.for_address("127.0.0.1", None, ask_token=True)
    assert shared.token and not shared.knows_cookie(None) and not shared.any_address


def test_a_token_file_is_its_owners_alone(tmp_path: Path) -> None:
    path = tmp_path / "token"
    token = token_from(path)
    assert token_from(path) == token == AccessRule.for_address("127.0.0.1", token).token
    assert path.stat().st_mode & 0o777 == 0o600
    path.chmod(0o640)
    with pytest.raises(AccessError, match="chmod 600"):
        token_from(path)
    with pytest.raises(AccessError, match="--token-file"):
        token_from(tmp_path / "none" / "token")


@pytest.mark.parametrize(
    "path",
    [
        "/static/../app.py",
        "/static/%2e%2e/app.py",
        "/static/..%2f..%2fetc%2fpasswd",
        "/static//etc/passwd",
        f"/episode/{DATA_SET}/..%2f..%2f..%2fetc/0.jpg",
        "/episode/%2e%2e/name/0.jpg",
        "/episode/..%2f..%2fetc/passwd/0.jpg",
        f"/episode/{DATA_SET}/%00/0.jpg",
        f"/episode/{DATA_SET}/name/-1.jpg",
        f"/episode/{DATA_SET}/.hidden/0.jpg",
        "/picture/..%2fcolor.jpg",
    ],
)
def test_no_path_leads_out_of_the_folders(place: Workplace, path: str) -> None:
    status, _, text = ask(place, path)
    assert status == 404 and "root:" not in text and "import" not in text


def test_names_of_data_sets_are_one_plain_word(tmp_path: Path) -> None:
    with workplace(tmp_path / "sets") as own, open_page(own, "naming-page") as page:
        for name in ("../out", "/tmp/out", ".hidden", "a/b", "a\\b", "", "\u202ename", "x" * 300, "a\0b"):
            refusal = call(page, "open_data_set", name=name)
            assert not refusal["ok"] and refusal["error"] and "\n" not in refusal["error"]
        assert sorted(p.name for p in tmp_path.iterdir()) == ["sets"]
        assert [p.name for p in (tmp_path / "sets").iterdir()] == [DATA_SET]


def test_long_instructions_are_refused_in_words_and_longer_messages_end_the_session(place: Workplace) -> None:
    with open_page(place, "writing-page") as page:
        if not call(page, "take_over")["ok"]:
            pytest.fail("nobody else is here")
        refusal = call(page, "instruction", text="put " * 2500)
        assert not refusal["ok"] and "500" in refusal["error"]
        assert call(page, "instruction", text="lege den roten Block in die grüne Schüssel 把红色方块放进碗里")["ok"]
        with pytest.raises(ConnectionClosed) as end:
            call(page, "instruction", text="x" * MAX_MESSAGE)
        assert end.value.rcvd is not None and end.value.rcvd.code == 1009


@pytest.mark.parametrize(
    "text", ["{", "[]", "null", '{"id":1}', '{"id":1,"command":2,"arguments":{}}', "[" * 20000, b"\0"]
)
def test_what_is_no_command_ends_the_session(place: Workplace, text: str | bytes) -> None:
    with open_page(place, "babbling-page") as page:
        page.send(text)
        with pytest.raises(ConnectionClosed):
            hear_out(page)
    assert ask(place, "/")[0] == 200


@pytest.mark.parametrize("arguments", [{"box": [1, 2]}, {"box": [float("nan")] * 4}, {"box": "x"}, {"rotation": 1e99}])
def test_odd_arguments_are_answered_with_one_line(place: Workplace, arguments: dict) -> None:
    with open_page(place, "arguing-page") as page:
        call(page, "take_over")
        refusal = call(page, "pick", **arguments)
        assert not refusal["ok"] and 0 < len(refusal["error"]) < 300 and "Traceback" not in refusal["error"]
        assert not call(page, "__class__")["ok"]


def test_pages_are_counted(place: Workplace) -> None:
    pages = [open_page(place, f"crowd-page-{number}") for number in range(MAX_PAGES)]
    try:
        with pytest.raises(InvalidStatus) as refusal:
            open_page(place, "one-page-too-many").close()
        assert refusal.value.response.status_code == 503
    finally:
        for page in pages:
            page.close()


def test_a_taken_port_is_said_in_one_line(place: Workplace) -> None:
    with pytest.raises(AddressError, match=f"port {place.port} .*--port"):
        bind("127.0.0.1", place.port)
    with pytest.raises(AddressError, match="--port"):
        bind("127.0.0.1", 99999)
    with pytest.raises(AddressError, match=r"no\.such\.host\.invalid"):
        bind("no.such.host.invalid", 0)
