// The picture as a drawing board: boxes and rotations by mouse, pen, finger or keys.

import { DrawnEnds, ENDS } from "./draft.js";
import { drawEnd, drawReach, drawSketch } from "./drawing.js";
import { boxBetween, boxMoved, isLargeEnough, rotationTowards } from "./geometry.js";
import { boxDragged, cursorOver, heldAt, reachOf } from "./grips.js";
import { ARROWS, firstBox, keyboardGroup, labelOf, stepOf } from "./keyboard.js";

/** @import { Box, Camera, Draft, EndName } from "./protocol" */
/** @import { Drawn, Shown } from "./draft.js" */
/** @import { Point } from "./geometry.js" */
/** @import { Held, HeldRing } from "./grips.js" */

/** @typedef {{ end: EndName, box: Box }} Sketch a box that is being drawn by pointer or keys */
/** @typedef {{ start: Point, drawing: boolean, held: Held | null }} Press */

const LETTERS = { pick: "A", place: "B" };
const DRAG_PX = 6; // on the screen: less is a click

export class Stage extends EventTarget {
  #svg;
  /** @type {Record<EndName, SVGGElement>} */
  #groups;
  /** @type {[width: number, height: number]} */
  #size = [960, 540];
  #rotations = 36;
  /** @type {Sketch | null} */
  #sketch = null;
  /** @type {Press | null} */
  #pressed = null;
  #explicit = false; // the end was chosen by hand, so the next box is its
  #ends;
  /** @type {EndName} */
  active = "pick";
  enabled = false;
  /** @type {boolean | null} whether the arm can do what is drawn; null: not known */
  reachable = null;

