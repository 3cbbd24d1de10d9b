// The motion of a recorded step: frames in the place of its picture, by a slider or one after the other.

import { element, say } from "./page.js";

/** @import { RecordedStep } from "./protocol" */

const PLAY = "▶ Motion", PAUSE = "❚❚ Pause";

/**
 * Controls that show the motion in a picture; the slider's place 0 is the picture itself.
 * @param {HTMLImageElement} picture
 * @param {string} address of the step, without an ending
 * @param {RecordedStep} step
 */
export function motionControls(picture, address, { frames, frame_ms: period }) {
  const still = picture.src;
  const slider = element("input", { type: "range", min: "0", max: String(frames), value: "0", "aria-label": "Moment of the motion" });
  const play = element("button", { type: "button" }, PLAY);
  let playing = false;

  async function show() {
    const frame = slider.valueAsNumber;
    picture.src = frame === 0 ? still : `${address}/motion/${frame - 1}.jpg`;
    await picture.decode().catch(() => {}); // the next frame comes all the same
  }

  function pause() {
    playing = false;
    say(play, PLAY);
  }

  /**
   * @param {number} first place of the slider at which it began
   * @param {number} begun when it was there [ms]
   */
  async function go(first, begun) {
    if (!playing || !picture.isConnected) return;
    slider.value = String(Math.min(frames, first + Math.floor((performance.now() - begun) / period)));
    await show();
    if (slider.valueAsNumber < frames) setTimeout(() => go(first, begun), period);
    else pause();
  }

  slider.addEventListener("input", () => {
    pause();
    show();
  });
  play.addEventListener("click", () => {
    if (playing) return pause();
    playing = true;
    say(play, PAUSE);
    if (slider.valueAsNumber === frames) slider.value = "0";
    go(slider.valueAsNumber, performance.now());
  });
  return element("div", { className: "row motion" }, play, slider);
}
