"""Somebody who teaches at the page: looks at the picture, draws boxes, clicks rotations. Knows nothing of ROS.

    python tests/page_person.py --episodes 10 --out out/teaching

starts the simulator's graph and `demo_tool app`, records that many demonstrations of two steps in Chromium, with a
reload in the midst of one and a killed server in the midst of another, and says what the bags hold, which it reads with
the `rosbags` library alone.
"""

from __future__ import annotations

import argparse
import base64
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from playwright.sync_api import Browser, Page, expect, sync_playwright
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from cliport_benchmark.errors import BenchmarkError
from cliport_benchmark.graph_client import GraphClient
from cliport_benchmark.graph_process import GraphProcess

TASK, SENTENCE = "put-blocks-in-bowls-seen-colors", "put the red blocks in a green bowl"
COLORS = {"red": (0, 135), "green": (56, 100)}  # OpenCV's hue and least saturation of the task's colours
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
BROWSER_ARGUMENTS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
SUCCEEDED = 0
DATA_SET = "by-hand"


@dataclass(frozen=True)
class Blob:
    """Something of one colour. centre: (col, row); half: half its sides [pixels]; angle: of a side, in the picture."""

    centre: tuple[float, float]
    half: tuple[float, float]
    angle: float


def find(picture: NDArray[np.uint8], color: str, least: int = 150) -> list[Blob]:
    """What has a colour in an RGB picture (H, W, 3), from left to right."""
    hsv = cv2.cvtColor(picture, cv2.COLOR_RGB2HSV).astype(int)
    hue, saturation = COLORS[color]
    away = np.abs((hsv[..., 0] - hue + 90) % 180 - 90)
    mask = ((away <= 6) & (hsv[..., 1] > saturation) & (hsv[..., 2] > 60)).astype(np.uint8)
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    blobs = []
    for contour in contours:
        if cv2.contourArea(contour) >= least:
            left, top, width, height = cv2.boundingRect(contour)
            angle = math.radians(cv2.minAreaRect(contour)[2])
            blobs.append(Blob((left + width / 2, top + height / 2), (width / 2, height / 2), angle))
    return sorted(blobs, key=lambda blob: blob.centre)


def inside(inner: Blob, outer: Blob) -> bool:
    """Whether one lies within another."""
    return all(abs(a - b) < half for a, b, half in zip(inner.centre, outer.centre, outer.half, strict=True))


class Person:
    """One at a page that is open in a browser."""

    def __init__(self, browser: Browser, address: str, album: Path | None = None) -> None:
        """album: a folder for a picture of the page in each of its main states."""
        self.album = album
        self.page: Page = browser.new_context(viewport={"width": 1280, "height": 900}).new_page()
        self.page.set_default_timeout(20_000)
        self.faults: list[str] = []
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.goto(address)

    def open_data_set(self, name: str) -> None:
        self.page.locator("#data-set").fill(name)
        self.page.locator("#data-set-card button").click()
        expect(self.page.locator("#where")).to_contain_text(name)

    def say(self, sentence: str) -> None:
        field = self.page.locator("#instruction")
        field.fill(sentence)
        field.press("Enter")

    def sees(self, state: str, timeout: float = 60.0) -> None:
        """Wait until the page says that the arm is in a state."""
        self.page.locator(f"#state[data-state={state}]").wait_for(timeout=1000 * timeout)

    def picture(self) -> NDArray[np.uint8]:
        """What the live view shows: (H, W, 3) RGB."""
        url = self.page.evaluate("document.getElementById('live').toDataURL('image/png')")
        coded = np.frombuffer(base64.b64decode(url.split(",")[1]), np.uint8)
        return np.ascontiguousarray(cv2.imdecode(coded, cv2.IMREAD_COLOR)[..., ::-1])

    def steps(self) -> int:
        return self.page.locator("#steps li").count()

    def pick_and_place(self) -> None:
        """One step: a red thing that is in no bowl into a green one that is empty."""
        picture = self.picture()
        blocks, bowls = find(picture, "red"), find(picture, "green", least=800)
        loose = [block for block in blocks if not any(inside(block, bowl) for bowl in bowls)]
        empty = [bowl for bowl in bowls if not any(inside(block, bowl) for block in blocks)]
        before = self.steps()
        self.draw(loose[0], picture.shape, 4)
        self._end("pick")
        self.draw(empty[0], picture.shape, 0)
        self._end("place")
        for turn in (0.0, math.pi / 2):  # along either side of the block
            self.turn(loose[0], picture.shape, loose[0].angle + turn)
            self.page.locator("#preview").click()
            verdict = self.page.locator("#plan")
            verdict.wait_for()
            if "✓" in (verdict.text_content() or ""):
                break
        self.remember("previewed")
        self.page.locator("#execute").click()
        if self.album:
            self.page.locator("#progress:not([hidden])").wait_for()
            time.sleep(2.0)
            self.remember("executing")
        expect(self.page.locator("#steps li")).to_have_count(before + 1, timeout=120_000)
        self.sees("ready")

    def draw(self, blob: Blob, shape: tuple[int, ...], margin: float) -> None:
        """A box around something."""
        (col, row), (wide, high) = blob.centre, blob.half
        self.page.mouse.move(*self._at(col - wide - margin, row - high - margin, shape))
        self.page.mouse.down()
        self.page.mouse.move(*self._at(col + wide + margin, row + high + margin, shape), steps=4)
        self.page.mouse.up()

    def turn(self, blob: Blob, shape: tuple[int, ...], angle: float) -> None:
        """Choose the pick and click beside its box, in a direction of the picture."""
        self.page.locator(".end.pick .end-name").click()
        x, y = self._at(*blob.centre, shape)
        self.page.mouse.click(x + 60 * math.cos(angle), y + 60 * math.sin(angle))

    def end_episode(self, success: bool) -> None:
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
        if self.album and not (self.album / f"page_{state}.jpg").exists():
            self.album.mkdir(parents=True, exist_ok=True)
            self.page.screenshot(path=self.album / f"page_{state}.jpg", type="jpeg", quality=80)

    def _end(self, end: str) -> None:
        expect(self.page.locator(f".end.{end} .end-words")).to_contain_text("points")

    def _at(self, col: float, row: float, shape: tuple[int, ...]) -> tuple[float, float]:
        """Where a pixel of the picture is on the screen."""
        area = self.page.locator("#overlay").bounding_box()
        assert area is not None
        return area["x"] + col * area["width"] / shape[1], area["y"] + row * area["height"] / shape[0]


