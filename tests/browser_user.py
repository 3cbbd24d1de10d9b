"""Somebody at the page in a real browser: what all who play one can do."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Playwright

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
_ARGUMENTS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
Point = tuple[float, float]  # of the screen [pixels]
_COUNT_POINTER = """
addEventListener('pointerdown', (event) => {
  if (event.isTrusted) sessionStorage.pointerActions = 1 + Number(sessionStorage.pointerActions ?? 0);
}, true);
"""


@contextmanager
def chromium(driver: Playwright) -> Iterator[Browser]:
    """A browser for as long as the body runs."""
    browser = driver.chromium.launch(executable_path=CHROMIUM, args=list(_ARGUMENTS))
    try:
        yield browser
    finally:
        browser.close()


class BrowserUser:
    """One at a page that is open in a browser; faults: errors of the page's scripts."""

    def __init__(self, browser: Browser, address: str, patience: float, **device: Any) -> None:
        """patience: longest wait for anything [s]; device: what the browser pretends to be."""
        self.faults: list[str] = []
        self.page: Page = browser.new_context(**device).new_page()
        self.page.set_default_timeout(1000 * patience)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.add_init_script(_COUNT_POINTER)
        self.page.goto(address)

    @property
    def pointer_actions(self) -> int:
        """Clicks, taps and drags so far, also before the page was loaded again."""
        return int(self.page.evaluate("Number(sessionStorage.pointerActions ?? 0)"))

    def sees(self, *states: str, timeout: float | None = None) -> None:
        """Wait until the page says that the arm is in one of the states; timeout [s]: another than the usual one."""
        from playwright.sync_api import TimeoutError  # only who has a browser needs it

        shown = ", ".join(f"#state[data-state={state}]" for state in states)
        try:
            self.page.locator(shown).wait_for(timeout=timeout and 1000 * timeout)
        except TimeoutError:
            words = self.page.locator("#state-words").text_content()
            raise AssertionError(f"the page is not {' or '.join(states)}; it says: {words}") from None

    def pixel(self, row: float, col: float, shape: tuple[int, ...]) -> Point:
        """Where a pixel of a picture (H, W) is on the screen."""
        area = self.page.locator("#overlay").bounding_box()
        assert area is not None
        return area["x"] + col * area["width"] / shape[1], area["y"] + row * area["height"] / shape[0]

    def pull(self, start: Point, end: Point) -> None:
        """Drag by mouse from one point of the screen to another."""
        self.page.mouse.move(*start)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=4)
        self.page.mouse.up()

    def leave(self) -> None:
        """Close the page, on which nothing may have failed."""
        assert not self.faults, self.faults
        self.page.context.close()
