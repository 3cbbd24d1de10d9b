// What is drawn: as the server judged it, and what is on its way there.

/** @import { Box, Draft, DrawnEnd, EndName, Ends, Pixel } from "./protocol" */

/** @typedef {{ box: Box, rotation: number }} Drawn */

/**
 * An end as the picture shows it; directions: of its rotations, none where not known; middle: of what the box holds,
 * null where not known; judged: by the server, as it is.
 * @typedef {Drawn & { directions: Pixel[], middle: Pixel | null, judged: DrawnEnd | null }} Shown
 */

/** @type {EndName[]} */
export const ENDS = ["pick", "place"];

export class DrawnEnds {
  /** @type {Ends} as the server has them */
  #judged = { pick: null, place: null };
  /** @type {Record<EndName, Drawn | null>} on its way to the server */
  #mine = { pick: null, place: null };
  #sending = { pick: false, place: false };
  #send;
  #onChange;

  /**
   * @param {(end: EndName, drawn: Drawn) => Promise<unknown>} send tells the server; it always resolves
   * @param {() => void} onChange is called when what is shown changes by `put`
   */
  constructor(send, onChange) {
    this.#send = send;
    this.#onChange = onChange;
  }

  /**
   * Take the server's state; whether that ends a step: something was drawn, and nothing is any more.
   * @param {Draft} draft
   */
  take(draft) {
    /** @param {Ends} ends */
    const drawn = (ends) => ENDS.some((end) => ends[end]);
    const ended = drawn(this.#judged) && !drawn(draft);
    this.#judged = draft;
    return ended;
  }

  /**
   * What is drawn of an end.
   * @param {EndName} end
   * @returns {Shown | null}
   */
  shown(end) {
    const judged = this.#judged[end], mine = this.#mine[end];
    const drawn = mine ?? judged;
    if (!drawn) return null;
    const { box, rotation } = drawn;
    const sameBox = judged?.box.every((value, index) => value === box[index]);
    const middle = (sameBox && judged?.grasp?.centroid_pixel) || null;
    return { box, rotation, directions: judged?.directions ?? [], middle, judged: mine ? null : judged };
  }

  /**
   * Draw an end. Only the newest is sent while an answer is out, so that held keys do not queue.
   * @param {EndName} end
   * @param {Box} box
   * @param {number} rotation
   */
  async put(end, box, rotation) {
    this.#mine[end] = { box, rotation };
    this.#onChange();
    if (this.#sending[end]) return;
    this.#sending[end] = true;
    /** @type {Drawn | null} */
    let sent = null;
    for (let next = this.#mine[end]; next && next !== sent; next = this.#mine[end]) {
      sent = next;
      await this.#send(end, sent);
    }
    this.#sending[end] = false;
    this.#mine[end] = null;
    this.#onChange();
  }
}