class App:
    """`ros2 run demo_tool app` as a process."""

    def __init__(self, root: Path, domain: int, port: int = 0) -> None:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        command = [sys.executable, "-m", "demo_tool.app", "--port", str(port), "--data-sets", str(root)]
        self.process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        found = re.search(r"http://\S+", line)
        if not found:
            raise BenchmarkError(f"the page did not start: {line}")
        self.address = found[0]

    @property
    def port(self) -> int:
        return int(re.findall(r":(\d+)", self.address)[0])

    def end(self, number: int = signal.SIGINT) -> int:
        self.process.send_signal(number)
        return self.process.wait(20)


@contextmanager
def workplace(root: Path, domain: int, speed: float) -> Iterator[tuple[GraphClient, App, Browser]]:
    """The simulator's graph, the app and a browser."""
    arguments = {"task": TASK, "split": "test", "seed": "1", "real_time_factor": str(speed), "require_approval": "true"}
    with (
        GraphProcess("sim.launch.yaml", arguments, root / "graph.log", {"ROS_DOMAIN_ID": str(domain)}) as graph,
        GraphClient(domain_id=domain) as client,
    ):
        client.wait_ready(120.0, lambda: graph.alive)
        app = App(root / "sets", domain)
        try:
            with sync_playwright() as driver:
                browser = driver.chromium.launch(executable_path=CHROMIUM, args=list(BROWSER_ARGUMENTS))
                yield client, app, browser
                browser.close()
        finally:
            if app.process.poll() is None:
                app.end()


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


def killed_and_restarted(app: App, root: Path, domain: int) -> App:
    """Another server in the place of one that had no time to end."""
    app.end(signal.SIGKILL)
    return App(root / "sets", domain, app.port)


def go_on(person: Person) -> None:
    """What somebody does whose page has lost its server: load it again, open the same data set."""
    person.page.reload()
    person.sees("ready")
    person.open_data_set(DATA_SET)
    person.say(SENTENCE)


def outcomes(data_set: Path) -> list[list[int]]:
    """What each episode's steps came to, read with the `rosbags` library and the definitions in the bags."""
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


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--seed", type=int, default=3000)
    parser.add_argument("--speed", type=float, default=2.0, help="simulated seconds per second")
    parser.add_argument("--out", type=Path, default=Path("out/teaching"))
    parser.add_argument("--album", type=Path, help="folder for pictures of the page's main states")
    options = parser.parse_args()
    domain, seed, started = int(os.environ.get("ROS_DOMAIN_ID", "61")), options.seed, time.monotonic()
    with workplace(options.out, domain, options.speed) as (client, app, browser):
        person = Person(browser, app.address, options.album)
        person.sees("ready")
        person.remember("begin")
        person.open_data_set(DATA_SET)
        for number in range(options.episodes):
            seed = lay_out(person, client, seed)
            person.say(SENTENCE)
            person.pick_and_place()
            if number == 2:
                person.page.reload()
            if number == 4:
                app = killed_and_restarted(app, options.out, domain)
                go_on(person)
            expect(person.page.locator("#steps li")).to_have_count(1)
            person.pick_and_place()
            score = client.score()
            person.end_episode(score > 0.99)
            print(f"episode {number + 1}: score {score:.2f}, {time.monotonic() - started:.0f} s", flush=True)
            if number == 0 and options.album:
                person.look_around()
        assert not person.faults, person.faults
        app.end()
    found = outcomes(options.out / "sets" / DATA_SET)
    print(f"{len(found)} episodes of {Counter(len(steps) for steps in found)} steps; outcomes {found}")
    held = sum(outcome == SUCCEEDED for steps in found for outcome in steps)
    print(f"{held} of {sum(map(len, found))} steps succeeded")
    return 0


if __name__ == "__main__":
    sys.exit(main())
