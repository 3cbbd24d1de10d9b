// The picture as a drawing board: boxes by mouse, pen, finger or keys; rotations by a click around a box or by keys.

import { drawEnd, drawSketch } from "./drawing.js";
import { boxBetween, boxMoved, isLargeEnough, ringAround, rotationTowards } from "./geometry.js";

const ENDS = ["pick", "place"];
const LETTERS = { pick: "A", place: "B" };
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const DRAG_PX = 6; // on the screen: less is a click
const KEY_STEP = 2, HELD_STEP = 10; // picture pixels
const FIRST_SIZE = 64;

export class Stage extends EventTarget {
  #svg;
  #groups = {};
  #size = [960, 540];
  #rotations = 36;
  #judged = { pick: null, place: null }; // as the server has them
  #mine = { pick: null, place: null }; // on its way to the server
  #sending = { pick: false, place: false };
  #sketch = null; // {end, box}: being drawn by pointer or keys
  #pressed = null;
  #explicit = false; // the end was chosen by hand, so the next box is its
  #send;
  active = "pick";
  enabled = false;

  /** send(end, {box, rotation}) tells the server; it resolves or rejects. */
  constructor(svg, send) {
    super();
    this.#svg = svg;
    this.#send = send;
    for (const end of ENDS) this.#groups[end] = this.#makeGroup(end);
    svg.addEventListener("pointerdown", (event) => this.#down(event));
    svg.addEventListener("pointermove", (event) => this.#move(event));
    svg.addEventListener("pointerup", (event) => this.#up(event));
    svg.addEventListener("pointercancel", () => this.cancel());
    new ResizeObserver(() => this.draw()).observe(svg);
  }

  /** Take the server's state of the draft. */
  take(draft, camera, rotations) {
    const drawn = (ends) => ENDS.some((end) => ends[end]);
    if (drawn(this.#judged) && !drawn(draft)) [this.active, this.#explicit] = ["pick", false]; // the next step begins
    this.#judged = draft;
    this.#rotations = rotations;
    if (camera.width && camera.height) this.#size = [camera.width, camera.height];
    this.#svg.setAttribute("viewBox", `0 0 ${this.#size[0]} ${this.#size[1]}`);
    this.draw();
  }

  /** {box, rotation, directions, judged} of an end, or null. */
  shown(end) {
    const judged = this.#judged[end], mine = this.#mine[end];
    if (!judged && !mine) return null;
    const settled = judged && !mine;
    return { ...(mine ?? judged), directions: judged?.directions, judged: settled ? judged : null };
  }

  /** Choose the end that is drawn next. */
  choose(end, byHand = true) {
    this.active = end;
    this.#explicit = byHand;
    this.draw();
    this.dispatchEvent(new Event("change"));
  }

  turn(end, ticks) {
    const shown = this.shown(end);
    if (!shown || !this.enabled) return;
    const rotation = (shown.rotation + ticks + this.#rotations) % this.#rotations;
    this.#put(end, shown.box, rotation);
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
      if (this.#sketch?.end === end) parts.push(...drawSketch(this.#sketch.box, LETTERS[end], this.#pixel()));
      group.replaceChildren(...parts);
      group.setAttribute("aria-label", this.#label(end, shown));
    }
  }

  // pointer

  #down(event) {
    if (!this.enabled || !event.isPrimary || event.button !== 0) return;
    event.preventDefault();
    document.activeElement?.blur?.(); // the space bar is the stop again
    this.#svg.setPointerCapture(event.pointerId);
    this.#sketch = null;
    this.#pressed = { start: this.#point(event), drawing: false };
  }

  #move(event) {
    if (!this.#pressed || !event.isPrimary) return;
    const point = this.#point(event), { start } = this.#pressed;
    if (!this.#pressed.drawing) {
      if (Math.hypot(point[0] - start[0], point[1] - start[1]) < DRAG_PX * this.#pixel()) return;
      this.#pressed.drawing = true;
      this.#chooseForBox();
    }
    this.#sketch = { end: this.active, box: boxBetween(start, point, ...this.#size) };
    this.draw();
  }

  #up(event) {
    if (!this.#pressed || !event.isPrimary) return;
    this.#move(event);
    const { drawing, start } = this.#pressed;
    const sketch = this.#sketch;
    this.#pressed = this.#sketch = null;
    if (!drawing) this.#click(start);
    else if (sketch && isLargeEnough(sketch.box)) this.#putBox(sketch.end, sketch.box);
    this.draw();
  }

  #chooseForBox() {
    const other = this.active === "pick" ? "place" : "pick";
    if (!this.#explicit && this.shown(this.active) && !this.shown(other)) this.choose(other, false);
    this.#explicit = false;
  }

  #click(point) {
    const rings = ENDS.map((end) => ({ end, shown: this.shown(end) }))
      .filter(({ shown }) => shown?.directions)
      .map(({ end, shown }) => {
        const ring = ringAround(shown.box, shown.judged?.grasp?.centroid_pixel, this.#pixel());
        return { end, shown, ring, apart: Math.hypot(point[0] - ring.x, point[1] - ring.y) / ring.radius };
      });
    const near = rings.find(({ end, apart }) => end === this.active && apart < 1.35);
    const hit = near ?? rings.sort((a, b) => a.apart - b.apart)[0];
    if (!hit) return;
    if (hit.end !== this.active) this.choose(hit.end, false);
    this.#put(hit.end, hit.shown.box, rotationTowards(hit.ring, point, hit.shown.directions));
  }

  #point(event) {
    const area = this.#svg.getBoundingClientRect();
    return [(event.clientX - area.left) * this.#size[0] / area.width,
      (event.clientY - area.top) * this.#size[1] / area.height];
  }

  #pixel() {
    return this.#size[0] / (this.#svg.clientWidth || this.#size[0]);
  }

  // keys

  #makeGroup(end) {
    const group = document.createElementNS("http://www.w3.org/2000/svg", "g");
    group.setAttribute("tabindex", "0");
    group.setAttribute("role", "application");
    group.setAttribute("class", `end-drawing ${end}`);
    group.addEventListener("focus", () => this.#focused(end));
    group.addEventListener("blur", () => this.#left(end));
    group.addEventListener("keydown", (event) => this.#key(end, event));
    this.#svg.append(group);
    return group;
  }

  #focused(end) {
    if (this.#pressed) return;
    this.choose(end);
    if (this.enabled && !this.shown(end)) this.#sketch = { end, box: this.#firstBox(end) };
    this.draw();
  }

  #left(end) {
    if (this.#sketch?.end === end && !this.#pressed) this.cancel();
  }

  #key(end, event) {
    if (!this.enabled || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.key in ARROWS) this.#arrow(end, ARROWS[event.key], event);
    else if (event.key === "Enter") this.#enter(end);
    else if (event.key === "Delete" || event.key === "Backspace") this.dispatchEvent(new Event("clear"));
    else return;
    event.preventDefault();
  }

  #arrow(end, [dx, dy], event) {
    if (this.#sketch?.end !== end) {
      this.turn(end, dx + dy);
      return;
    }
    const step = event.repeat ? HELD_STEP : KEY_STEP;
    this.#sketch.box = boxMoved(this.#sketch.box, [dx * step, dy * step], event.shiftKey, ...this.#size);
    this.draw();
  }

  #enter(end) {
    if (this.#sketch?.end === end) {
      const { box } = this.#sketch;
      this.#sketch = null;
      this.#putBox(end, box);
    } else {
      this.#sketch = { end, box: this.shown(end)?.box ?? this.#firstBox(end) };
      this.draw();
    }
  }

  #firstBox(end) {
    const [width, height] = this.#size;
    const left = Math.round(width * (end === "pick" ? 0.4 : 0.6) - FIRST_SIZE / 2);
    const top = Math.round(height / 2 - FIRST_SIZE / 2);
    return [top, left, top + FIRST_SIZE, left + FIRST_SIZE];
  }

  #label(end, shown) {
    const name = end === "pick" ? "Pick" : "Place";
    if (this.#sketch?.end === end) {
      const [top, left, bottom, right] = this.#sketch.box;
      return `${name}: box of ${right - left} by ${bottom - top} at column ${left}, row ${top}. ` +
        "Arrows move it, with Shift they change its size, Enter puts it down.";
    }
    if (!shown) return `${name}: no box yet. Enter begins one.`;
    return `${name}: turned by ${shown.rotation * 360 / this.#rotations} degrees. ` +
      `Arrows turn it, Enter moves its box. ${shown.judged?.words ?? ""}`;
  }

  // towards the server

  #putBox(end, box) {
    const rotation = this.shown(end)?.rotation ?? (end === "place" ? this.shown("pick")?.rotation : null) ?? 0;
    this.#put(end, box, rotation);
  }

  /** Only the newest is sent while an answer is out, so that held keys do not queue. */
  async #put(end, box, rotation) {
    const mine = { box, rotation };
    this.#mine[end] = mine;
    this.draw();
    this.dispatchEvent(new Event("change"));
    if (this.#sending[end]) return;
    this.#sending[end] = true;
    let sent = null;
    while (this.#mine[end] && this.#mine[end] !== sent) {
      sent = this.#mine[end];
      await this.#send(end, sent);
    }
    this.#sending[end] = false;
    this.#mine[end] = null;
    this.draw();
    this.dispatchEvent(new Event("change"));
  }
}
