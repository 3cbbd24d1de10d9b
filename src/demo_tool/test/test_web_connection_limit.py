"""Connections that say nothing, or say it slowly: nobody is kept out by them, and the stop least of all."""

import http.client
import select
import shutil
import socket
import ssl
import subprocess
import time
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
from web_workplace import Workplace, workplace

from demo_tool.web import server
from demo_tool.web.connection_limit import MAX_ADMITTED, MAX_PENDING, PENDING_PER_ADDRESS, Client, ConnectionLimit
from demo_tool.web.guard import COOKIE
from demo_tool.web.server import AddressError, TlsFiles

TOKEN = "a-long-enough-token"


@pytest.fixture
def guarded(tmp_path: Path) -> Iterator[Workplace]:
    with workplace(tmp_path, token=TOKEN, host="0.0.0.0") as made:
        yield made


def idle_sockets(stack: ExitStack, place: Workplace, count: int) -> list[socket.socket]:
    return [stack.enter_context(socket.create_connection(("127.0.0.1", place.port))) for _ in range(count)]


def stop(place: Workplace, connection: http.client.HTTPConnection) -> int:
    headers = {"Cookie": f"{COOKIE}={place.rule.cookie()}", "Origin": place.url}
    connection.request("POST", "/stop", headers=headers)
    answer = connection.getresponse()
    answer.read()
    return answer.status


@pytest.mark.parametrize("count", [96, 300])
def test_idle_connections_keep_nobody_from_the_stop(guarded: Workplace, count: int) -> None:
    with ExitStack() as stack:
        open_before = http.client.HTTPConnection("127.0.0.1", guarded.port, timeout=5)
        stack.callback(open_before.close)
        assert stop(guarded, open_before) == 204
        guarded.station.command("resume", {})
        idle_sockets(stack, guarded, count)
        assert stop(guarded, open_before) == 204  # an admitted connection is not closed for pending ones
        newcomer = http.client.HTTPConnection("127.0.0.1", guarded.port, timeout=5)
        stack.callback(newcomer.close)
        assert stop(guarded, newcomer) == 204
    assert guarded.arm.stops >= 3


def test_the_connection_of_a_slow_request_is_closed(guarded: Workplace, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "HEAD_S", 0.4)
    with socket.create_connection(("127.0.0.1", guarded.port)) as slow:
        slow.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n")
        end = time.monotonic() + 5.0
        while not select.select([slow], [], [], 0.1)[0]:
            assert time.monotonic() < end, "it is still listened to"
            slow.sendall(b"X-More: and more\r\n")
        with suppress(ConnectionError):
            assert slow.recv(100) == b""


class Calls:
    """Limited connections, by number, and those that were closed."""

    def __init__(self) -> None:
        self.limit, self.dropped = ConnectionLimit(), list[Client]()

    def enter(self, address: str, ports: range) -> None:
        for port in ports:
            self.limit.add((address, port), lambda client=(address, port): self.dropped.append(client))  # type: ignore[misc]


def test_the_oldest_pending_connection_of_a_busy_address_is_closed() -> None:
    calls = Calls()
    calls.enter("10.0.0.1", range(PENDING_PER_ADDRESS + 2))
    assert calls.dropped == [("10.0.0.1", 0), ("10.0.0.1", 1)]
    for address in range(2, 10):
        calls.enter(f"10.0.0.{address}", range(PENDING_PER_ADDRESS if address < 5 else 1))
    assert len(calls.dropped) == 2 + 5  # beyond all pending ones
    assert MAX_PENDING == 4 * PENDING_PER_ADDRESS
    assert all(address in {f"10.0.0.{n}" for n in range(1, 5)} for address, _ in calls.dropped)


def test_admitted_connections_are_not_closed_for_pending_ones_and_are_limited_too() -> None:
    calls = Calls()
    for port in range(MAX_ADMITTED):
        calls.enter("10.0.0.1", range(port, port + 1))
        calls.limit.admit(("10.0.0.1", port))
    calls.enter("10.0.0.1", range(1000, 1000 + 2 * PENDING_PER_ADDRESS))
    assert len(calls.dropped) == PENDING_PER_ADDRESS and all(port >= 1000 for _, port in calls.dropped)
    calls.dropped.clear()
    calls.limit.admit(("10.0.0.1", 1000 + 2 * PENDING_PER_ADDRESS - 1))
    assert calls.dropped == [("10.0.0.1", 0)]
    calls.limit.remove(("10.0.0.1", 1))
    calls.limit.admit(None)
    calls.limit.admit(("10.0.0.1", 1))  # it has left


@pytest.mark.skipif(shutil.which("openssl") is None, reason="no openssl to make a certificate with")
def test_the_page_is_served_by_https(tmp_path: Path) -> None:
    key, certificate = tmp_path / "key.pem", tmp_path / "cert.pem"
    made = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    names = ["-subj", "/CN=localhost", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1"]
    subprocess.run([*made, *names, "-keyout", key, "-out", certificate], check=True, capture_output=True)
    tls = TlsFiles(certificate, key)
    tls.check()
    with workplace(tmp_path / "sets", token=TOKEN, host="0.0.0.0", tls=tls) as place:
        context = ssl.create_default_context(cafile=certificate)
        connection = http.client.HTTPSConnection("localhost", place.port, timeout=5, context=context)
        connection.request("GET", f"/?token={TOKEN}")
        answer = connection.getresponse()
        answer.read()
        assert answer.status == 303 and "Secure" in (answer.getheader("Set-Cookie") or "")
        cookie = (answer.getheader("Set-Cookie") or "").split(";")[0]
        connection.request("GET", "/", headers={"Cookie": cookie})
        assert connection.getresponse().status == 200
        connection.close()
    for wrong in (TlsFiles(certificate, certificate), TlsFiles(tmp_path / "none.pem", key)):
        with pytest.raises(AddressError, match="--tls-cert"):
            wrong.check()
