"""The page in a real browser, used as a person would: by mouse, finger and keys."""

import re
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from web_workplace import Workplace, workplace

from cliport_episodes.demonstration import Source
from cliport_episodes.errors import DiskFullError
from cliport_episodes.reader import read_episode
from cliport_episodes.writer import EpisodeWriter
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
        """Return the place of a picture's pixel on the screen."""
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
        self.page.mouse.click(*self.around(end, rotation, 50))

    def middle(self, selector: str, number: int = 0) -> tuple[float, float]:
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

    def pull(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag by mouse from one point of the screen to another."""
        self.page.mouse.move(*start)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=4)
        self.page.mouse.up()

    def around(self, end: str, rotation: int, pixels: float) -> tuple[float, float]:
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

    def leave(self) -> None:
        assert not self.faults
        self.page.context.close()


@pytest.fixture
def person(browser: "playwright.Browser", place: Workplace) -> Iterator[Person]:
    somebody = Person(browser, place)
    yield somebody
    somebody.leave()


def until(condition: Callable[[], object], what: str | Callable[[], str]) -> None:
    end = time.monotonic() + 5.0
    while not condition():
        assert time.monotonic() < end, what if isinstance(what, str) else what()
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
    assert not person.place.arm.goals[-1].action.pick.yaw < 1.5
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
    try:
        _use_fingers(person)
    finally:
        person.leave()


def _use_fingers(person: Person) -> None:
    place = person.place
    driver = person.page.context.new_cdp_session(person.page)

    def swipe(box: list[int]) -> None:
        pull(person.at(box[0], box[1]), person.at(box[2], box[3]))

    def pull(start: tuple[float, float], end: tuple[float, float]) -> None:
        def touch(kind: str, *where: tuple[float, float]) -> None:
            points = [{"x": x, "y": y} for x, y in where]
            driver.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

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
    person.page.evaluate("window.scrollTo(0, 0)")
    pull(person.middle(".end-drawing.place .handle"), person.around("place", 5, 60))
    person.words("place", "+50°")
    top, left, bottom, right = place.table.box_at(0.5, -0.02)
    start, end = person.at((top + bottom) / 2, (left + right) / 2), person.at(top + 20, right + 20)
    pull(start, end)
    until(lambda: person.drawn("place")["box"][0] > top + 5, "moved by finger")
    person.words("place", "points")  # the page has settled, or the tap would miss
    person.page.locator("#record-only").tap()
    until(lambda: len(steps(place)) == 1, lambda: f"recorded; the page says {person.page.text_content('#answer')}")
    assert place.arm.goals == []


def test_the_rings_knob_is_dragged_round(person: Person) -> None:
    person.drag(person.box)
    person.words("pick", "points")
    person.pull(person.middle(".end-drawing.pick .handle"), person.around("pick", 14, 90))
    until(lambda: person.drawn("pick")["rotation"] == 14, "turned by a drag")
    assert person.drawn("place") is None and person.drawn("pick")["box"] == pytest.approx(person.box, abs=1)


def test_only_clicks_near_the_ring_turn_it(person: Person) -> None:
    person.drag(person.box)
    person.words("pick", "points")
    for far in (110, 200):
        person.page.mouse.click(*person.around("pick", 9, far))
    person.page.mouse.click(*person.around("pick", 9, 4))  # in the box
    person.click_towards("pick", 3)
    until(lambda: person.drawn("pick")["rotation"] != 0, "turned")
    assert person.drawn("pick")["rotation"] == 3


def test_boxes_are_moved_and_resized(person: Person) -> None:
    person.draw_both()
    top, left, bottom, right = person.drawn("pick")["box"]
    scale = person.at(0, 100)[0] / 100 - person.at(0, 0)[0] / 100  # pixels of the screen in one of the picture
    x, y = person.at((top + bottom) / 2, (left + right) / 2)
    person.pull((x, y), (x - 30 * scale, y + 10 * scale))
    moved = [top + 10, left - 30, bottom + 10, right - 30]
    until(lambda: person.drawn("pick")["box"] == pytest.approx(moved, abs=1), "moved")
    corner = person.middle(".end-drawing.pick .grip", 3)
    person.pull(corner, (corner[0] + 40 * scale, corner[1] + 6 * scale))
    resized = [*moved[:2], moved[2] + 6, moved[3] + 40]
    until(lambda: person.drawn("pick")["box"] == pytest.approx(resized, abs=1), "resized")
    x, y = person.at(resized[0], (resized[1] + resized[3]) / 2)
    person.pull((x, y), (x + 50, y - 12 * scale))
    resized[0] -= 12
    until(lambda: person.drawn("pick")["box"] == pytest.approx(resized, abs=1), "its upper side is moved")
    assert person.drawn("place")["box"] == pytest.approx(person.goal, abs=1)


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


@pytest.mark.parametrize("text", ["put it\u200b there", "\u200eput it there", "put " * 200])
def test_nothing_moves_under_another_instruction_than_the_one_that_is_typed(person: Person, text: str) -> None:
    person.draw_both()
    for button in ("#execute", "#record-only", "#ask"):
        person.page.fill("#instruction", text)
        person.click(button)
        person.page.locator("#answer[data-ok=false]", has_text="instruction").wait_for()
        person.sees("ready")
        assert person.page.input_value("#instruction") == text  # to be corrected
    assert person.place.arm.goals == [] and steps(person.place) == [] and person.place.policy.heard == []
    person.page.fill("#instruction", "put it there")
    person.click("#execute")
    until(lambda: steps(person.place), "executed")
    assert [step["instruction"] for step in steps(person.place)] == ["put it there"]
    assert person.place.arm.goals[0].instruction == "put it there"


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


def test_an_undone_step_is_brought_back_and_an_unsaved_one_saved_again(
    person: Person, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise DiskFullError(person.place.root, "no space is left", "Make room.")

    person.draw_both()
    with monkeypatch.context() as patch:
        patch.setattr(EpisodeWriter, "add_step", full)
        person.click("#execute")
        person.page.locator("#unsaved", has_text="moved the arm (succeeded: done) and is not saved").wait_for()
        person.sees("failed")
        assert person.page.locator("#execute").is_disabled() and steps(person.place) == []
    person.click("#save-again")
    person.page.locator("#unsaved").wait_for(state="hidden")
    assert [step["outcome"] for step in steps(person.place)] == ["succeeded"]
    person.click("#undo")
    person.page.locator("#steps li").wait_for(state="detached")
    person.click("#restore-step")
    person.page.locator("#steps li").wait_for()
    assert [step["outcome"] for step in steps(person.place)] == ["succeeded"]
    assert person.page.locator("#restore-step").is_hidden()


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


def test_a_trimmed_episode_shows_the_pictures_of_its_own_steps(person: Person) -> None:
    for _ in range(2):
        person.draw_both()
        person.click("#execute")
        person.sees("executing")
        person.sees("ready")
    person.click("#next-episode")
    until(lambda: not steps(person.place), "saved")
    (folder,) = episode_folders(person.place)
    person.click("#tab-episodes")
    person.click("#episode-table button")
    person.page.get_by_label("First step that stays").select_option("2")
    person.page.get_by_role("button", name="Trim").click()
    person.page.locator("#one-episode", has_text="Step 2 (1 of the 1 that stay)").wait_for()
    picture = person.page.locator("#one-episode img")
    assert (picture.get_attribute("src") or "").endswith("/1.jpg")
    until(lambda: picture.evaluate("e => e.naturalWidth") == 480, "the picture is there")
    person.page.fill("#relabel-text", "the second")
    person.page.get_by_role("button", name="This step").click()
    person.page.locator("#episode-table td", has_text="the second").wait_for()
    person.page.get_by_role("button", name="Keep all again").click()
    person.page.locator("#one-episode", has_text="of 2").wait_for()
    assert [step.record.instruction for step in read_episode(folder).steps][1] == "the second"
    EpisodeWriter.resume(folder).close()  # no trim is left


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


def test_the_printed_link_works_from_a_chat(browser: "playwright.Browser", tmp_path: Path) -> None:
    token = "a-long-enough-token"
    with workplace(tmp_path, token=token, host="0.0.0.0") as place:
        page = browser.new_context().new_page()
        links = f"<a id=first href='{place.url}/?token={token}'>demo</a> <a id=later href='{place.url}/'>again</a>"
        page.route("http://chat.example/**", lambda route: route.fulfill(body=links, content_type="text/html"))
        for link in ("#first", "#later"):
            page.goto("http://chat.example/")
            page.click(link)
            page.locator("#state[data-state=ready]").wait_for(timeout=10_000)
            assert page.url == f"{place.url}/"  # the token does not stay in the address
        page.context.close()


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
