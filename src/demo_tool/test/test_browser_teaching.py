"""The page in a real browser, where a policy learns from what was recorded."""

import pytest
from browser_user import CHROMIUM
from workplace_user import Person, steps, until

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")

TRAINING = "[############------------] 100/200  locator 2.310  31.0 samples/s  4 min left"


def record_a_step(person: Person) -> None:
    person.draw_both()
    person.click("#record-only")
    until(lambda: steps(person.place), "recorded")


def test_a_policy_learns_and_is_used(person: Person) -> None:
    lessons = person.place.lessons
    record_a_step(person)
    person.click("#tab-episodes")
    assert person.page.locator("#teach").is_disabled(), "an episode is being recorded"
    person.click("#tab-record")
    person.click("#next-episode")
    person.click("#tab-episodes")
    person.page.locator("#lesson-minutes").fill("20")
    person.page.locator("#lesson-init").select_option("none")
    person.click("#teach")
    person.page.locator("#lesson[data-state=running]").wait_for()
    assert lessons.options == ["--init", "none", "--minutes", "20"]
    assert person.page.locator("#teach").is_disabled() and "it begins" in (
        person.page.locator("#lesson-words").text_content() or ""
    )
    assert person.page.locator("#lesson-share").get_attribute("value") is None, "how far it is is not known yet"
    lessons.on_line(TRAINING)
    person.page.locator("#lesson-share[value='0.5']").wait_for()
    person.page.locator("#lesson-words", has_text="4 min left").wait_for()
    person.click("#stop-teaching")
    until(lambda: lessons.stops == 1, "told to stop")
    report = {"learned": ["one"], "held_out": [], "policy": "learned/half"}
    lessons.on_end(130, {**report, "table": [], "steps_done": 100, "steps": 200})
    person.click("#use-learned")
    until(lambda: person.place.policy.loaded == ["learned/half"], "asked to load what a stopped lesson has")
    person.page.locator("#lesson-words", has_text="stopped after 100 of 200 steps").wait_for()
    person.page.locator("#teach", has_text="Go on").click()
    person.page.locator("#lesson[data-state=running]").wait_for()
    table = [["pick and place within 20 mm", "", "<b>33 %</b>"], ["pick, median", "200 mm", "1 mm"]]
    lessons.on_end(0, {"learned": ["one"], "held_out": [], "table": table, "policy": "learned/mine"})
    person.page.locator("#lesson[data-state=learned]").wait_for()
    assert person.page.locator("#lesson-table td").all_text_contents() == ["–", "<b>33 %</b>", "200 mm", "1 mm"]
    person.click("#use-learned")
    until(lambda: person.place.policy.loaded[1:] == ["learned/mine"], "asked to load it")


def test_what_is_not_held_out_shows_no_table(person: Person) -> None:
    lessons = person.place.lessons
    record_a_step(person)
    person.click("#next-episode")
    person.click("#tab-episodes")
    person.click("#teach")
    person.page.locator("#lesson[data-state=running]").wait_for()
    rows = [["pick, median", "", ""]]
    lessons.on_end(0, {"learned": ["one"], "held_out": [], "table": rows, "policy": "learned/mine"})
    person.page.locator("#use-learned").wait_for()
    assert person.page.locator("#lesson-table").is_hidden()
