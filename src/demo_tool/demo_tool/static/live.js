// Live pictures by long poll: the next is asked for when the last has arrived, so a slow link gets fewer, not older ones.

const RETRY_MS = 1000;
const SMOOTHING = 0.4;

/** @typedef {{ ageMs: number, perSecond: number, width: number }} Arrived */

export class LivePicture {
  #canvas;
  #onPicture;
  #onProblem;
  #name = "";
  /** @type {AbortController | null} */
  #running = null;

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {(arrived: Arrived) => void} onPicture is called after each
   * @param {(words: string) => void} onProblem is told why there is none
   */
  constructor(canvas, onPicture, onProblem) {
    this.#canvas = canvas;
    this.#onPicture = onPicture;
    this.#onProblem = onProblem;
    document.addEventListener("visibilitychange", () => this.show(this.#name));
  }

  /**
   * Show the named picture from now on; an empty name shows none.
   * @param {string} name
   */
  show(name) {
    this.#running?.abort();
    this.#running = null;
    this.#name = name;
    if (name && !document.hidden) {
      this.#running = new AbortController();
      this.#poll(name, this.#running.signal);
    }
  }

  /**
   * @param {string} name
   * @param {AbortSignal} signal
   */
  async #poll(name, signal) {
    let after = 0, perSecond = 0, last = 0;
    /** @type {string | null} */
    let level = null;
    /** @type {number | null} */
    let took = null;
    while (!signal.aborted) {
      try {
        const width = Math.max(160, Math.ceil(this.#canvas.clientWidth * devicePixelRatio));
        const known = level === null || took === null ? "" : `&level=${level}&took=${Math.round(took)}`;
        /** @type {Response} */
        const answer = await fetch(`/picture/${name}.jpg?after=${after}&width=${Math.min(width, 4096)}${known}`, { signal });
        if (answer.status === 204) continue;
        if (!answer.ok) {
          const words = await answer.text();
          if (!signal.aborted) this.#onProblem(words);
          throw new Error(words);
        }
        const began = performance.now();
        const file = await answer.blob();
        /** @type {number} */
        const ms = performance.now() - began;
        took = took === null ? ms : took + SMOOTHING * (ms - took);
        const picture = await createImageBitmap(file);
        if (signal.aborted) return;
        this.#draw(picture);
        after = Number(answer.headers.get("X-Sequence"));
        level = answer.headers.get("X-Level");
        const now = performance.now();
        if (last) perSecond += 0.1 * (1000 / (now - last) - perSecond);
        last = now;
        const ageMs = Date.now() - Number(answer.headers.get("X-Stamp-Ns")) / 1e6;
        this.#onPicture({ ageMs, perSecond, width: picture.width });
        picture.close();
      } catch (error) {
        if (signal.aborted) return;
        await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
      }
    }
  }

  /** @param {ImageBitmap} picture */
  #draw(picture) {
    if (this.#canvas.width !== picture.width || this.#canvas.height !== picture.height) {
      this.#canvas.width = picture.width;
      this.#canvas.height = picture.height;
    }
    this.#canvas.getContext("2d")?.drawImage(picture, 0, 0);
  }
}
