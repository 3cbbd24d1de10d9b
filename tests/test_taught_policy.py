"""A policy learns on the page from recorded episodes, and the server that runs takes it; real parts throughout.

`make soak PYTEST_ARGS=tests/test_taught_policy.py` runs this; on two cores it takes about a quarter of an hour.
"""

import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api", reason="no Chromium's driver (playwright) on this machine")
import page_person as teaching
from browser_user import CHROMIUM
from ros_domain import next_domain

pytestmark = [
    pytest.mark.soak,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine"),
    pytest.mark.timeout(7200),
]

TASK = "put-blocks-in-bowls-unseen-colors"  # words that the shipped policy does not know
LESSON_S = 3600.0


def test_a_policy_learns_on_the_page_and_is_loaded(tmp_path: Path) -> None:
    sets = tmp_path / "sets"
    record = [sys.executable, "-m", "cliport_benchmark.record_cli", "--task", TASK, "--split", "val"]
    subprocess.run([*record, "--episodes", "5", "--out", str(sets / "mine")], check=True)
    with teaching.workplace(tmp_path, next_domain(), speed=1.0) as place:
        person = teaching.Person(place.browser, place.app.address)
        person.open_data_set("mine")
        person.page.locator("#tab-episodes").click()
        began = time.monotonic()
        person.page.locator("#teach").click()
        person.page.locator("#lesson-share[value]").wait_for(state="attached", timeout=1000 * LESSON_S)
        person.page.locator("#lesson[data-state=learned]").wait_for(timeout=1000 * LESSON_S)
        rows = person.page.locator("#lesson-table tbody tr").all_text_contents()
        print(f"learned in {(time.monotonic() - began) / 60:.1f} min: {rows}")
        assert len(rows) == 3
        person.page.locator("#use-learned").click()
        loaded = f"the policy {tmp_path}/learned/mine/"
        person.page.locator("#lesson-policy", has_text=loaded).wait_for(timeout=120_000)
        person.page.locator("#lesson-policy", has_text="is loaded").wait_for(timeout=120_000)
        place.client.reset(TASK, "val", 1)
        time.sleep(2.0)
        person.page.locator("#tab-record").click()
        sentence = person.page.locator("#instruction").input_value() or "put the orange blocks in a purple bowl"
        person.say(sentence)
        person.page.locator("#ask:not([disabled])").click()
        person.page.locator("#correct:not([disabled])").wait_for(timeout=60_000)
