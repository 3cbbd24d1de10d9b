"""The feed of the view outlives a defect."""

from __future__ import annotations

import asyncio
import logging

import pytest

from demo_tool.web import state_feed
from demo_tool.web.state_feed import StateFeed


class BrokenStation:
    """A station whose view fails once."""

    def __init__(self) -> None:
        self.views = 0

    def wait_change(self, after: int, timeout: float) -> int:
        return after + 1

    def view(self, holder: str | None) -> dict[str, int]:
        self.views += 1
        if self.views == 2:
            raise AttributeError("words")
        return {"views": self.views}


def test_a_defect_does_not_end_the_heartbeat(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    monkeypatch.setattr(state_feed, "HEARTBEAT_S", 0.01)
    feed = StateFeed(BrokenStation())  # type: ignore[arg-type]

    async def watch() -> int:
        async with feed.running():
            return (await feed.next())["views"]

    with caplog.at_level(logging.ERROR):
        assert asyncio.run(asyncio.wait_for(watch(), 60.0)) == 3
    assert "the state could not be read" in caplog.text


def test_the_watch_ends_with_the_server() -> None:
    station = BrokenStation()
    station.views = 7  # nothing breaks any more
    feed = StateFeed(station)  # type: ignore[arg-type]

    async def watch() -> list[asyncio.Task[None]]:
        async with feed.running():
            assert feed.view == {"views": 8}
            waiting = asyncio.create_task(feed.next())
            await asyncio.sleep(0)  # it begins to wait
            running = asyncio.all_tasks() - {asyncio.current_task(), waiting}
        await asyncio.wait_for(waiting, 60.0)
        await asyncio.wait(running, timeout=60.0)
        return [task for task in running if not task.cancelled()]

    assert asyncio.run(watch()) == []
