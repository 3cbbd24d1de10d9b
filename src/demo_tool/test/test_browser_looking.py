"""The page in a real browser: how large the picture is, and a closer look at it."""

import pytest
from browser_user import CHROMIUM
from web_workplace import Workplace
from workplace_user import Person, until

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
playwright = pytest.importorskip("playwright.sync_api", reason="no Chromium's driver (playwright) on this machine")

TABLET = {"viewport": {"width": 768, "height": 1024}, "has_touch": True}


def width(person: Person, selector: str) -> float:
    area = person.page.locator(selector).bounding_box()
    assert area is not None
    return float(area["width"])


def test_on_a_tablet_the_picture_is_as_wide_as_the_page(browser: "playwright.Browser", place: Workplace) -> None:
    place.begin_anew("tablet")
    person = Person(browser, place, **TABLET)
    try:
        assert width(person, "#stage") > 0.95 * 768
        stage = person.page.locator("#stage").bounding_box()
        assert stage is not None and stage["width"] / stage["height"] == pytest.approx(
            place.table.width / place.table.height, rel=0.02
        )
        assert person.page.evaluate("document.documentElement.scrollWidth") <= 768
        person.draw_both()
        person.page.set_viewport_size({"width": 880, "height": 500})
        stage = person.page.locator("#stage").bounding_box()
        assert stage is not None and stage["height"] < 500
        assert stage["width"] / stage["height"] == pytest.approx(place.table.width / place.table.height, rel=0.02)
    finally:
        person.leave()


def test_the_wheel_looks_closer_where_the_pointer_is(person: Person) -> None:
    page, block = person.page, person.box
    whole = width(person, "#overlay")
    middle = person.at((block[0] + block[2]) / 2, (block[1] + block[3]) / 2)
    page.mouse.move(*middle)
    for _ in range(4):
        page.mouse.wheel(0, -100)
    until(lambda: width(person, "#overlay") > 2.3 * whole, "it is larger")
    assert width(person, "#stage") == pytest.approx(whole, abs=1), "its place is not"
    after = person.at((block[0] + block[2]) / 2, (block[1] + block[3]) / 2)
    assert after == pytest.approx(middle, abs=2)
    person.drag(block)
    person.words("pick", "points")
    drawn = person.place.station.view(None)["draft"]["pick"]["box"]
    assert drawn == pytest.approx(block, abs=1)
    person.click("#zoom-out")
    until(lambda: width(person, "#overlay") == pytest.approx(whole, abs=1), "the whole picture is back")
    assert page.locator("#zoom-out").is_hidden()
    person.click("#zoom-in")
    until(lambda: width(person, "#overlay") == pytest.approx(2 * whole, abs=2), "a button does it too")


def test_two_fingers_look_closer_and_draw_nothing(browser: "playwright.Browser", place: Workplace) -> None:
    place.begin_anew("pinch")
    person = Person(browser, place, **TABLET)
    try:
        whole = width(person, "#overlay")
        stage = person.page.locator("#stage").bounding_box()
        assert stage is not None
        x, y = stage["x"] + stage["width"] / 2, stage["y"] + stage["height"] / 2
        touch = person.page.context.new_cdp_session(person.page)

        def fingers(kind: str, *offsets: float) -> None:
            points = [{"x": x + offset, "y": y, "id": number} for number, offset in enumerate(offsets)]
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

        fingers("touchStart", -40)
        fingers("touchStart", -40, 40)
        for half in (60, 80, 100, 120):
            fingers("touchMove", -half, half)
        fingers("touchEnd")
        until(lambda: width(person, "#overlay") > 2.5 * whole, "it is larger")
        assert place.station.view(None)["draft"]["pick"] is None
    finally:
        person.leave()
