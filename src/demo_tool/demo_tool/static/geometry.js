// Boxes and rings on the picture. Boxes are [top, left, bottom, right] in pixels of the colour picture.

/** @import { Box, Pixel } from "./protocol" */

/** @typedef {[x: number, y: number]} Point */
/** @typedef {{ x: number, y: number, radius: number }} Ring */

export const SMALLEST = 4;

/**
 * The box between two points, inside a picture of width and height.
 * @param {Point} from
 * @param {Point} to
 * @param {number} width
 * @param {number} height
 * @returns {Box}
 */
export function boxBetween([x0, y0], [x1, y1], width, height) {
  /** @param {number} value @param {number} most */
  const kept = (value, most) => Math.min(Math.max(Math.round(value), 0), most);
  const left = kept(Math.min(x0, x1), width), right = kept(Math.max(x0, x1), width);
  const top = kept(Math.min(y0, y1), height), bottom = kept(Math.max(y0, y1), height);
  return [top, left, bottom, right];
}

/**
 * A box moved, or grown on its right and lower side, kept inside the picture.
 * @param {Box} box
 * @param {Point} by
 * @param {boolean} grow
 * @param {number} width
 * @param {number} height
 * @returns {Box}
 */
export function boxMoved([top, left, bottom, right], [dx, dy], grow, width, height) {
  if (grow) {
    const wider = Math.min(Math.max(right + dx, left + SMALLEST), width);
    const higher = Math.min(Math.max(bottom + dy, top + SMALLEST), height);
    return [top, left, higher, wider];
  }
  const x = Math.min(Math.max(left + dx, 0), width - (right - left));
  const y = Math.min(Math.max(top + dy, 0), height - (bottom - top));
  return [y, x, y + bottom - top, x + right - left];
}

/** @param {Box} box */
export function isLargeEnough([top, left, bottom, right]) {
  return bottom - top >= SMALLEST && right - left >= SMALLEST;
}

/**
 * The ring around a box.
 * @param {Box} box
 * @param {Pixel | null} centroid its middle, instead of the box's
 * @param {number} pixel picture pixels per pixel of the screen
 * @returns {Ring}
 */
export function ringAround(box, centroid, pixel) {
  const [top, left, bottom, right] = box;
  const [y, x] = centroid ?? [(top + bottom) / 2, (left + right) / 2];
  return { x, y, radius: Math.max(Math.hypot(bottom - top, right - left) / 2 + 14 * pixel, 52 * pixel) };
}

/**
 * The rotation whose direction points most nearly from the ring's middle to a point.
 * @param {Ring} ring
 * @param {Point} point
 * @param {Pixel[]} directions
 */
export function rotationTowards(ring, [x, y], directions) {
  const dx = x - ring.x, dy = y - ring.y;
  let best = 0, most = -Infinity;
  directions.forEach(([row, column], rotation) => {
    const along = column * dx + row * dy;
    if (along > most) [best, most] = [rotation, along];
  });
  return best;
}
