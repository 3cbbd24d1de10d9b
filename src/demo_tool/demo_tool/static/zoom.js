// A closer look at the picture: by wheel, by two fingers, or by buttons. What is drawn on it grows with it.

import { button } from "./page.js";

/** @import { Point } from "./geometry.js" */

const MOST = 6;
const STEP = 1.25; // of a wheel's tick
const BUTTON_STEP = 2;

export class Zoom {
  #stage;
  #onPinch;
  #scale = 1;
  /** @type {Point} the picture's upper left corner, as shares of the stage: 0 to 1 - scale */
  #corner = [0, 0];
  /** @type {Map<number, Point>} fingers on the stage */
  #fingers = new Map();

  /**
   * @param {HTMLElement} stage
   * @param {() => void} onPinch is called as a second finger comes: the first was no drawing
   */
  constructor(stage, onPinch) {
    this.#stage = stage;
    this.#onPinch = onPinch;
    stage.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    stage.addEventListener("pointerdown", (event) => this.#down(event), { capture: true });
    window.addEventListener("pointermove", (event) => this.#move(event), { capture: true });
    for (const end of ["pointerup", "pointercancel"]) {
      window.addEventListener(end, (event) => this.#fingers.delete(/** @type {PointerEvent} */ (event).pointerId), { capture: true });
    }
    button("zoom-in").addEventListener("click", () => this.#zoom(BUTTON_STEP, [0.5, 0.5]));
    button("zoom-out").addEventListener("click", () => this.#zoom(0, [0.5, 0.5]));
    this.#show();
  }

  /** @param {WheelEvent} event */
  #wheel(event) {
    const closer = event.deltaY < 0;
    if (this.#scale === 1 && (!closer || (window.scrollY > 0 && !event.ctrlKey))) return; // it scrolls the page
    event.preventDefault();
    this.#zoom(closer ? STEP : 1 / STEP, this.#share([event.clientX, event.clientY]));
  }

  /** @param {PointerEvent} event */
  #down(event) {
    if (event.pointerType !== "touch") return;
    this.#fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (this.#fingers.size === 2) this.#onPinch();
  }

  /** @param {PointerEvent} event */
  #move(event) {
    const before = [...this.#fingers.values()];
    if (!this.#fingers.has(event.pointerId)) return;
    this.#fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (before.length !== 2) return;
    const after = [...this.#fingers.values()];
    const [from, to] = [this.#share(middle(before)), this.#share(middle(after))];
    const factor = apart(after) / Math.max(apart(before), 1);
    this.#corner = [this.#corner[0] + to[0] - from[0], this.#corner[1] + to[1] - from[1]];
    this.#zoom(factor, to);
  }

  /**
   * @param {Point} point of the window
   * @returns {Point} as shares of the stage
   */
  #share([x, y]) {
    const area = this.#stage.getBoundingClientRect();
    return [(x - area.left) / area.width, (y - area.top) / area.height];
  }

  /**
   * @param {number} factor
   * @param {Point} about the share of the stage whose place in the picture stays
   */
  #zoom(factor, about) {
    const scale = Math.min(Math.max(this.#scale * factor, 1), MOST);
    /** @param {number} corner @param {number} at */
    const kept = (corner, at) => Math.min(Math.max(at - (at - corner) * scale / this.#scale, 1 - scale), 0);
    this.#corner = [kept(this.#corner[0], about[0]), kept(this.#corner[1], about[1])];
    this.#scale = scale;
    this.#show();
  }

  #show() {
    const { style } = this.#stage;
    style.setProperty("--zoomed", `${100 * this.#scale}%`);
    style.setProperty("--left", `${100 * this.#corner[0]}%`);
    style.setProperty("--top", `${100 * this.#corner[1]}%`);
    button("zoom-in").disabled = this.#scale >= MOST;
    button("zoom-out").hidden = this.#scale === 1;
  }
}

/**
 * @param {Point[]} points two
 * @returns {Point}
 */
const middle = ([[x0, y0] = [0, 0], [x1, y1] = [0, 0]]) => [(x0 + x1) / 2, (y0 + y1) / 2];

/** @param {Point[]} points two */
const apart = ([[x0, y0] = [0, 0], [x1, y1] = [0, 0]]) => Math.hypot(x1 - x0, y1 - y0);
