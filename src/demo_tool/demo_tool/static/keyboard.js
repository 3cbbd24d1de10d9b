// Drawing without a pointer: the box that keys begin with, and what a screen reader says of an end.

/** @import { Box, EndName } from "./protocol" */
/** @import { Shown } from "./draft.js" */
/** @import { Point } from "./geometry.js" */

/** @type {Record<string, Point>} the direction of each arrow key */
export const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const KEY_STEP = 2, HELD_STEP = 10; // picture pixels
const FIRST_SIZE = 64; // picture pixels

/**
 * The group in which an end is drawn; it takes the focus, and keys while it has it.
 * @param {EndName} end
 */
export function keyboardGroup(end) {
  const group = document.createElementNS("http://www.w3.org/2000/svg", "g");
  group.setAttribute("tabindex", "0");
  group.setAttribute("role", "application");
  group.setAttribute("class", `end-drawing ${end}`);
  return group;
}

/**
 * How far an arrow key moves a box; farther while it is held.
 * @param {KeyboardEvent} event
 */
export function stepOf(event) {
  return event.repeat ? HELD_STEP : KEY_STEP;
}

/**
 * The box with which keys begin to draw an end.
 * @param {EndName} end
 * @param {[width: number, height: number]} size of the picture
 * @returns {Box}
 */
export function firstBox(end, [width, height]) {
  const left = Math.round(width * (end === "pick" ? 0.4 : 0.6) - FIRST_SIZE / 2);
  const top = Math.round(height / 2 - FIRST_SIZE / 2);
  return [top, left, top + FIRST_SIZE, left + FIRST_SIZE];
}

/**
 * The words for an end: its box while that is being drawn, else how it is turned and judged.
 * @param {EndName} end
 * @param {Box | null} sketch the end's box that is being drawn
 * @param {Shown | null} shown
 * @param {number} rotations in a full turn
 */
export function labelOf(end, sketch, shown, rotations) {
  const name = end === "pick" ? "Pick" : "Place";
  if (sketch) {
    const [top, left, bottom, right] = sketch;
    return `${name}: box of ${right - left} by ${bottom - top} at column ${left}, row ${top}. ` +
      "Arrows move it, with Shift they change its size, Enter puts it down.";
  }
  if (!shown) return `${name}: no box yet. Enter begins one.`;
  return `${name}: turned by ${shown.rotation * 360 / rotations} degrees. ` +
    `Arrows turn it, Enter moves its box. ${shown.judged?.words ?? ""}`;
}
