"""The page in a real browser, used as a person would: by mouse, finger and keys."""

import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from web_workplace import Workplace, workplace

from cliport_episodes.demonstration import Source
from cliport_episodes.reader import read_episode
from demo_tool.web import arm_holder

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
playwright = pytest.importorskip("playwright.sync_api", reason="no Chromium's driver (playwright) on this machine")
ARGUMENTS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)
HOSTILE = "<img src=x onerror=document.title='owned'><script>document.title='owned'</script>"


@pytest.fixture(scope="module")
def browser() -> Iterator["playwright.Browser"]:
    with playwright.sync_playwright() as driver:
        started = driver.chromium.launch(executable_path=CHROMIUM, args=list(ARGUMENTS))
        yield started
        started.close()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workplace]:
    with workplace(tmp_path_factory.mktemp("sets"), pace=0.03) as made:
        yield made


@pytest.fixture
def place(served: Workplace, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Workplace:
    monkeypatch.setattr(arm_holder, "GONE_AFTER_S", 0.0)  # the page of the test before is gone
    served.begin_anew(re.sub(r"\W", "-", request.node.name))
    return served


def episode_folders(place: Workplace) -> list[Path]:
    data_set = place.station.view(None)["data_set"]
    return list((place.root / data_set / "episodes").iterdir())


class Person:
    """Somebody at a page."""

    def __init__(self, browser: "playwright.Browser", place: Workplace, **device: object) -> None:
        self.place = place
        self.faults: list[str] = []
        self.page = browser.new_context(**{"viewport": {"width": 1024, "height": 768}, **device}).new_page()
        self.page.set_default_timeout(5000)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.goto(place.url)
        self.sees("ready")

    def sees(self, state: str) -> None:
        """Wait until the page says this state."""
        self.page.locator(f"#state[data-state={state}]").wait_for()

    def at(self, row: float, col: float) -> tuple[float, float]:
        """Where a pixel of the picture is on the screen."""
        area = self.page.locator("#overlay").bounding_box()
        assert area is not None
        return area["x"] + col * area["width"] / 480, area["y"] + row * area["height"] / 270

    def drag(self, box: list[int]) -> None:
        top, left, bottom, right = box
        self.page.mouse.move(*self.at(top, left))
        self.page.mouse.down()
        self.page.mouse.move(*self.at(bottom, right), steps=3)
        self.page.mouse.up()

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

    def words(self, end: str, text: str) -> None:
        """Wait until something is said of the pick or the place."""
        self.page.locator(f".end.{end} .end-words", has_text=text).wait_for()

    def click_towards(self, end: str, rotation: int) -> None:
        """Click beside a box, in the direction of a rotation."""
        shown = self.drawn(end)
        row, col = shown["grasp"]["centroid_pixel"]
        x, y = self.at(row, col)
        down, right = shown["directions"][rotation]
        self.page.mouse.click(x + 50 * right, y + 50 * down)

    def drawn(self, end: str) -> dict:
        return self.place.station.view(None)["draft"][end]

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)

    def click(self, selector: str) -> None:
        self.page.locator(selector).click()

    def leave(self) -> None:
        assert not self.faults
        self.page.context.close()


@pytest.fixture
def person(browser: "playwright.Browser", place: Workplace) -> Iterator[Person]:
    somebody = Person(browser, place)
    yield somebody
    somebody.leave()


def until(condition: object, what: str) -> None:
    end = time.monotonic() + 5.0
    while not condition():  # type: ignore[operator]
        assert time.monotonic() < end, what
        time.sleep(0.02)


def steps(place: Workplace) -> list[dict]:
    episode = place.station.view(None)["episode"]
    return episode["steps"] if episode else []


def test_by_mouse_from_box_to_saved_episode(person: Person) -> None:
    person.drag(person.box)
    person.words("pick", "mm high")
    assert person.drawn("pick")["box"] == pytest.approx(person.box, abs=1)
    person.click_towards("pick", 9)
    until(lambda: person.drawn("pick")["rotation"] == 9, "turned by a click")
    person.drag(person.goal)
    person.words("place", "points")
    assert person.drawn("place")["rotation"] == 9  # the object is not turned unless that is asked for
    person.click_towards("place", 12)
    person.words("place", "+30°")
    person.page.locator(".end-drawing.pick .finger").first.wait_for(state="attached")
    person.click("#preview")
    person.page.locator("#plan", has_text="Reachable").wait_for()
    assert not person.place.arm.goals[-1].pick.yaw < 1.5
    person.click("#execute")
    person.sees("executing")
    person.sees("ready")
    assert [step["outcome"] for step in steps(person.place)] == ["succeeded"]
    person.click("#success")
    person.page.locator("#success[aria-pressed=true]").wait_for()
    person.click("#next-episode")
    until(lambda: not steps(person.place), "the episode is saved")
    (episode,) = map(read_episode, episode_folders(person.place))
    assert episode.success is True and episode.steps[0].record.source is Source.CLICKED
    assert (episode.steps[0].record.pick_rotation, episode.steps[0].record.place_rotation) == (9, 12)


