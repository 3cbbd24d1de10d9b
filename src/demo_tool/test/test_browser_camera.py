"""The page in a real browser, where the camera is calibrated."""

import pytest
from browser_user import CHROMIUM
from workplace_user import Person, until

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine")

MEAN_OF_PICTURE = """() => {
  const canvas = document.querySelector('#camera-live');
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  return pixels.reduce((sum, value) => sum + value, 0) / pixels.length;
}"""

NOTE_ANNOUNCEMENTS = """() => {
  const place = document.querySelector('#state-words');
  window.announced = [];
  new MutationObserver(() => window.announced.push(place.textContent)).observe(
    place, { childList: true, characterData: true, subtree: true });
}"""


def test_a_silent_camera_is_announced_and_not_counted_aloud(person: Person) -> None:
    page = person.page
    page.evaluate(NOTE_ANNOUNCEMENTS)
    person.place.dark.set()
    try:
        person.sees("stale")
        for seconds in (2, 3, 4, 5):
            page.locator("#state-age", has_text=f"{seconds} s old").wait_for()
    finally:
        person.place.dark.clear()
    person.sees("ready")
    assert page.locator("#state-age").text_content() == ""
    assert page.locator("#state-age[aria-hidden=true]").count() == 1
    announced = page.evaluate("() => window.announced")
    assert len(announced) == len(set(announced)) <= 3, announced
    assert not any(" s old" in words or " for " in words for words in announced)


def test_enter_ticks_that_the_hand_moves_and_does_not_begin(person: Person) -> None:
    person.click("#tab-camera")
    person.page.focus("#calibration-move")
    person.press("Enter")
    assert person.page.is_checked("#calibration-move")
    person.press("Space")
    person.sees("stopped")
    assert person.page.is_checked("#calibration-move")
    assert not person.place.calibrations.begun


def test_the_camera_is_calibrated_beside_its_picture(person: Person) -> None:
    page, calibrations = person.page, person.place.calibrations
    person.click("#tab-camera")
    assert page.locator("#record").is_hidden() and page.locator("#tab-camera").get_attribute("aria-current") == "page"
    page.locator("#camera-words", has_text="pixels wide").wait_for()
    assert page.evaluate(MEAN_OF_PICTURE) > 20.0, "the picture is black"
    page.locator("#calibration-first").fill("0.52 0 0.41")
    page.locator("#calibration-move").check()
    person.click("#calibrate")
    page.locator("#calibration-words", has_text="must be six numbers").wait_for()
    assert not calibrations.begun
    page.locator("#calibration-first").fill("0.52 0 0.41 3.14 -0.85 0")
    page.locator("#calibration-board").fill("aruco:150:4X4_50")
    person.click("#calibrate")
    page.locator("#calibration[data-state=running]").wait_for()
    first = ["--first", "0.52", "0", "0.41", "3.14", "-0.85", "0"]
    assert calibrations.begun == [["--board", "aruco:150:4X4_50", *first, "--move"]]
    assert page.locator("#calibrate").is_disabled()
    calibrations.on_line("<b>the board</b> is not seen")
    calibrations.on_line("sample 15 of 30: 0.05 px")
    page.locator("#calibration-share[value='0.5']").wait_for()
    assert page.locator("#calibration-lines li").all_text_contents() == [
        "<b>the board</b> is not seen", "sample 15 of 30: 0.05 px"
    ]  # fmt: skip
    person.click("#stop-calibrating")
    until(lambda: calibrations.stops == 1, "told to stop")
    calibrations.on_end(130)
    page.locator("#calibration[data-state=stopped]").wait_for()
    assert page.locator("#stop-calibrating").is_hidden() and page.locator("#calibrate").is_enabled()
    person.click("#calibrate")
    page.locator("#calibration[data-state=running]").wait_for()
    calibrations.on_line("calibration/camera.yaml: camera at 0.9, 0, 0.8 m")
    calibrations.on_end(0)
    page.locator("#calibration[data-state=done]").wait_for()
    page.locator("#calibration-words", has_text="✓ calibration/camera.yaml").wait_for()
    person.click("#tab-record")
    assert page.locator("#camera").is_hidden() and page.locator("#stage").is_visible()
