"""The page in a real browser: what it keeps, shows and edits."""

from pathlib import Path

import pytest
from browser_user import CHROMIUM
from web_workplace import PATIENCE, Workplace, workplace
from workplace_user import Person, episode_folders, steps, until

from cliport_episodes.demonstration import Source
from cliport_episodes.errors import DiskFullError
from cliport_episodes.reader import read_episode
from cliport_episodes.writer import EpisodeWriter
from demo_tool import motion_film

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")
playwright = pytest.importorskip("playwright.sync_api", reason="no Chromium's driver (playwright) on this machine")
HOSTILE = "<img src=x onerror=document.title='owned'><script>document.title='owned'</script>"


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
        person.end_episode()
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
            page.locator("#state[data-state=ready]").wait_for(timeout=1000 * PATIENCE)
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


def test_the_motion_of_a_step_is_shown_beside_its_picture(person: Person, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_film, "PERIOD", 0.05)
    person.draw_both()
    person.click("#execute")
    until(lambda: steps(person.place), "recorded")
    person.click("#success")
    person.click("#next-episode")
    person.click("#tab-episodes")
    person.page.locator("#episode-table tbody tr button").first.click()
    picture, slider = person.page.locator("#one-episode img"), person.page.locator(".motion input")
    assert "/motion/" not in (picture.get_attribute("src") or "")
    person.page.locator(".motion button", has_text="Motion").click()
    last = int(slider.get_attribute("max") or 0)
    assert last > 1
    person.page.locator(f"#one-episode img[src$='/motion/{last - 1}.jpg']").wait_for()
    person.page.locator(".motion button", has_text="▶").wait_for()
    assert picture.evaluate("image => image.naturalWidth") == 320
    slider.fill("1")
    person.page.locator("#one-episode img[src$='/motion/0.jpg']").wait_for()
    slider.fill("0")
    person.page.locator("#one-episode img[src$='/0.jpg']:not([src*='/motion/'])").wait_for()
    slider.focus()
    person.press("Space")
    person.sees("stopped")
