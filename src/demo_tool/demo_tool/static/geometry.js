// Boxes and rings on the picture. Boxes are [top, left, bottom, right] in pixels of the colour picture.

export const SMALLEST = 4;

/** The box between two points [x, y], inside a picture of width and height. */
export function boxBetween([x0, y0], [x1, y1], width, height) {
  const x = [x0, x1].map((v) => Math.min(Math.max(Math.round(v), 0), width)).sort((a, b) => a - b);
  const y = [y0, y1].map((v) => Math.min(Math.max(Math.round(v), 0), height)).sort((a, b) => a - b);
  return [y[0], x[0], y[1], x[1]];
}

/** A box moved, and grown on its right and lower side, kept inside the picture. */
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

export function isLargeEnough([top, left, bottom, right]) {
  return bottom - top >= SMALLEST && right - left >= SMALLEST;
}

/** The ring around a box: {x, y, radius}; pixel: picture pixels per pixel of the screen. */
export function ringAround(box, centroid, pixel) {
  const [top, left, bottom, right] = box;
  const [y, x] = centroid ?? [(top + bottom) / 2, (left + right) / 2];
  return { x, y, radius: Math.max(Math.hypot(bottom - top, right - left) / 2 + 14 * pixel, 52 * pixel) };
}

/** The rotation whose direction (row, column) points most nearly from the ring's middle to a point [x, y]. */
export function rotationTowards(ring, [x, y], directions) {
  const dx = x - ring.x, dy = y - ring.y;
  let best = 0, most = -Infinity;
  directions.forEach(([row, column], rotation) => {
    const along = column * dx + row * dy;
    if (along > most) [best, most] = [rotation, along];
  });
  return best;
}
