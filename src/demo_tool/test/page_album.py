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
from playwright.sync_api import sync_playwright
from soak_server import Soaked
from test_soak_page import STATES
from web_workplace import PATIENCE, workplace

SIZES = ((1280, 900), (768, 1024), (390, 844))


def main() -> None:
    """Make the album."""
    out = Path(sys.argv[1])
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as root, workplace(Path(root)) as place, sync_playwright() as driver:
        soaked = Soaked(place)
        with chromium(driver) as browser:
            person = BrowserUser(browser, place.url, PATIENCE)
            for state in STATES:
                soaked.rest()
                soaked.bring_about(state)
                person.sees(state)
                person.page.wait_for_timeout(600)  # for the mark beside the place, and a picture
                for width, height in SIZES:
                    person.page.set_viewport_size({"width": width, "height": height})
                    person.page.wait_for_timeout(200)
                    person.page.screenshot(path=out / f"{state}_{width}.png", full_page=True)
            soaked.rest()
            person.page.locator("#tab-episodes").click()
            person.page.locator("#episode-table tbody tr").first.wait_for()
            for width, height in SIZES:
                person.page.set_viewport_size({"width": width, "height": height})
                person.page.screenshot(path=out / f"episodes_{width}.png", full_page=True)
            person.leave()


if __name__ == "__main__":
    main()
