// Where the steps of the data set's finished episodes were, as dots on the picture: what is covered, and what is not.

import { button, byId, press } from "./page.js";

/** @import { Camera, Covered } from "./protocol" */

const DOT = 0.005; // radius as a share of the picture's width

export class CoveredPlaces {
  #svg = byId("covered", SVGSVGElement);
  #shown = "";
  #wanted = false;

  constructor() {
    button("show-covered").addEventListener("click", () => {
      this.#wanted = !this.#wanted;
      press(button("show-covered"), this.#wanted);
      this.#svg.toggleAttribute("hidden", !this.#wanted);
    });
  }

  /**
   * @param {Covered} covered
   * @param {Camera} camera
   */
  show(covered, { width, height }) {
    const news = JSON.stringify([covered, width, height]);
    if (this.#shown === news || !width) return;
    this.#shown = news;
    this.#svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    this.#svg.replaceChildren(...(/** @type {const} */ (["pick", "place"])).flatMap((end) => covered[end].map(([row, column]) => {
      const dot = document.createElementNS("http://www.w3.org/2000/svg", "circle");
      for (const [name, value] of Object.entries({ cx: column, cy: row, r: DOT * width, class: end })) dot.setAttribute(name, String(value));
      return dot;
    })));
  }
}
