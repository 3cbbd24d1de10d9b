"""From clicks to a better policy, unattended: a person at the page in Chromium teaches sweeps and sees them learned.

    python tests/teach_and_see.py --out out/taught                          # make teach, 12 demonstrations, 10 scenes
    python tests/teach_and_see.py --out out/dry --demonstrations 4 --scenes 1 --minutes 1

scores both shipped policies, starts `make teach`, demonstrates on new scenes, lets the page teach,
loads what was learned and asks it on the same page, accepts some of its steps by one key each, and scores it on the
same scenes.
Minutes and scores are printed and written to OUT/report.json. Without `make`, as where the set-up is not to be touched:
--launch starts the same launch file, with the data sets in OUT.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import page_eyes as eyes
from browser_user import chromium
from page_effort import effort_words
from page_person import Person
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parents[1]
TASK, PRIMITIVE = "sweeping-piles", "sweep"
START_S, LESSON_S, LOAD_S = 600.0, 4 * 3600.0, 300.0
ASKED = 5  # steps that the policy draws on the page
LEFT_OUTSIDE = 0.05  # share of the pile that may be outside of the square when it counts as swept
REST = 1.0  # until the picture shows what the sweep has left [s]


class Minutes:
    """Time that each part takes, as it is printed."""

    def __init__(self) -> None:
        self.found: dict[str, float] = {}

    @contextmanager
    def of(self, part: str) -> Iterator[None]:
        """Measure and print the body's minutes."""
        began = time.monotonic()
        yield
        self.found[part] = round((time.monotonic() - began) / 60, 2)
        print(f"{part}: {self.found[part]:g} min", flush=True)


def score(checkpoint: str, options: argparse.Namespace, name: str) -> float | None:
    """Return the mean score of a policy over the scenes, None where there are to be none."""
    if not options.scenes:
        return None
    out = options.out / f"{name}.json"
    words = ["--checkpoint", checkpoint, "--task", TASK, "--split", "test", "--first-seed", "0"]
    command = ["ros2", "run", "cliport_benchmark", "evaluate", *words, "--episodes", str(options.scenes)]
    subprocess.run([*command, "--out", str(out)], check=True, cwd=ROOT)
    return float(json.loads(out.read_text())["mean_score"])


@contextmanager
def teaching(options: argparse.Namespace) -> Iterator[str]:
    """Run the graph and the page; yield the page's address."""
    command = ["make", "teach", f"TASK={TASK}"]
    if options.launch:
        sets = f"data_sets:={options.out.resolve() / 'sets'}"
        command = ["ros2", "launch", "cliport_bringup", "teach.launch.yaml", f"task:={TASK}", sets]
        command += ["port:=0", f"real_time_factor:={options.speed:g}", "page_args:="]
    log = options.out / "teach.log"
    with log.open("w") as file:
        process = subprocess.Popen(command, cwd=ROOT, stdout=file, stderr=subprocess.STDOUT, start_new_session=True)
    try:
        end = time.monotonic() + START_S
        while not (found := re.search(r"Open (http://\S+) in a browser", log.read_text())):
            assert process.poll() is None and time.monotonic() < end, log.read_text()[-2000:]
            time.sleep(0.5)
        yield found[1]
    finally:
        os.killpg(process.pid, signal.SIGINT)
        process.wait(60.0)


def demonstrate(person: Person, most_sweeps: int) -> None:
    """Sweep a new scene's pile into the square, and end the episode; it is not judged where sweeps run out."""
    new_scene(person)
    swept = False
    for _ in range(most_sweeps):
        person.sweep_or_fold(PRIMITIVE)
        time.sleep(REST)
        swept = eyes.share_outside(person.picture()) < LEFT_OUTSIDE
        if swept:
            break
    person.end_episode(success=True if swept else None)


def recorded(person: Person) -> int:
    """End what an interrupted run left unfinished; return how many demonstrations the page counts."""
    if person.steps():
        person.end_episode(success=None)
    words = person.page.locator("#recorded", has_text="recorded").text_content() or ""
    return int(words.split()[0])


def new_scene(person: Person) -> None:
    """Ask for another scene on the page, and wait for its picture."""
    person.is_free()
    before = person.picture()
    person.page.locator("#new-scene:not([disabled])").click()
    end = time.monotonic() + 60.0
    while (person.picture() == before).all() and time.monotonic() < end:
        time.sleep(0.2)
    time.sleep(1.5)  # the things come to rest
    person.is_free()


