"""Somebody who teaches at the page: looks at the picture, draws boxes, clicks rotations. Knows nothing of ROS.

    python tests/page_person.py --episodes 10 --out out/teaching
    python tests/page_person.py --episodes 5 --primitive sweep --out out/sweeps
    python tests/page_person.py --episodes 10 --by clicks --out out/clicked

starts the simulator's graph and `demo_tool app`, records that many demonstrations of two steps in Chromium, with a
reload in the midst of one and a killed server in the midst of another, and says what the bags hold, which it reads with
the `rosbags` library alone. With another primitive the demonstrations are of one step. By clicks it points at the
things and presses E; by boxes, as the page once demanded, it draws them and turns the fingers. It prints the median
number of pointer actions and seconds a step, until the arm begins and with its motion.
"""

from __future__ import annotations

import argparse
import base64
import math
import os
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import page_eyes as eyes
from browser_user import BrowserUser, chromium
from numpy.typing import NDArray
from page_effort import Effort, effort_words
from page_eyes import Blob, find, inside
from playwright.sync_api import Browser, expect, sync_playwright
from playwright.sync_api import TimeoutError as PageTimeout
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from cliport_benchmark.graph_client import GraphClient
from cliport_benchmark.graph_process import GraphProcess
from cliport_benchmark.page_process import PageProcess

TASK, SENTENCE = "put-blocks-in-bowls-seen-colors", "put the red blocks in a green bowl"
OTHERS = {  # primitive: a task of it, and its sentence
    "sweep": ("sweeping-piles", "push the pile of blocks into the green square"),
    "fold": ("manipulating-rope", "manipulate the rope to complete the square"),
}
expect.set_options(timeout=20_000)
SUCCEEDED = 0
DATA_SET = "by-hand"
WIDTHS, HEIGHT = (1280, 768, 390), 900  # of the page in an album
_TRIES = 30  # of a click that the page refuses
_DRAWS = 2  # of a box
_NO_ANSWER = 4.0  # after which a click or a pull on the picture was taken for something else [s]
_LOADING = 300  # looks at a page that has no picture yet
_REPORT = 2.5  # until the executor has said what the hand holds [s]
_LOOK = 0.3  # until the page has begun what was asked [s]
_ATTEMPTS = 8  # of a step that the arm does not carry through
_REFUSAL = "#answer[data-ok=false]"  # its words may stand elsewhere on the page


class Refused(AssertionError):
    """The page does not do what is asked."""