  /**
   * @param {SVGSVGElement} svg
   * @param {(end: EndName, drawn: Drawn) => Promise<unknown>} send tells the server; it always resolves
   */
  constructor(svg, send) {
    super();
    this.#svg = svg;
    this.#ends = new DrawnEnds(send, () => {
      this.draw();
      this.dispatchEvent(new Event("change"));
    });
    this.#groups = { pick: this.#makeGroup("pick"), place: this.#makeGroup("place") };
    svg.addEventListener("pointerdown", (event) => this.#down(event));
    svg.addEventListener("pointermove", (event) => this.#move(event));
    svg.addEventListener("pointerup", (event) => this.#up(event));
    svg.addEventListener("pointercancel", () => this.cancel());
    new ResizeObserver(() => this.draw()).observe(svg);
  }

  /**
   * Take the server's state of the draft.
   * @param {Draft} draft
   * @param {Camera} camera
   * @param {number} rotations
   */
  take(draft, camera, rotations) {
    if (this.#ends.take(draft)) [this.active, this.#explicit] = ["pick", false]; // the next step begins
    this.#rotations = rotations;
    if (camera.width && camera.height) this.#size = [camera.width, camera.height];
    this.#svg.setAttribute("viewBox", `0 0 ${this.#size[0]} ${this.#size[1]}`);
    this.draw();
  }

  /**
   * What is drawn of an end.
   * @param {EndName} end
   * @returns {Shown | null}
   */
  shown(end) {
    return this.#ends.shown(end);
  }

  /**
   * Box and rotation of an end as they are shown, or null.
   * @param {EndName} end
   * @returns {Drawn | null}
   */
  seen(end) {
    const shown = this.shown(end);
    return shown && { box: shown.box, rotation: shown.rotation };
  }

  /**
   * Choose the end that is drawn next.
   * @param {EndName} end
   */
  choose(end, byHand = true) {
    this.active = end;
    this.#explicit = byHand;
    this.draw();
    this.dispatchEvent(new Event("change"));
  }

  /**
   * @param {EndName} end
   * @param {number} ticks
   */
  turn(end, ticks) {
    const shown = this.shown(end);
    if (!shown || !this.enabled) return;
    const rotation = (shown.rotation + ticks + this.#rotations) % this.#rotations;
    this.#ends.put(end, shown.box, rotation);
  }

  cancel() {
    this.#pressed = this.#sketch = null;
    this.draw();
  }

  draw() {
    for (const end of ENDS) {
      const shown = this.shown(end);
      const group = this.#groups[end];
      const parts = shown ? drawEnd(shown, LETTERS[end], end === this.active, this.#pixel()) : [];
      if (shown?.judged && end === "place" && this.reachable !== null && !this.#sketch) {
        parts.push(...drawReach(shown.box, this.reachable, this.#pixel()));
      }
      if (this.#sketch?.end === end) parts.push(...drawSketch(this.#sketch.box, LETTERS[end], this.#pixel()));
      group.replaceChildren(...parts);
      group.setAttribute("aria-label", labelOf(end, this.#sketch?.end === end ? this.#sketch.box : null, shown, this.#rotations));
    }
  }

  // pointer

  /** @param {PointerEvent} event */
  #down(event) {
    if (!this.enabled || !event.isPrimary || event.button !== 0) return;
    event.preventDefault();
    if (document.activeElement instanceof HTMLElement || document.activeElement instanceof SVGElement) document.activeElement.blur(); // the space bar is the stop again
    this.#svg.setPointerCapture(event.pointerId);
    this.#sketch = null;
    const start = this.#point(event);
    this.#pressed = { start, drawing: false, held: this.#heldAt(start, event) };
  }

  /** @param {PointerEvent} event */
  #move(event) {
    if (!event.isPrimary) return;
    const point = this.#point(event);
    if (!this.#pressed) {
      this.#svg.dataset.over = this.enabled ? cursorOver(this.#heldAt(point, event)) : "";
      return;
    }
    const { start, held } = this.#pressed;
    const [dx, dy] = [point[0] - start[0], point[1] - start[1]];
    if (!this.#pressed.drawing) {
      if (Math.hypot(dx, dy) < DRAG_PX * this.#pixel()) return;
      this.#pressed.drawing = true;
      if (held?.kind === "box" && held.end !== this.active) this.choose(held.end, false);
      else if (held?.kind !== "box" && held?.kind !== "knob") this.#chooseForBox();
    }
    if (held?.kind === "knob") this.#turnTowards(held, point);
    else if (held?.kind === "box") this.#sketch = { end: held.end, box: boxDragged(held, [dx, dy], ...this.#size) };
    else this.#sketch = { end: this.active, box: boxBetween(start, point, ...this.#size) };
    this.draw();
  }

  /** @param {PointerEvent} event */
  #up(event) {
    if (!this.#pressed || !event.isPrimary) return;
    this.#move(event);
    const { drawing, start, held } = this.#pressed;
    const sketch = this.#sketch;
    this.#pressed = this.#sketch = null;
    if (!drawing) this.#click(start, held);
    else if (sketch && isLargeEnough(sketch.box)) this.#putBox(sketch.end, sketch.box);
    else if (sketch && held?.kind === "box") this.#putBox(held.end, held.box); // dragged to nothing: it stays as it was
    this.draw();
  }

  #chooseForBox() {
    const other = this.active === "pick" ? "place" : "pick";
    if (!this.#explicit && this.shown(this.active) && !this.shown(other)) this.choose(other, false);
    this.#explicit = false;
  }

  /**
   * @param {Point} point
   * @param {Held | null} held
   */
  #click(point, held) {
    if (held?.kind === "ring") this.#turnTowards(held, point);
    else if (held && held.end !== this.active) this.choose(held.end, false);
    else if (!held) this.#pointAt(point);
  }

  /**
   * The server draws the end around what is there: one that is not drawn yet, or was chosen by hand.
   * @param {Point} point
   */
  #pointAt([x, y]) {
    const byHand = this.#explicit;
    this.#chooseForBox();
    const end = this.active;
    if (this.shown(end) && !byHand) return;
    this.dispatchEvent(new CustomEvent("point", { detail: { end, pixel: [y, x], rotation: this.#rotationFor(end) } }));
  }

  /**
   * @param {Point} point
   * @param {PointerEvent} event
   */
  #heldAt(point, event) {
    const active = this.active, other = active === "pick" ? "place" : "pick";
    const pixel = this.#pixel();
    return heldAt([[active, this.shown(active)], [other, this.shown(other)]], point, reachOf(event.pointerType, pixel), pixel);
  }

  /**
   * @param {HeldRing} held
   * @param {Point} point
   */
  #turnTowards({ end, shown, ring }, point) {
    const rotation = rotationTowards(ring, point, shown.directions);
    if (rotation !== this.shown(end)?.rotation) this.#ends.put(end, shown.box, rotation);
  }

  /**
   * @param {PointerEvent} event
   * @returns {Point}
   */
  #point(event) {
    const area = this.#svg.getBoundingClientRect();
    return [(event.clientX - area.left) * this.#size[0] / area.width,
      (event.clientY - area.top) * this.#size[1] / area.height];
  }

  #pixel() {
    return this.#size[0] / (this.#svg.clientWidth || this.#size[0]);
  }

  // keys

  /** @param {EndName} end */
  #makeGroup(end) {
    const group = keyboardGroup(end);
    group.addEventListener("focus", () => this.#focused(end));
    group.addEventListener("blur", () => this.#left(end));
    group.addEventListener("keydown", (event) => this.#key(end, event));
    this.#svg.append(group);
    return group;
  }

  /** @param {EndName} end */
  #focused(end) {
    if (this.#pressed) return;
    this.choose(end);
    if (this.enabled && !this.shown(end)) this.#sketch = { end, box: firstBox(end, this.#size) };
    this.draw();
  }

  /** @param {EndName} end */
  #left(end) {
    if (this.#sketch?.end === end && !this.#pressed) this.cancel();
  }

  /**
   * @param {EndName} end
   * @param {KeyboardEvent} event
   */
  #key(end, event) {
    if (!this.enabled || event.ctrlKey || event.altKey || event.metaKey) return;
    const arrow = ARROWS[event.key];
    if (arrow) this.#arrow(end, arrow, event);
    else if (event.key === "Enter") this.#enter(end);
    else if (event.key === "Delete" || event.key === "Backspace") this.dispatchEvent(new Event("clear"));
    else return;
    event.preventDefault();
  }

  /**
   * @param {EndName} end
   * @param {Point} direction
   * @param {KeyboardEvent} event
   */
  #arrow(end, [dx, dy], event) {
    if (this.#sketch?.end !== end) {
      this.turn(end, dx + dy);
      return;
    }
    const step = stepOf(event);
    this.#sketch.box = boxMoved(this.#sketch.box, [dx * step, dy * step], event.shiftKey, ...this.#size);
    this.draw();
  }

  /** @param {EndName} end */
  #enter(end) {
    if (this.#sketch?.end === end) {
      const { box } = this.#sketch;
      this.#sketch = null;
      this.#putBox(end, box);
    } else {
      this.#sketch = { end, box: this.shown(end)?.box ?? firstBox(end, this.#size) };
      this.draw();
    }
  }

  // towards the server

  /**
   * @param {EndName} end
   * @param {Box} box
   */
  #putBox(end, box) {
    this.#ends.put(end, box, this.#rotationFor(end));
  }

  /** @param {EndName} end */
  #rotationFor(end) {
    return this.shown(end)?.rotation ?? (end === "place" ? this.shown("pick")?.rotation : null) ?? 0;
  }
}