def teach(person: Person, minutes: float | None) -> list[list[str]]:
    """Teach now, to its end, and load what was learned; return the table of before and after."""
    page = person.page
    page.locator("#tab-episodes").click()
    if minutes is not None:
        page.locator("#lesson-minutes").fill(f"{minutes:g}")
    page.locator("#teach").click()
    page.locator("#lesson[data-state=running]").wait_for()
    page.locator("#lesson-share[value], #lesson:not([data-state=running])").first.wait_for(timeout=1000 * LESSON_S)
    person.remember("learning")
    page.locator("#lesson:not([data-state=running])").wait_for(timeout=1000 * LESSON_S)
    said = page.locator("#lesson-words").text_content()
    assert page.locator("#lesson").get_attribute("data-state") == "learned", said
    rows = page.locator("#lesson-table tbody tr")
    table = [rows.nth(n).locator("th, td").all_text_contents() for n in range(rows.count())]
    page.locator("#use-learned").click()
    page.locator("#lesson-policy", has_text="is loaded").wait_for(timeout=1000 * LOAD_S)
    person.remember("learned")
    page.locator("#tab-record").click()
    return table


def ask(person: Person) -> dict[str, Any]:
    """Let the policy that was loaded draw some steps in a new scene, accept each by one key; return what came of it."""
    new_scene(person)
    person.executes_by_key = True
    before, said = eyes.share_outside(person.picture()), list[str]()
    person.page.locator("#prefill").check()
    proposed = person.page.locator(".end.place .end-words", has_text="the policy's position")
    failed = person.page.locator("#state[data-state=failed]")
    for _ in range(ASKED):
        person.begin_to_count()
        proposed.or_(failed).first.wait_for(timeout=60_000)
        if not proposed.count():
            said.append(person.page.locator("#state-words").text_content() or "")
            break
        person.remember("prefilled")
        said.append("succeeded" if person.act() else "not carried through")
        if said[-1] != "succeeded":
            break
    person.page.locator("#prefill").uncheck()
    after = eyes.share_outside(person.picture())
    return {"steps": said, "outside_before": round(before, 3), "outside_after": round(after, 3)}


def main() -> int:
    """Run it all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--demonstrations", type=int, default=12)
    parser.add_argument("--scenes", type=int, default=10, help="that are scored before and after; 0: none")
    parser.add_argument("--sweeps", type=int, default=20, help="most of a demonstration; the task allows 20")
    parser.add_argument("--minutes", type=float, help="for training (default: what the page takes by itself)")
    parser.add_argument("--data-set", help="of a run that was interrupted: it goes on with that, named as it was")
    parser.add_argument("--speed", type=float, default=1.0, help="simulated seconds per second, with --launch")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--launch", action="store_true", help="the launch file itself in place of make teach")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    minutes, name = Minutes(), options.data_set or f"taught-{time.strftime('%Y%m%d-%H%M%S')}"
    with minutes.of("score before"):
        before = score("default", options, "before")
    with teaching(options) as address, sync_playwright() as driver, chromium(driver) as browser:
        person = Person(browser, address, options.out / "album")
        person.sees("ready", timeout=START_S)
        person.open_data_set(name)
        with minutes.of("demonstrations"):
            for number in range(recorded(person), options.demonstrations):
                demonstrate(person, options.sweeps)
                print(f"demonstration {number + 1} of {options.demonstrations}", flush=True)
        with minutes.of("teach now"):
            table = teach(person, options.minutes)
        with minutes.of("asked on the page"):
            asked = ask(person)
        assert not person.faults, person.faults
        effort = effort_words(person.efforts)
    sets = options.out / "sets" if options.launch else ROOT / "demonstrations"
    (learned,) = (sets.parent / "learned" / name).glob("*/training")
    with minutes.of("score after"):
        after = score(str(learned), options, "after")
    report = {"before": before, "after": after, "table": table, "asked": asked, "effort": effort}
    report |= {"minutes": minutes.found, "demonstrations": options.demonstrations, "scenes": options.scenes}
    (options.out / "report.json").write_text(json.dumps(report, indent=2) + "\n")
    print(f"score {before} before, {after} after; held out: {table}; on the page: {asked}; {effort}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