class Person(BrowserUser):
    """One at a page that is open in a browser, who sees the picture only."""

    def __init__(self, browser: Browser, address: str, album: Path | None = None) -> None:
        """album: a folder for pictures of the page in each of its main states, in each width."""
        super().__init__(browser, address, patience=20.0, viewport={"width": WIDTHS[0], "height": HEIGHT})
        self.album = album
        self.efforts: list[Effort] = []  # for each step that the arm carried through
        self._effort = Effort(0, 0.0, 0.0)
        self.executes_by_key = False

    def sees(self, *states: str, timeout: float | None = 60.0) -> None:
        """Wait until the page says so, as long as the simulated arm takes for most things."""
        super().sees(*states, timeout=timeout)

    def open_data_set(self, name: str) -> None:
        """Open a data set on a page that has none."""
        self.is_free()
        self.page.locator("#data-set").fill(name)
        self.page.locator("#data-set-card button").click()
        expect(self.page.locator("#where")).to_contain_text(name)

    def change_data_set(self, name: str) -> None:
        """Another than the one that is open, on a page whose arm is held by nobody, or by a page that is gone."""
        self.is_free()
        if self.page.locator("#watching").is_visible():
            self.page.locator("#take-over").click()
        if self.page.locator("#data-set").is_hidden():
            self.page.locator("#tab-episodes").click()
            self.page.locator("#data-set-other").click()
        self.open_data_set(name)

    def say(self, sentence: str) -> None:
        field = self.page.locator("#instruction")
        field.fill(sentence)
        field.press("Enter")

    def is_free(self) -> None:
        """Wait until nothing is under way, whether it was well or badly that the last thing ended."""
        self.sees("ready", "failed", timeout=120.0)

    def picture(self) -> NDArray[np.uint8]:
        """Return the picture of the live view, (H, W, 3) RGB; a page that was just loaded has none for a moment."""
        for _ in range(_LOADING):
            url = self.page.evaluate("document.getElementById('live').toDataURL('image/png')")
            coded = np.frombuffer(base64.b64decode(url.split(",")[1]), np.uint8)
            picture = np.ascontiguousarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)[..., ::-1])
            if picture.any():
                return picture
            time.sleep(0.1)
        raise AssertionError("the page shows no picture")

    def steps(self) -> int:
        return self.page.locator("#steps li").count()

    def pick_and_place(self, by_clicks: bool = False) -> None:
        """One step: a red thing that is in no bowl into a green one that is empty; again where the arm failed."""
        self.begin_to_count()
        self.executes_by_key = by_clicks
        for _ in range(_ATTEMPTS):
            self.draw_a_step(by_clicks)
            if self.act():
                return
            self.let_go()

    def let_go(self) -> None:
        """Open the hand where a step that failed has left something in it."""
        held = self.page.locator("#held")
        with suppress(PageTimeout):
            held.wait_for(timeout=1000 * _REPORT)
            self.page.locator("#open-hand").click()
            held.wait_for(state="hidden")

    def begin_to_count(self) -> None:
        """Count pointer actions and seconds of a step from here on."""
        now = time.monotonic()
        self._effort = Effort(self.pointer_actions, now, now)

    def draw_a_step(self, by_clicks: bool = False) -> None:
        """Draw such a step, which the arm can do."""
        picture = self.picture()
        blocks, bowls = find(picture, "red"), find(picture, "green", least=800)
        loose = [block for block in blocks if not any(inside(block, bowl) for bowl in bowls)]
        empty = [bowl for bowl in bowls if not any(inside(block, bowl) for block in blocks)]
        assert loose, "nothing is left to be picked, but the page did not call the step done"
        draw = self.point_at if by_clicks else self.draw_and_preview
        pairs = [(block, bowl) for bowl in empty for block in loose]
        can = any(draw(block, bowl, picture.shape, margins=(4, 0)) for block, bowl in pairs)
        assert can, self.page.locator("#answer").text_content()

    def sweep_or_fold(self, primitive: str) -> None:
        """One step of another primitive: "sweep", "fold"; once more in the scene that is left where the arm failed."""
        button = self.page.locator(f"#primitive [data-primitive={primitive}]")
        button.click()
        expect(button).to_have_attribute("aria-pressed", "true")
        self.begin_to_count()
        for attempt in range(_ATTEMPTS):
            picture = self.picture()
            start, end = (eyes.sweep if primitive == "sweep" else eyes.fold)(picture, attempt)
            if self.draw_and_preview(start, end, picture.shape, margins=(0, 0)) and self.act():
                return
        raise Refused(f"no {primitive} in {_ATTEMPTS} attempts; the page says: {self.said()}")

    def draw_and_preview(self, start: Blob, end: Blob, shape: tuple[int, ...], margins: tuple[float, float]) -> bool:
        """Draw both boxes, turn the fingers along either side of the thing; whether the arm can do it."""
        self._clear()
        try:
            self._until(lambda: self.draws("pick", start, shape, margins[0]), _DRAWS)
            self._until(lambda: self.draws("place", end, shape, margins[1], away_from=start), _DRAWS)
        except Refused as refusal:  # it is outside of the workspace, or has no depth
            print(refusal, flush=True)
            return False
        return any(self.can(start, shape, start.angle + turn) for turn in 2 * (0.0, math.pi / 2))

    def point_at(self, start: Blob, end: Blob, shape: tuple[int, ...], margins: tuple[float, float]) -> bool:
        """Click on the thing and on its place, and wait for the sign that the page shows; else draw both boxes."""
        self._clear()
        self._until(lambda: self.points("pick", start, shape))
        self._until(lambda: self.points("place", end, shape))
        mark = self.page.locator("#overlay .reach")
        mark.wait_for()
        return mark.and_(self.page.locator(".good")).count() > 0 or self.draw_and_preview(start, end, shape, margins)

    def _clear(self) -> None:
        """Take away what an earlier try has left."""
        if self.page.locator("#clear").is_enabled():
            self.page.locator("#clear").click()
            expect(self.page.locator("#clear")).to_be_disabled()

    def points(self, end: str, blob: Blob, shape: tuple[int, ...]) -> bool:
        """Click on something; whether the page draws the end around it. It turns the fingers within their ring."""
        self.page.mouse.click(*self.pixel(blob.centre[1], blob.centre[0], shape))
        try:
            return self._answered(f".end.{end} .end-words:has-text('points')", _NO_ANSWER)
        except PageTimeout:
            self.page.locator(f".end.{end} .end-name").click()
            return False

    def act(self) -> bool:
        """Let the arm do what was drawn, to its end; whether the page says of a new step that it succeeded."""
        before = self.steps()
        self.remember("previewed")
        self.begin()
        begun = time.monotonic()
        if self.album and not self._remembers("executing"):
            self.page.locator("#progress:not([hidden])").wait_for()
            time.sleep(2.0)
            self.remember("executing")
        self.is_free()
        said = self.page.locator("#steps li").last if self.steps() > before else self.page.locator("#state-words")
        print(words := said.text_content() or "", flush=True)
        done = self.steps() > before and words.endswith("succeeded")
        if done:
            actions, start, _ = self._effort
            self.efforts.append(Effort(self.pointer_actions - actions, begun - start, time.monotonic() - start))
        return done

    def begin(self) -> None:
        """Let the arm begin with what was drawn."""
        self._until(self.executes)

    def can(self, blob: Blob, shape: tuple[int, ...], angle: float) -> bool:
        """Turn the fingers, and ask whether the arm can do what is drawn."""
        self.turn(blob, shape, angle)
        with suppress(PageTimeout):  # then what is said of a plan is said of this rotation
            self.page.locator("#overlay .reach").wait_for(timeout=3_000)
        self.is_free()
        self.page.locator("#preview").click()
        time.sleep(_LOOK)  # the plan that is shown may still be the one before
        self.is_free()
        return self._answered("#plan:not([hidden])") and "✓" in (self.page.locator("#plan").text_content() or "")

    def executes(self) -> bool:
        """Let the arm do it; whether it begins."""
        try:
            expect(self.page.locator("#execute")).to_be_enabled(timeout=5_000)
        except AssertionError:  # it is disabled while the picture or the arm is not there
            return False
        if self.executes_by_key:
            self.page.keyboard.press("e")
        else:
            self.page.locator("#execute").click()
        return self._answered("#state:is([data-state=planning], [data-state=executing])")

    def draws(self, end: str, blob: Blob, shape: tuple[int, ...], margin: float, away_from: Blob | None = None) -> bool:
        """A box around something, drawn from its corner farthest from another; whether the page takes it."""
        (col, row), (wide, high) = blob.centre, blob.half
        other_col, other_row = away_from.centre if away_from is not None else (math.inf, math.inf)
        right, down = math.copysign(wide + margin, col - other_col), math.copysign(high + margin, row - other_row)
        self.pull(self.pixel(row + down, col + right, shape), self.pixel(row - down, col - right, shape))
        try:
            return self._answered(f".end.{end} .end-words:has-text('points')", _NO_ANSWER)
        except PageTimeout:  # it was the ring's knob that was pulled
            return False

    def turn(self, blob: Blob, shape: tuple[int, ...], angle: float) -> None:
        """Choose the pick and click beside its box, in a direction of the picture."""
        self.page.locator(".end.pick .end-name").click()
        col, row = blob.centre
        x, y = self.pixel(row, col, shape)
        self.page.mouse.click(x + 60 * math.cos(angle), y + 60 * math.sin(angle))

    def end_episode(self, success: bool | None) -> None:
        """End the episode and mark it; None: nobody judges it."""
        self.is_free()  # then there is a picture of the finished scene, which is recorded, too
        if success is not None:
            self.page.locator("#success" if success else "#failure").click()
        self.page.locator("#next-episode").click()
        expect(self.page.locator("#steps li")).to_have_count(0)

    def look_around(self) -> None:
        """Stop and resume, then look at what was recorded: for the album."""
        self.page.locator("body").press("Space")
        self.sees("stopped")
        self.remember("stopped")
        self.page.locator("#resume").click()
        self.sees("ready")
        self.page.locator("#tab-episodes").click()
        self.page.locator("#episode-table tbody tr").first.wait_for()
        self.page.locator("#count").click()
        self.page.locator("#statistics img").wait_for()
        time.sleep(1.0)
        self.remember("episodes")
        self.page.locator("#tab-record").click()

    def remember(self, state: str) -> None:
        """Put a picture of the page into the album, where there is one and it lacks this."""
        if self.album is None or self._remembers(state):
            return
        self.album.mkdir(parents=True, exist_ok=True)
        for width in reversed(WIDTHS):  # it is left as wide as it was
            self.page.set_viewport_size({"width": width, "height": HEIGHT})
            name = f"page_{state}.jpg" if width == WIDTHS[0] else f"page_{state}_{width}.jpg"
            self.page.screenshot(path=self.album / name, type="jpeg", quality=80, full_page=width != WIDTHS[0])

    def _remembers(self, state: str) -> bool:
        return self.album is not None and (self.album / f"page_{state}.jpg").exists()

    def _until(self, act: Callable[[], bool], tries: int = _TRIES) -> None:
        """Try again what the page refuses: now and then a picture is too old, or a direction is no good."""
        for _ in range(tries):
            self.is_free()
            if act():
                return
            time.sleep(0.3)
        raise Refused(f"refused {tries} times; the page says: {self.said()}")

    def said(self) -> str:
        """What the page says of the last answer and of both ends."""
        return "; ".join(words for words in self.page.locator("#answer, .end-words").all_text_contents() if words)

    def _answered(self, granted: str, timeout: float | None = None) -> bool:
        """Wait for what the page shows when it does what was asked, or for its refusal; whether it was the former."""
        self.page.locator(f"{granted}, {_REFUSAL}").first.wait_for(state="attached", timeout=timeout and 1000 * timeout)
        return self.page.locator(granted).count() > 0


