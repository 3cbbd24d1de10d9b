// What is drawn over the picture for a pick or a place: box, cloud, centroid, fingers, ring.

import { ringAround } from "./geometry.js";

/** @import { Box, Grasp, Pixel } from "./protocol" */
/** @import { Ring } from "./geometry.js" */
/** @import { Shown } from "./draft.js" */

const SVG = "http://www.w3.org/2000/svg";

/**
 * @param {string} tag
 * @param {Record<string, string | number>} attributes
 * @param {string} [text]
 */
function make(tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  if (text) element.textContent = text;
  return element;
}

/**
 * A line drawn twice: a light one beneath, so that it shows on any picture.
 * @param {string} tag
 * @param {string} className
 * @param {Record<string, string | number>} attributes
 */
function haloed(tag, className, attributes) {
  return [make(tag, { ...attributes, class: `halo ${className}` }), make(tag, { ...attributes, class: className })];
}

/**
 * Squares on a box's corners, by which it can be taken.
 * @param {Box} box
 * @param {number} pixel
 */
function drawGrips([top, left, bottom, right], pixel) {
  const size = 8 * pixel;
  return [[left, top], [right, top], [left, bottom], [right, bottom]].map(([x = 0, y = 0]) =>
    make("rect", { x: x - size / 2, y: y - size / 2, width: size, height: size, class: "grip" }));
}

/**
 * @param {Box} box
 * @param {string} letter
 * @param {number} pixel
 */
function drawBox([top, left, bottom, right], letter, pixel) {
  const place = { x: left, y: top, width: right - left, height: bottom - top };
  const size = 18 * pixel;
  const x = left, y = Math.max(top - size, 0);
  return [
    ...haloed("rect", "box", place),
    make("rect", { x, y, width: size, height: size, class: "tag" }),
    make("text", { x: x + size / 2, y: y + size * 0.76, "font-size": size * 0.75, class: "tag-letter" }, letter),
  ];
}

/**
 * @param {Grasp} grasp
 * @param {number} pixel
 */
function drawGrasp(grasp, pixel) {
  const dots = grasp.cloud_pixels.map(([row, column]) => `M${column} ${row}h0`).join("");
  const [row, column] = grasp.centroid_pixel;
  const arm = 9 * pixel;
  const cross = `M${column - arm} ${row}h${2 * arm}M${column} ${row - arm}v${2 * arm}`;
  return [make("path", { d: dots, class: "cloud" }), ...haloed("path", "centroid", { d: cross })];
}

/** @param {Pixel[][]} footprint */
function drawFingers(footprint) {
  return footprint.flatMap((corners) =>
    haloed("polygon", "finger", { points: corners.map(([row, column]) => `${column},${row}`).join(" ") }));
}

/**
 * @param {Ring} ring
 * @param {Pixel[]} directions
 * @param {number} rotation
 * @param {number} pixel
 */
function drawRing(ring, directions, rotation, pixel) {
  /** @type {(index: number, inner: number, outer: number) => string} */
  const tick = (index, inner, outer) => {
    const [row, column] = directions[index];
    /** @param {number} share */
    const at = (share) => `${ring.x + share * ring.radius * column} ${ring.y + share * ring.radius * row}`;
    return `M${at(inner)}L${at(outer)}`;
  };
  const all = directions.map((_, index) => tick(index, index % 9 ? 0.93 : 0.86, 1)).join("");
  const [row, column] = directions[rotation];
  return [
    ...haloed("path", "ticks", { d: all }),
    ...haloed("path", "turned", { d: tick(rotation, 0.72, 1) }),
    make("circle", {
      cx: ring.x + ring.radius * column, cy: ring.y + ring.radius * row, r: 6 * pixel, class: "handle",
    }),
  ];
}

/**
 * The SVG elements for one end of the draft.
 * @param {Shown} shown
 * @param {string} letter
 * @param {boolean} active with its grips, and the ring around it
 * @param {number} pixel picture pixels per pixel of the screen
 */
export function drawEnd(shown, letter, active, pixel) {
  const parts = [];
  if (shown.judged) {
    if (shown.judged.grasp) parts.push(...drawGrasp(shown.judged.grasp, pixel));
    parts.push(...drawFingers(shown.judged.footprint));
  }
  parts.push(...drawBox(shown.box, letter, pixel));
  if (active) parts.push(...drawGrips(shown.box, pixel));
  if (active && shown.directions.length) {
    const ring = ringAround(shown.box, shown.middle, pixel);
    parts.push(...drawRing(ring, shown.directions, shown.rotation, pixel));
  }
  return parts;
}

/**
 * The sign at a box's corner that says whether the arm can do what is drawn.
 * @param {Box} box
 * @param {boolean} reachable
 * @param {number} pixel
 */
export function drawReach([top, , , right], reachable, pixel) {
  const radius = 11 * pixel;
  const sign = reachable ? "M-5 0L-1.5 4L5 -4" : "M-4 -4L4 4M4 -4L-4 4";
  const mark = make("g", { transform: `translate(${right} ${top})`, class: `reach ${reachable ? "good" : "bad"}` });
  mark.append(make("circle", { r: radius }), make("path", { d: sign, transform: `scale(${pixel})` }));
  return [mark];
}

/**
 * A box that is being drawn.
 * @param {Box} box
 * @param {string} letter
 * @param {number} pixel
 */
export function drawSketch(box, letter, pixel) {
  const parts = drawBox(box, letter, pixel);
  parts.forEach((part) => part.classList.add("sketch"));
  return parts;
}
