"""What goes over the websocket."""

import asyncio
import json
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from types import SimpleNamespace

import psutil
import pytest
from page_socket import opened
from web_workplace import PATIENCE, workplace
from websockets.exceptions import ConnectionClosed
from websockets.protocol import State
from websockets.sync.client import ClientConnection

from demo_tool.web import session
from demo_tool.web.arm_holder import ArmHolder
from demo_tool.web.session import Sessions


def send(page: ClientConnection, number: int, command: str, **arguments: object) -> None:
    page.send(json.dumps({"id": number, "command": command, "arguments": arguments}))


def messages_for(page: ClientConnection, seconds: float) -> list[dict]:
    end, found = time.monotonic() + seconds, []
    while (left := end - time.monotonic()) > 0:
        try:
            found.append(json.loads(page.recv(timeout=left)))
        except TimeoutError:
            break
    return found


def test_the_whole_state_first_then_what_changes(tmp_path: Path) -> None:
    with workplace(tmp_path) as place, opened(place) as page:
        whole = json.loads(page.recv(timeout=PATIENCE))["view"]
        assert {"state", "words", "draft", "camera", "holder", "episode", "policy"} <= set(whole)
        news = messages_for(page, 2.5)
        assert 2 <= len(news) <= 40  # a sign of life each second, never more than 15 a second
        assert all(len(json.dumps(message)) < 400 for message in news)  # nothing is drawn, so no drafts go over
        send(page, 1, "pick", box=place.table.box_around(place.table.blocks[0]), rotation=3)
        drafts = [m["view"]["draft"] for m in messages_for(page, 0.7) if "draft" in m.get("view", {})]
        assert drafts[-1]["pick"]["rotation"] == 3


def test_a_stop_overtakes_what_takes_long(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with workplace(tmp_path) as place, opened(place) as page, ExitStack() as others:
        released = threading.Event()
        original = place.station.command

        def slow(name: str, arguments: dict) -> dict:
            if name != "statistics":
                return original(name, arguments)
            released.wait(60)
            return {}

        monkeypatch.setattr(place.station, "command", slow)
        for number in range(8):  # a page's commands wait for each other
            send(page, number, "statistics")
            send(others.enter_context(opened(place, f"other-page-{number}")), number, "statistics")
        send(page, 99, "stop")
        try:
            while "id" not in (message := json.loads(page.recv(timeout=30))):
                pass
            assert message["id"] == 99 and message["ok"] and place.arm.stopped
        finally:
            released.set()


def test_a_defect_is_answered_and_leaves_the_session_alive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with workplace(tmp_path) as place, opened(place) as page:
        original = place.station.command
        broken = lambda name, arguments: 1 / 0 if name == "clear" else original(name, arguments)  # noqa: E731
        monkeypatch.setattr(place.station, "command", broken)
        send(page, 1, "clear")
        send(page, 2, "primitive", name="sweep")
        answers = {m["id"]: m for m in messages_for(page, 0.6) if "id" in m}
        assert not answers[1]["ok"] and "ZeroDivision" not in answers[1]["error"]
        assert answers[2]["ok"]


def test_a_connection_that_a_failed_send_has_closed_ends_quietly() -> None:
    """Starlette then refuses to receive, although a request was still to come."""

    class ClosedSocket:
        async def receive_text(self) -> str:
            raise RuntimeError("WebSocket is not connected")

        async def send_text(self, text: str) -> None:
            raise RuntimeError("it is closed")

    feed, holder = SimpleNamespace(view={}), ArmHolder()
    sessions = Sessions(feed, None, holder)  # type: ignore[arg-type]
    asyncio.run(sessions._talk(ClosedSocket(), "only-page"))  # type: ignore[arg-type]


def test_loads_and_dropped_connections_leave_memory_flat(tmp_path: Path) -> None:
    with workplace(tmp_path) as place:
        process = psutil.Process()
        after = []
        for round_ in range(3):
            for number in range(40):
                page = opened(place, f"dropped-page-{round_}-{number}")
                page.recv(timeout=PATIENCE)
                page.socket.close()  # no goodbye
            time.sleep(0.5)
            after.append(process.memory_info().rss)
        assert after[2] - after[1] < 8e6
        with opened(place, "page-after-all") as page:
            assert "view" in json.loads(page.recv(timeout=PATIENCE))


def test_a_page_that_asks_for_too_much_at_once_is_closed_but_its_stop_counts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "MAX_PENDING_REQUESTS", 3)
    released = threading.Event()
    with workplace(tmp_path) as place, opened(place) as page:
        original = place.station.command

        def slow(name: str, arguments: dict) -> dict:
            if name == "statistics":
                released.wait(PATIENCE)
                return {}
            return original(name, arguments)

        monkeypatch.setattr(place.station, "command", slow)
        try:
            for number in range(3):
                send(page, number, "statistics")
            send(page, 3, "stop")
            end = time.monotonic() + PATIENCE
            while place.arm.stops == 0 and time.monotonic() < end:
                time.sleep(0.02)
            assert place.arm.stops == 1 and page.state is State.OPEN, "three may wait, and a stop goes before them"
            send(page, 4, "statistics")
            with pytest.raises(ConnectionClosed):
                messages_for(page, PATIENCE)
        finally:
            released.set()