@dataclass
class Workplace:
    """The simulator's graph, the app and a browser."""

    client: GraphClient
    app: PageProcess
    browser: Browser
    root: Path
    domain: int

    @property
    def sets(self) -> Path:
        """The folder of the data sets."""
        return self.root / "sets"

    def kill_and_restart(self) -> None:
        """Another server in the place of one that had no time to end."""
        self.app.end(signal.SIGKILL)
        self.app = PageProcess(self.sets, self.domain, self.app.port)


@contextmanager
def workplace(root: Path, domain: int, speed: float, **more: str) -> Iterator[Workplace]:
    """A workplace for as long as the context lasts; more: arguments of sim.launch.yaml."""
    scene = {"task": TASK, "split": "test", "seed": "1", "real_time_factor": str(speed)}
    arguments = {**scene, "require_approval": "true", **more}
    with (
        GraphProcess("sim.launch.yaml", arguments, root / "graph.log", {"ROS_DOMAIN_ID": str(domain)}) as graph,
        GraphClient(domain_id=domain) as client,
        sync_playwright() as driver,
    ):
        client.wait_ready(120.0, lambda: graph.alive)
        with chromium(driver) as browser:
            place = Workplace(client, PageProcess(root / "sets", domain), browser, root, domain)
            try:
                yield place
            finally:
                place.app.end()


