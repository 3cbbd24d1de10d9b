// What a pointer holds on the picture: a side or corner of a box, a whole box, the ring's knob, the ring, or nothing.

import { boxBetween, boxMoved, ringAround } from "./geometry.js";

/** @import { Box, EndName } from "./protocol" */
/** @import { Point, Ring } from "./geometry.js" */
/** @import { Shown } from "./draft.js" */

/** @typedef {-1 | 0 | 1} Side the lower one, none, the upper one */
/** @typedef {{ kind: "box", end: EndName, box: Box, x: Side, y: Side }} HeldBox its sides that move; with none, the box */
/** @typedef {{ kind: "knob" | "ring", end: EndName, shown: Shown, ring: Ring }} HeldRing */
/** @typedef {HeldBox | HeldRing} Held */

const REACH_PX = { mouse: 6, pen: 8, touch: 14 }; // on the screen: how far from a line it can be taken
const KNOB_REACH = 1.5; // times that
const NEAR_RING = [0.6, 1.4]; // of its radius: between these a click turns

/**
 * @param {string} pointer of an event: what points
 * @param {number} pixel picture pixels per pixel of the screen
 */
export function reachOf(pointer, pixel) {
  return pixel * (pointer === "touch" || pointer === "pen" ? REACH_PX[pointer] : REACH_PX.mouse);
}

/**
 * What a pointer would take at a point: of the active end first.
 * @param {[end: EndName, shown: Shown | null][]} ends the active one first
 * @param {Point} point
 * @param {number} reach
 * @param {number} pixel
 * @returns {Held | null}
 */
export function heldAt(ends, point, reach, pixel) {
  const [end, active] = ends[0] ?? [];
  const ring = active?.directions.length ? ringAround(active.box, active.middle, pixel) : null;
  if (end && active && ring && isKnob(active, ring, point, KNOB_REACH * reach)) return { kind: "knob", end, shown: active, ring };
  const outside = ends.every(([, shown]) => shown) ? reach : 0; // the box that is still to be drawn may begin beside the other
  for (const [name, shown] of ends) {
    const sides = shown && sidesAt(shown.box, point, reach, outside);
    if (sides) return { kind: "box", end: name, box: shown.box, ...sides };
  }
  return end && active && ring && isNear(ring, point) ? { kind: "ring", end, shown: active, ring } : null;
}

/**
 * Where a box is once what is held of it was dragged.
 * @param {HeldBox} held
 * @param {Point} by
 * @param {number} width
 * @param {number} height
 */
export function boxDragged({ box, x, y }, [dx, dy], width, height) {
  if (!x && !y) return boxMoved(box, [Math.round(dx), Math.round(dy)], false, width, height);
  const [top, left, bottom, right] = box;
  return boxBetween([left + (x < 0 ? dx : 0), top + (y < 0 ? dy : 0)],
    [right + (x > 0 ? dx : 0), bottom + (y > 0 ? dy : 0)], width, height);
}

/**
 * The name of the cursor over what is held, as style.css has it.
 * @param {Held | null} held
 */
export function cursorOver(held) {
  if (held?.kind !== "box") return held?.kind ?? "";
  if (held.x && held.y) return held.x === held.y ? "falling" : "rising";
  return held.x ? "sideways" : held.y ? "upright" : "whole";
}

/**
 * @param {Box} box
 * @param {Point} point
 * @param {number} reach
 * @param {number} outside how far from the box it can be taken
 */
function sidesAt([top, left, bottom, right], [x, y], reach, outside) {
  if (x < left - outside || x > right + outside || y < top - outside || y > bottom + outside) return null;
  /** @type {(value: number, low: number, high: number) => Side} */
  const side = (value, low, high) => {
    const inner = Math.min(reach, (high - low) / 4); // so that a small box has a middle
    return value < low + inner ? -1 : value > high - inner ? 1 : 0;
  };
  return { x: side(x, left, right), y: side(y, top, bottom) };
}

/**
 * @param {Shown} shown
 * @param {Ring} ring
 * @param {Point} point
 * @param {number} reach
 */
function isKnob({ directions, rotation }, ring, [x, y], reach) {
  const direction = directions[rotation];
  if (!direction) return false;
  return Math.hypot(x - ring.x - ring.radius * direction[1], y - ring.y - ring.radius * direction[0]) <= reach;
}

/**
 * @param {Ring} ring
 * @param {Point} point
 */
function isNear(ring, [x, y]) {
  const apart = Math.hypot(x - ring.x, y - ring.y) / ring.radius;
  const [least = 0, most = 0] = NEAR_RING;
  return apart >= least && apart <= most;
}
