"""Somebody who uses the page of a workplace in a browser, by mouse, finger and keys."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from browser_user import BrowserUser, Point
from web_workplace import PATIENCE, Workplace

if TYPE_CHECKING:
    from playwright.sync_api import Browser


class Person(BrowserUser):
    """Somebody at the page of a workplace."""

    def __init__(self, browser: Browser, place: Workplace, **device: Any) -> None:
        super().__init__(browser, place.url, PATIENCE, **{"viewport": {"width": 1024, "height": 768}, **device})
        self.place = place
        self.sees("ready")

    def at(self, row: float, col: float) -> Point:
        """Return the place of a picture's pixel on the screen."""
        return self.pixel(row, col, (self.place.table.height, self.place.table.width))

    def drag(self, box: list[int]) -> None:
        top, left, bottom, right = box
        self.pull(self.at(top, left), self.at(bottom, right))

    def draw_both(self) -> None:
        """A pick around the first block, a place beside it."""
        self.drag(self.box)
        self.words("pick", "points")
        self.drag(self.goal)
        self.words("place", "points")

    @property
    def box(self) -> list[int]:
        return self.place.table.box_around(self.place.table.blocks[0])

    @property
    def goal(self) -> list[int]:
        return self.place.table.box_at(0.5, -0.02)

    def end_episode(self) -> None:
        """End the episode, and wait until the page shows the next one, on which nothing is drawn."""
        self.click("#next-episode")
        self.page.locator("#steps li").first.wait_for(state="hidden")
        for end in ("pick", "place"):
            self.page.locator(f".end.{end} .end-words", has_text="points").wait_for(state="hidden")

    def words(self, end: str, text: str) -> None:
        """Wait until something is said of the pick or the place."""
        self.page.locator(f".end.{end} .end-words", has_text=text).wait_for()

    def click_towards(self, end: str, rotation: int) -> None:
        """Click beside a box, in the direction of a rotation."""
        self.page.mouse.click(*self.around(end, rotation, 50))

    def middle(self, selector: str, number: int = 0) -> Point:
        """The middle of something on the screen; what is drawn on the picture is drawn anew now and then."""
        self.page.locator(selector).nth(number).wait_for()
        x, y, width, height = self.page.evaluate(
            """([selector, number]) => {
                const area = document.querySelectorAll(selector)[number].getBoundingClientRect();
                return [area.x, area.y, area.width, area.height];
            }""",
            [selector, number],
        )
        return x + width / 2, y + height / 2

    def around(self, end: str, rotation: int, pixels: float) -> Point:
        """A point of the screen beside what a box holds, in the direction of a rotation."""
        shown = self.drawn(end)
        (row, col), (down, right) = shown["grasp"]["centroid_pixel"], shown["directions"][rotation]
        x, y = self.at(row, col)
        return x + pixels * right, y + pixels * down

    def drawn(self, end: str) -> dict:
        return self.place.station.view(None)["draft"][end]

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)

    def click(self, selector: str) -> None:
        self.page.locator(selector).click()


def until(condition: Callable[[], object], what: str | Callable[[], str]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, what if isinstance(what, str) else what()
        time.sleep(0.02)


def steps(place: Workplace) -> list[dict]:
    episode = place.station.view(None)["episode"]
    return episode["steps"] if episode else []


def episode_folders(place: Workplace) -> list[Path]:
    data_set = place.station.view(None)["data_set"]
    return list((place.root / data_set / "episodes").iterdir())