def test_by_finger(browser: "playwright.Browser", place: Workplace) -> None:
    phone = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True, "device_scale_factor": 2}
    person = Person(browser, place, **phone)
    driver = person.page.context.new_cdp_session(person.page)

    def swipe(box: list[int]) -> None:
        def touch(kind: str, *where: tuple[float, float]) -> None:
            points = [{"x": x, "y": y} for x, y in where]
            driver.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

        start, end = person.at(box[0], box[1]), person.at(box[2], box[3])
        touch("touchStart", start)
        touch("touchMove", ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2))
        touch("touchMove", end)
        touch("touchEnd")

    swipe(person.box)
    person.words("pick", "points")
    swipe(person.goal)
    person.words("place", "points")
    person.page.locator(".end.place .turn[data-turn='1']").tap()
    person.words("place", "+10°")
    person.page.locator("#record-only").tap()
    until(lambda: len(steps(place)) == 1, "recorded")
    assert place.arm.goals == []
    person.leave()


def test_by_keys_alone(person: Person) -> None:
    focused = "`${document.activeElement.getAttribute('class')} #${document.activeElement.id}`"

    def tab_to(name: str) -> None:
        for _ in range(40):
            if name in person.page.evaluate(focused):
                return
            person.press("Tab")
        raise AssertionError(f"no way to {name}")

    def draw(box: list[int]) -> None:
        top, left, bottom, right = (int(v) for v in person.page.locator(":focus .box.sketch").last.evaluate(
            "e => ['y', 'x', 'height', 'width'].map((name) => e.getAttribute(name))"))  # fmt: skip
        size = (bottom, right)
        sides = (("Arrow{}", top - box[0], left - box[1]),
                 ("Shift+Arrow{}", size[0] - (box[2] - box[0]), size[1] - (box[3] - box[1])))  # fmt: skip
        for key, up, back in sides:
            person.press(*[key.format("Up" if up > 0 else "Down")] * round(abs(up) / 2))
            person.press(*[key.format("Left" if back > 0 else "Right")] * round(abs(back) / 2))
        person.press("Enter")

    tab_to("end-drawing pick")
    draw(person.box)
    person.words("pick", "points")
    person.press("ArrowRight", "ArrowRight")
    until(lambda: person.drawn("pick")["rotation"] == 2, "turned by keys")
    person.press("Tab")
    draw(person.goal)
    person.words("place", "points")
    tab_to("#execute")
    person.press("Enter")
    until(lambda: len(steps(person.place)) == 1, "executed")
    assert steps(person.place)[0]["outcome"] == "succeeded"


def test_the_space_bar_stops_from_a_button_and_types_in_a_text(person: Person) -> None:
    person.page.focus("#instruction")
    person.page.fill("#instruction", "put")
    person.press("End", "Space", "x")
    assert person.page.input_value("#instruction") == "put x"
    person.press("Escape")
    assert person.place.arm.stops == 0
    person.page.focus("#clear")
    person.draw_both()
    person.place.arm.pace = 0.3
    person.click("#execute")
    person.sees("executing")
    person.press("Space")
    person.sees("stopped")
    assert person.place.arm.stops and len(person.place.arm.goals) == 1
    until(lambda: steps(person.place), "the step is recorded")
    assert steps(person.place)[-1]["outcome"] == "stopped on the way"
    person.click("#resume")
    stops = person.place.arm.stops
    person.page.focus("#instruction")
    person.press("Escape", "Escape")
    person.sees("stopped")
    assert person.place.arm.stops > stops
    person.click("#resume")
    person.page.locator("#stopped").wait_for(state="hidden")
    person.click("#stop")
    person.sees("stopped")


def test_a_reload_in_mid_episode_keeps_everything(person: Person) -> None:
    person.draw_both()
    person.click("#record-only")
    person.page.locator("#steps li").wait_for()
    person.drag(person.box)
    person.words("pick", "points")
    person.page.fill("#instruction", "and now the green one")
    person.press("Enter")
    until(lambda: person.place.station.view(None)["instruction"] == "and now the green one", "sent")
    person.page.reload()
    person.words("pick", "points")
    assert person.page.locator("#steps li").count() == 1
    assert person.page.input_value("#instruction") == "and now the green one"
    assert person.page.locator("#watching").is_hidden()


def test_a_server_that_comes_back_is_found_again(person: Person) -> None:
    person.drag(person.box)
    person.words("pick", "points")
    person.place.leave()
    person.page.locator("#lost").wait_for()
    assert person.page.locator("#execute").is_disabled()
    person.place.serve()
    person.page.locator("#lost").wait_for(state="hidden")
    person.words("pick", "points")
    person.drag(person.goal)
    person.words("place", "points")


