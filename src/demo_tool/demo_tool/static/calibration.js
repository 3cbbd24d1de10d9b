// The camera's calibration: begin, stop, what is said of the samples, and the camera's picture, whose place need not be known.

import { LivePicture } from "./live.js";
import { button, byId, element, input, say } from "./page.js";

/** @import { Calibration, Call, View } from "./protocol" */

/** @type {Record<Calibration["state"], string>} */
const SIGNS = { none: "", running: "…", stopped: "■", failed: "✗", done: "✓" };

export class CalibrationCard {
  #live;
  #lines = "";

  /**
   * @param {Call} call
   * @param {(error: unknown) => void} tell
   */
  constructor(call, tell) {
    this.#live = new LivePicture(byId("camera-live", HTMLCanvasElement), ({ perSecond, width }) => {
      say(byId("camera-words"), `Picture: ${perSecond.toFixed(0)} a second, ${width} pixels wide.`);
    }, (words) => say(byId("camera-words"), `No picture: ${words}`));
    byId("calibration", HTMLFormElement).addEventListener("submit", (event) => {
      event.preventDefault();
      const [board, first] = [input("calibration-board").value, input("calibration-first").value];
      call("calibrate", { board, first, move: input("calibration-move").checked }).catch((error) => {
        say(byId("calibration-words"), error instanceof Error ? error.message : String(error));
        tell(error);
      });
    });
    button("stop-calibrating").addEventListener("click", () => call("stop_calibrating").catch(tell));
  }

  /**
   * Show the camera's picture, or none any more.
   * @param {boolean} shown
   */
  open(shown) {
    this.#live.show(shown ? "camera" : "");
  }

  /**
   * @param {View} view
   * @param {boolean} connected
   */
  show({ calibration, holder }, connected) {
    const { state, words, lines, share } = calibration;
    const mine = connected && holder === "me", running = state === "running";
    byId("calibration").dataset.state = state;
    button("calibrate").disabled = !mine || running;
    byId("stop-calibrating").hidden = !running;
    button("stop-calibrating").disabled = !mine;
    const bar = byId("calibration-share", HTMLProgressElement);
    bar.hidden = !running;
    bar.value = share;
    byId("calibration-words").dataset.ok = String(state !== "failed");
    if (state !== "none") say(byId("calibration-words"), `${SIGNS[state]} ${words}`);
    const news = lines.join("\n");
    if (this.#lines === news) return;
    this.#lines = news;
    byId("calibration-lines").replaceChildren(...lines.map((line) => element("li", {}, line)));
  }
}