def lay_out(person: Person, client: GraphClient, seed: int) -> int:
    """Reset to the next scene, from a seed on, with two blocks and two bowls to be told apart; the seed after it."""
    while True:
        client.reset(TASK, "test", seed, SENTENCE)
        time.sleep(1.5)  # the picture of the new scene
        person.sees("ready")
        picture = person.picture()
        seed += 1
        blocks, bowls = find(picture, "red"), find(picture, "green", least=800)
        sizes = [max(block.half) for block in blocks]
        if len(blocks) == 2 and len(bowls) >= 2 and max(sizes) < 1.6 * min(sizes):
            return seed


def sweep_or_fold(person: Person, client: GraphClient, primitive: str, seed: int) -> tuple[float, float]:
    """An episode of "sweep" or "fold", in a new scene; the scores before and after."""
    task, sentence = OTHERS[primitive]
    client.reset(task, "test", seed)
    time.sleep(1.5)  # the picture of the new scene
    person.sees("ready")
    person.say(sentence)
    before = client.score()
    person.sweep_or_fold(primitive)
    after = client.score()
    person.end_episode(after > before)
    return before, after


def go_on(person: Person, data_set: str = DATA_SET) -> None:
    """Do as somebody whose page has lost its server: load it again, open the same data set."""
    person.page.reload()
    person.open_data_set(data_set)
    person.say(SENTENCE)


