// Data sets as wholes: another one's episodes into the open one, and the open one dealt out to new ones.

import { all, buttons, byId, element } from "./page.js";

/** @import { Edit } from "./protocol" */

const PARTS = [["train", "80"], ["val", "20"], ["", ""]]; // name and per cent that are suggested

export class DataSets {
  #shown = "";

  /**
   * @param {Edit} edit
   * @param {(words: string) => void} refuse says why nothing is asked
   */
  constructor(edit, refuse) {
    byId("parts").replaceChildren(...PARTS.map(([name, percent], index) => element("span", { className: "part" },
      element("input", { value: name, maxLength: 80, autocomplete: "off", spellcheck: false, "aria-label": `Name of part ${index + 1}` }),
      element("input", { type: "number", min: "1", max: "100", step: "any", value: percent, "aria-label": `Per cent of part ${index + 1}` }),
      "%")));
    byId("merge").addEventListener("submit", (event) => {
      event.preventDefault();
      edit("merge", { other: byId("merge-other", HTMLSelectElement).value });
    });
    byId("split").addEventListener("submit", (event) => {
      event.preventDefault();
      const rows = Array.from(byId("parts").children, (row) => Array.from(row.querySelectorAll("input"), ({ value }) => value.trim()));
      const filled = rows.filter(([name, percent]) => name || percent);
      const half = filled.find(([name, percent]) => !name || !percent);
      if (!filled.length || half) refuse("Each part needs a name and a share in per cent.");
      else edit("split", { parts: filled.map(([name, percent]) => [name, Number(percent) / 100]) });
    });
  }

  /**
   * @param {string[]} names of all data sets
   * @param {string | null} open the name of the one that is open
   * @param {boolean} mine whether this page may edit
   */
  show(names, open, mine) {
    const others = names.filter((name) => name !== open);
    const news = JSON.stringify([others, open, mine]);
    if (this.#shown === news) return;
    this.#shown = news;
    byId("merge-other").replaceChildren(...others.map((name) => element("option", { value: name }, name)));
    byId("split-name").textContent = open ?? "…";
    byId("merge-other", HTMLSelectElement).disabled = !(mine && open && others.length);
    for (const control of buttons("#merge button")) control.disabled = !(mine && open && others.length);
    for (const control of all("#split input", HTMLInputElement)) control.disabled = !(mine && open);
    for (const control of buttons("#split button")) control.disabled = !(mine && open);
  }
}
