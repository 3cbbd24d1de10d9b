// What is drawn over the picture for a pick or a place: box, cloud, centroid, fingers, ring.

import { ringAround } from "./geometry.js";

const SVG = "http://www.w3.org/2000/svg";

function make(tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text) element.textContent = text;
  return element;
}

/** A line drawn twice: a light one beneath, so that it shows on any picture. */
function haloed(tag, className, attributes) {
  return [make(tag, { ...attributes, class: `halo ${className}` }), make(tag, { ...attributes, class: className })];
}

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

function drawGrasp(grasp, pixel) {
  const dots = grasp.cloud_pixels.map(([row, column]) => `M${column} ${row}h0`).join("");
  const [row, column] = grasp.centroid_pixel;
  const arm = 9 * pixel;
  const cross = `M${column - arm} ${row}h${2 * arm}M${column} ${row - arm}v${2 * arm}`;
  return [make("path", { d: dots, class: "cloud" }), ...haloed("path", "centroid", { d: cross })];
}

function drawFingers(footprint) {
  return footprint.flatMap((corners) =>
    haloed("polygon", "finger", { points: corners.map(([row, column]) => `${column},${row}`).join(" ") }));
}

function drawRing(ring, directions, rotation, pixel) {
  const tick = (index, inner, outer) => {
    const [row, column] = directions[index];
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

/** The SVG elements for one end of the draft. shown: {box, rotation, judged}; active: with the ring around it. */
export function drawEnd(shown, letter, active, pixel) {
  const parts = [];
  if (shown.judged) {
    if (shown.judged.grasp) parts.push(...drawGrasp(shown.judged.grasp, pixel));
    parts.push(...drawFingers(shown.judged.footprint));
  }
  parts.push(...drawBox(shown.box, letter, pixel));
  if (active && shown.directions) {
    const ring = ringAround(shown.box, shown.judged?.grasp?.centroid_pixel, pixel);
    parts.push(...drawRing(ring, shown.directions, shown.rotation, pixel));
  }
  return parts;
}

/** A box that is being drawn. */
export function drawSketch(box, letter, pixel) {
  const parts = drawBox(box, letter, pixel);
  parts.forEach((part) => part.classList.add("sketch"));
  return parts;
}
