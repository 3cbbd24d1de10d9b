"""The page in a real browser, where it asks a person: a plan's approval, and the way back to the ready pose."""

import pytest
from browser_user import CHROMIUM, BrowserUser
from web_workplace import PATIENCE, Workplace
from workplace_user import Person, steps, until

from demo_tool.station_config import StationConfig

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
playwright = pytest.importorskip("playwright.sync_api", reason="no Chromium's driver (playwright) on this machine")

PLAN = "1a2b3c4d"
HOME = StationConfig().home
AWAY = {**HOME, "panda_joint4": -1.5}


@pytest.mark.parametrize("by", ["button", "keys", "stop"])
def test_a_plan_that_waits_is_answered(person: Person, by: str) -> None:
    person.place.arm.waiting_plan = PLAN
    person.draw_both()
    assert person.page.locator("#approval").is_hidden()
    person.click("#execute")
    person.sees("waiting_for_approval")
    person.page.locator("#approval", has_text=f"Plan {PLAN} waits for your approval").wait_for()
    if by == "stop":
        person.press("Space")
        person.sees("stopped")
        person.page.locator("#approval").wait_for(state="hidden")
        assert steps(person.place) == []
        return
    if by == "keys":
        person.page.focus("#instruction")
        person.press("Control+Enter")
    else:
        person.click("#approve")
    until(lambda: steps(person.place), "executed")
    assert steps(person.place)[0]["outcome"] == "succeeded"


def test_a_page_that_watches_sees_the_plan_and_cannot_approve(browser: "playwright.Browser", person: Person) -> None:
    person.place.arm.waiting_plan = PLAN
    person.draw_both()
    person.click("#execute")
    watcher = BrowserUser(browser, person.place.url, PATIENCE)
    try:
        watcher.sees("waiting_for_approval")
        watcher.page.locator("#approval", has_text="Only the page that holds the arm can approve it").wait_for()
        assert watcher.page.locator("#approve").is_disabled()
        watcher.page.keyboard.press("Control+Enter")
        assert person.place.station.view(None)["approval"] == {"plan": PLAN, "asked": False, "words": ""}
        person.click("#approve")
        until(lambda: steps(person.place), "executed")
    finally:
        watcher.leave()


def test_an_arm_that_stands_away_is_taken_back(person: Person) -> None:
    place = person.place
    strand(place)
    person.page.locator("#away", has_text="stands away from its ready pose").wait_for()
    place.arm.recovery_refusal = "another goal is being executed"
    person.click("#recover")
    person.page.locator("#state-words", has_text="did not recover: another goal is being executed").wait_for()
    place.arm.recovery_refusal, place.arm.pace = "", 0.1
    person.click("#recover")
    person.sees("recovering")
    assert person.page.locator("#recover").is_disabled() and person.page.locator("#execute").is_disabled()
    person.press("Space")
    person.sees("stopped")
    until(lambda: "still" not in place.station.view(None)["words"], "it has ended")
    strand(place)
    assert person.page.locator("#recover").is_disabled()
    person.click("#resume")
    person.click("#recover")
    person.sees("ready")
    person.page.locator("#away").wait_for(state="hidden")
    assert place.arm.recoveries == 2 and place.arm.stops


def test_what_is_still_held_is_let_go(person: Person) -> None:
    place = person.place
    assert not person.page.locator("#held").is_visible()
    place.arm.held, place.arm.opening_refusal = 0.04, "another goal is being executed"
    person.page.locator("#held", has_text="still holds something 40 mm wide").wait_for()
    person.press("Space")
    person.sees("stopped")
    assert person.page.locator("#open-hand").is_disabled()
    person.click("#resume")
    person.click("#open-hand")
    person.page.locator("#state-words", has_text="did not open: another goal is being executed").wait_for()
    place.arm.opening_refusal = ""
    person.click("#open-hand")
    person.sees("ready")
    person.page.locator("#held").wait_for(state="hidden")
    assert place.arm.openings == 2


def test_whether_the_arm_can_do_it_is_shown_beside_the_place(person: Person) -> None:
    page = person.page
    person.drag(person.box)
    person.words("pick", "points")
    assert page.locator("#overlay .reach").count() == 0
    person.drag(person.goal)
    page.locator("#overlay .reach.good").wait_for()
    page.locator("#plan", has_text="Reachable").wait_for()
    assert not person.place.arm.goals, "nothing moves"
    asked = len(person.place.arm.checks)
    person.page.focus(".end-drawing.place")
    person.press("ArrowRight")
    until(lambda: len(person.place.arm.checks) > asked, "asked anew")
    page.locator("#overlay .reach.good").wait_for()
    person.click("#clear")
    page.locator("#overlay .reach").wait_for(state="detached")


def test_the_policy_draws_each_step_and_one_key_accepts(person: Person) -> None:
    page, place = person.page, person.place
    page.locator("#prefill").check()
    page.locator(".end.pick .end-words", has_text="the policy's position").wait_for()
    page.locator("#overlay .reach.good").wait_for()
    page.locator("#instruction").fill("put it on the blue one")
    person.press("Escape")
    person.press("e")
    until(lambda: steps(place), "executed")
    assert (steps(place)[0]["instruction"], steps(place)[0]["source"]) == ("put it on the blue one", "proposed")
    until(lambda: "put it on the blue one" in place.policy.heard, "asked about the next step")
    until(lambda: place.station.view(None)["draft"]["source"] == "proposed", "and its proposal is drawn")
    page.reload()
    assert page.locator("#prefill").is_checked(), "it is remembered"
    person.click("#clear")
    person.draw_both()
    until(lambda: place.station.view(None)["draft"]["source"] == "clicked", "own boxes stay")
    page.locator("#prefill").uncheck()


def strand(place: Workplace) -> None:
    """Let the arm stand away from its ready pose until it recovers."""
    place.arm.on_recovered = lambda: place.station.on_joints(HOME)
    place.station.on_joints(AWAY)
