"""Pictures of the page in each of its states and widths, on a workplace of fakes.

    python src/demo_tool/test/page_album.py out/album

`tests/page_person.py --album` makes those of the simulated workplace, of some states.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[3] / "tests"))  # where the browser's user is

from browser_user import BrowserUser, chromium
from playwright.sync_api import Browser, sync_playwright
from soak_server import Soaked
from test_soak_page import STATES
from web_workplace import PATIENCE, Workplace, workplace

SIZES = ((1280, 900), (768, 1024), (390, 844))
TRAINING = "[############------------] 100/200  locator 2.310  31.0 samples/s  4 min left"
LEARNED = {
    "learned": ["one", "two", "three", "four"],
    "held_out": ["five"],
    "policy": "learned/blocks",
    "table": [["pick and place within 20 mm", "0 %", "80 %"], ["pick, median", "200 mm", "3 mm"]],
}


class Photographer(BrowserUser):
    """Somebody who takes pictures of the page in all widths."""

    def __init__(self, browser: Browser, address: str, out: Path) -> None:
        super().__init__(browser, address, PATIENCE)
        self._out = out

    def take(self, name: str) -> None:
        for width, height in SIZES:
            self.page.set_viewport_size({"width": width, "height": height})
            self.page.evaluate("scrollTo(0, 0)")
            self.page.wait_for_timeout(200)
            self.page.screenshot(path=self._out / f"{name}_{width}.png", full_page=True)


def main() -> None:
    """Make the album."""
    out = Path(sys.argv[1])
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as root, workplace(Path(root)) as place, sync_playwright() as driver:
        soaked = Soaked(place)
        with chromium(driver) as browser:
            person = Photographer(browser, place.url, out)
            for state in STATES:
                soaked.rest()
                soaked.bring_about(state)
                person.sees(state)
                person.page.wait_for_timeout(600)  # for the mark beside the place, and a picture
                person.take(state)
            soaked.rest()
            episodes(person, place)
            person.leave()


def episodes(person: Photographer, place: Workplace) -> None:
    """Take the part Episodes: the list, one episode with its motion, a lesson and its end."""
    place.station.command("end_episode", {"success": True})
    person.page.locator("#tab-episodes").click()
    person.page.locator("#episode-table tbody tr button").first.click()
    person.page.locator("#one-episode img").wait_for()
    person.take("episodes")
    person.page.locator("#teach:not([disabled])").click()
    person.page.locator("#lesson[data-state=running]").wait_for()
    place.lessons.on_line(TRAINING)
    person.page.locator("#lesson-words", has_text="4 min left").wait_for()
    person.take("lesson_running")
    place.lessons.on_end(0, LEARNED)
    person.page.locator("#lesson[data-state=learned]").wait_for()
    person.take("lesson_learned")


if __name__ == "__main__":
    main()