def outcomes(data_set: Path) -> list[list[int]]:
    """Return the outcome of each episode's steps, read with the `rosbags` library and the definitions in the bags."""
    found = []
    for folder in sorted((data_set / "episodes").iterdir()):
        with Reader(folder) as reader:
            known = get_typestore(Stores.ROS2_JAZZY)
            said = []
            for connection, _, data in reader.messages():
                if connection.topic == "/cliport/demonstration":
                    if connection.msgtype not in known.types:
                        known.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
                    said.append(int(known.deserialize_cdr(data, connection.msgtype).outcome))
            found.append(said)
    return found


def record_two_steps(person: Person, place: Workplace, options: argparse.Namespace) -> None:
    """Demonstrations of blocks in bowls."""
    seed, started, by_clicks = options.seed, time.monotonic(), options.by == "clicks"
    for number in range(options.episodes):
        seed = lay_out(person, place.client, seed)
        person.say(SENTENCE)
        person.pick_and_place(by_clicks)
        if number == 2:
            person.page.reload()
        if number == 4:
            place.kill_and_restart()
            go_on(person)
        expect(person.page.locator("#steps li")).not_to_have_count(0)
        person.pick_and_place(by_clicks)
        score = place.client.score()
        person.end_episode(score > 0.99)
        print(f"episode {number + 1}: score {score:.2f}, {time.monotonic() - started:.0f} s", flush=True)
        if number == 0 and options.album:
            person.look_around()


def record_one_step(person: Person, place: Workplace, options: argparse.Namespace) -> None:
    """Demonstrations of another primitive."""
    for number in range(options.episodes):
        before, after = sweep_or_fold(person, place.client, options.primitive, options.seed + number)
        print(f"episode {number + 1}: score {before:.2f}, then {after:.2f}", flush=True)


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--primitive", choices=("pick_place", *OTHERS), default="pick_place")
    parser.add_argument("--by", choices=("boxes", "clicks"), default="boxes", help="how blocks are demonstrated")
    parser.add_argument("--seed", type=int, default=3000)
    parser.add_argument("--speed", type=float, default=2.0, help="simulated seconds per second")
    parser.add_argument("--out", type=Path, default=Path("out/teaching"))
    parser.add_argument("--album", type=Path, help="folder for pictures of the page's main states")
    options = parser.parse_args()
    with workplace(options.out, int(os.environ.get("ROS_DOMAIN_ID", "61")), options.speed) as place:
        person = Person(place.browser, place.app.address, options.album)
        person.sees("ready")
        person.remember("begin")
        person.open_data_set(DATA_SET)
        (record_two_steps if options.primitive == "pick_place" else record_one_step)(person, place, options)
        assert not person.faults, person.faults
    found = outcomes(options.out / "sets" / DATA_SET)
    print(f"{len(found)} episodes of {Counter(len(steps) for steps in found)} steps; outcomes {found}")
    held = sum(outcome == SUCCEEDED for steps in found for outcome in steps)
    print(f"{held} of {sum(map(len, found))} steps succeeded")
    print(effort_words(person.efforts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
