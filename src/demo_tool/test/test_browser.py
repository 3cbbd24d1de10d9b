"""The page in a real browser, used as a person would: by mouse, finger and keys."""

import pytest
from browser_user import CHROMIUM
from web_workplace import Workplace
from workplace_user import Person, episode_folders, steps, until

from cliport_episodes.demonstration import Source
from cliport_episodes.reader import read_episode

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
playwright = pytest.importorskip("playwright.sync_api", reason="no Chromium's driver (playwright) on this machine")


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
    until(lambda: person.place.arm.goals, "a plan is asked for")  # "Reachable" is said before, of what is drawn
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

    def tap(name: str) -> None:
        button = person.page.locator(name)
        button.scroll_into_view_if_needed()
        person.page.wait_for_timeout(500)  # Chromium makes no click of a touch while the page still scrolls
        button.tap()

    swipe(person.box)
    person.words("pick", "points")
    swipe(person.goal)
    person.words("place", "points")
    tap(".end.place .turn[data-turn='1']")
    person.words("place", "+10°")
    person.page.evaluate("window.scrollTo(0, 0)")
    pull(person.middle(".end-drawing.place .handle"), person.around("place", 5, 60))
    person.words("place", "+50°")
    top, left, bottom, right = place.table.box_at(0.5, -0.02)
    start, end = person.at((top + bottom) / 2, (left + right) / 2), person.at(top + 20, right + 20)
    pull(start, end)
    until(lambda: person.drawn("place")["box"][0] > top + 5, "moved by finger")
    person.words("place", "points")  # the page has settled, or the tap would miss
    tap("#record-only")
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


def test_two_clicks_draw_a_pick_and_a_place(person: Person) -> None:
    boxes = [person.place.table.box_around(block) for block in person.place.table.blocks[:2]]
    for box in boxes:
        person.page.mouse.click(*person.at((box[0] + box[2]) / 2, (box[1] + box[3]) / 2))
        person.words("pick" if box is boxes[0] else "place", "points")
    before = [person.drawn(end)["box"] for end in ("pick", "place")]
    for drawn, box in zip(before, boxes, strict=True):
        assert drawn == pytest.approx(box, abs=20)
    person.page.mouse.click(*person.at(20, 20))
    person.click_towards("place", 5)
    until(lambda: person.drawn("place")["rotation"] == 5, "turned")
    assert [person.drawn(end)["box"] for end in ("pick", "place")] == before, "a third click draws nothing anew"


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


def test_letters_press_the_buttons_that_name_them(person: Person) -> None:
    person.draw_both()
    person.page.focus("#instruction")
    person.press("E", "r")
    person.page.fill("#instruction", "put it there")
    assert steps(person.place) == [] and not person.place.arm.goals, "letters are text in a text field"
    person.page.evaluate("document.activeElement.blur()")
    person.press("Control+e")
    person.press("e")
    until(lambda: len(steps(person.place)) == 1, "executed")
    person.sees("ready")
    person.press("e")  # nothing is drawn: the button takes no click
    person.press("s")
    until(lambda: person.place.station.view(None)["verdict"] is True, "marked")
    person.page.locator("#undo:not([disabled])").wait_for()
    person.press("u")
    until(lambda: steps(person.place) == [], "undone")
    assert len(person.place.arm.goals) == 1
    person.page.locator("#ask:not([disabled])").wait_for()
    person.press("a")
    until(lambda: person.place.station.view(None)["policy"]["proposal"], "proposed")
    person.page.locator("#correct:not([disabled])").wait_for()
    person.press("c")
    until(lambda: person.place.station.view(None)["draft"]["pick"], "drawn")
    person.page.locator("#record-only:not([disabled])").wait_for()
    person.press("R")
    until(lambda: len(steps(person.place)) == 1, "recorded")
    person.page.locator("#recorded", has_text="0 of 50 episodes").wait_for()
    person.page.locator("#next-episode:not([disabled])").wait_for()
    person.press("n")
    person.page.locator("#recorded", has_text="1 of 50 episodes").wait_for()
    assert person.page.locator("#covered").is_hidden()
    person.click("#show-covered")
    person.page.locator("#covered circle").first.wait_for()
    assert person.page.locator("#covered circle").count() == 2
    named = person.page.eval_on_selector_all(
        "#record [aria-keyshortcuts]", "all => all.map((one) => one.ariaKeyShortcuts)"
    )
    told = person.page.locator(".keys").text_content() or ""
    assert len(named) == len(set(named)) == 9 and all(
        f"{letter}, " in told or f", {letter}" in told for letter in named
    )


def test_a_box_to_tick_takes_neither_the_space_bar_nor_the_letters(person: Person) -> None:
    person.draw_both()
    person.page.focus("#prefill")
    person.press("r")
    until(lambda: steps(person.place), "the letter records the step")
    person.press("Space")
    person.sees("stopped")
    assert not person.page.is_checked("#prefill")
    person.press("Enter")
    assert person.page.is_checked("#prefill")
    person.press("Enter")
    assert not person.page.is_checked("#prefill")


def test_the_space_bar_stops_from_a_button_and_types_in_a_text(person: Person) -> None:
    person.page.focus("#instruction")
    person.page.fill("#instruction", "put")
    person.press("End", "Space", "x")
    assert person.page.input_value("#instruction") == "put x"
    person.press("Escape")
    assert person.place.arm.stops == 0
    person.page.focus("#clear")
    person.draw_both()
    person.place.arm.pace = 1.0
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