def test_two_pages_one_holds_the_arm(browser: "playwright.Browser", place: Workplace, person: Person) -> None:
    other = Person(browser, place)
    other.page.locator("#watching", has_text="another page holds the arm").wait_for()
    assert other.page.locator("#execute").is_disabled() and other.page.locator("#instruction").is_disabled()
    person.drag(person.box)
    other.words("pick", "points")
    other.drag(other.goal)
    assert other.drawn("place") is None
    other.click("#stop")
    person.sees("stopped")
    person.click("#resume")
    person.click("#give-up")
    other.click("#take-over")
    other.page.locator("#watching").wait_for(state="hidden")
    person.page.locator("#watching").wait_for()
    other.leave()


def test_texts_from_outside_stay_texts(person: Person) -> None:
    person.page.fill("#instruction", HOSTILE)
    person.press("Enter")
    person.draw_both()
    person.click("#record-only")
    person.page.locator("#steps li", has_text="<script>").wait_for()
    person.click("#next-episode")
    until(lambda: not steps(person.place), "saved")
    (episode,) = (person.place.station.command("episodes", {}))["episodes"]
    person.page.reload()
    person.click("#tab-episodes")
    person.page.locator("#episode-table td", has_text="<script>").wait_for()
    person.click("#episode-table button")
    person.page.locator("#one-episode img[src^='/episode']").wait_for()
    assert person.page.input_value("#relabel-text") == HOSTILE == episode["instructions"][0]
    person.click("#count")
    person.page.locator("#statistics th", has_text="<script>").wait_for()
    assert person.page.locator("script").count() == 1 and "owned" not in person.page.title()
    assert person.page.locator("img[src='x']").count() == 0


def test_the_policys_proposal_is_corrected(person: Person) -> None:
    person.click("#ask")
    person.page.locator("#policy-words", has_text="It has a proposal, 83 % sure.").wait_for()
    person.click("#correct")
    person.words("pick", "the policy's position")
    person.click(".end.pick .turn[data-turn='-1']")
    until(lambda: person.place.station.view(None)["draft"]["source"] == "corrected", "corrected")
    person.click("#execute")
    person.page.locator("#steps li").wait_for()
    (folder,) = episode_folders(person.place)
    assert read_episode(folder).steps[0].record.source is Source.CORRECTED


def test_episodes_are_edited(person: Person) -> None:
    person.draw_both()
    person.click("#record-only")
    person.page.locator("#steps li").wait_for()
    person.click("#next-episode")
    until(lambda: not steps(person.place), "saved")
    person.click("#tab-episodes")
    person.click("#episode-table button")
    person.page.fill("#relabel-text", "stack the blocks")
    person.page.get_by_role("button", name="All steps").click()
    person.page.locator("#episode-table td", has_text="stack the blocks").wait_for()
    person.page.get_by_role("button", name="✗ Failure").last.click()
    person.page.locator("#episode-table td", has_text="failure").wait_for()
    person.page.get_by_role("button", name="Move to the trash").click()
    person.page.get_by_role("button", name="Restore").click()
    person.page.locator("#episode-table td", has_text="stack the blocks").wait_for()
    person.click("#episode-table button")
    person.page.get_by_role("button", name="Move to the trash").click()
    person.click("#empty-trash")
    assert person.place.station.command("trash", {})["trashed"]  # it asks first
    person.click("#empty-trash")
    until(lambda: not person.place.station.command("trash", {})["trashed"], "emptied")


def test_data_sets_are_split_and_merged(person: Person) -> None:
    for _ in range(2):
        person.draw_both()
        person.click("#record-only")
        person.page.locator("#steps li").wait_for()
        person.click("#next-episode")
        until(lambda: not steps(person.place), "saved")
    name = person.place.station.view(None)["data_set"]
    person.click("#tab-episodes")
    person.page.get_by_label("Per cent of part 1").fill("50")
    person.page.get_by_label("Per cent of part 2").fill("")
    person.click("#split button")
    person.page.locator("#episodes-answer", has_text="✗ Each part needs a name and a share").wait_for()
    person.page.get_by_label("Per cent of part 2").fill("50")
    person.click("#split button")
    person.page.locator("#episodes-answer", has_text=f"{name}_val: 1 episodes").wait_for()
    person.click("#split button")
    person.page.locator("#episodes-answer", has_text=f"✗ '{name}_train' exists").wait_for()
    person.page.select_option("#merge-other", f"{name}_train")
    person.click("#merge button")
    person.page.locator("#episodes-answer", has_text="0 of the 1 episodes").wait_for()


@pytest.mark.parametrize(("width", "height"), [(390, 844), (1024, 768)])
def test_nothing_is_wider_than_the_page(
    browser: "playwright.Browser", place: Workplace, width: int, height: int
) -> None:
    place.station.command("instruction", {"text": "x" * 300})
    person = Person(browser, place, viewport={"width": width, "height": height})
    for part in ("#tab-episodes", "#tab-record"):
        person.click(part)
        assert person.page.evaluate("document.documentElement.scrollWidth") <= width
    stop = person.page.locator("#stop").bounding_box()
    person.page.evaluate("window.scrollTo(0, document.body.scrollHeight)")
    assert stop is not None and stop == person.page.locator("#stop").bounding_box()
    person.leave()
