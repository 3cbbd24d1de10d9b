// The cards of the pick and the place beside the picture: how each end is drawn, and what to do next.

import { all, buttons, byId, one, press, say } from "./page.js";

/** @import { EndName, Primitive, View } from "./protocol" */
/** @import { Stage } from "./stage.js" */

/** @type {Record<Primitive, Record<EndName, string>>} */
const NAMES = {
  pick_place: { pick: "Pick", place: "Place" },
  sweep: { pick: "Start", place: "End" },
  fold: { pick: "Corner", place: "Onto" },
};
export const BUSY = ["planning", "executing", "recording", "proposing", "waiting_for_approval", "recovering"];

export class EndCards {
  #stage;

  /** @param {Stage} stage */
  constructor(stage) {
    this.#stage = stage;
    for (const { card, end } of endCards()) {
      one(".end-name", HTMLButtonElement, card).addEventListener("click", () => this.#stage.choose(end));
      for (const turn of buttons(".turn", card)) {
        turn.addEventListener("click", () => this.#stage.turn(end, Number(turn.dataset.turn)));
      }
    }
  }

  /**
   * Show both ends as they are drawn, and say what to do next.
   * @param {View} view
   */
  show(view) {
    for (const { card, end } of endCards()) {
      const shown = this.#stage.shown(end);
      const name = one(".end-name", HTMLButtonElement, card);
      const chosen = end === this.#stage.active;
      card.classList.toggle("chosen", chosen);
      press(name, chosen);
      if (name.lastChild) say(name.lastChild, ` ${NAMES[view.primitive]?.[end] ?? end}`);
      say(one(".end-angle", HTMLElement, card), shown ? `${shown.rotation * 360 / view.n_rotations}°` : "");
      for (const turn of buttons(".turn", card)) turn.disabled = !shown || !this.#stage.enabled || view.primitive === "sweep";
      const words = one(".end-words", HTMLElement, card);
      const bad = Boolean(shown?.judged && !shown.judged.grasp && !shown.judged.footprint.length);
      words.classList.toggle("bad", bad);
      say(words, shown ? `${bad ? "✗ " : ""}${this.#turning(view, end, shown.rotation)}${shown.judged?.words ?? "…"}` : "No box yet.");
    }
    say(byId("hint"), this.#hint(view));
  }

  /**
   * How far the object is turned on its way.
   * @param {View} view
   * @param {EndName} end
   * @param {number} rotation
   */
  #turning(view, end, rotation) {
    const pick = this.#stage.shown("pick");
    if (end === "pick" || !pick) return "";
    const turn = view.n_rotations;
    const ticks = (rotation - pick.rotation + turn + turn / 2) % turn - turn / 2;
    return `Turns it by ${ticks > 0 ? "+" : ""}${ticks * 360 / turn}°; `;
  }

  /** @param {View} view */
  #hint(view) {
    if (view.holder !== "me") return "";
    if (BUSY.includes(view.state) || !this.#stage.enabled) return "";
    if (!view.data_set) return "First open a data set in the panel.";
    const names = NAMES[view.primitive] ?? NAMES.pick_place;
    const { active } = this.#stage;
    const pick = this.#stage.shown("pick"), place = this.#stage.shown("place");
    if (!pick && !place) return `Drag a box around the ${names.pick.toLowerCase()} (A).`;
    if (pick && place && view.primitive === "sweep") return "The closed hand stands across its way. A new box replaces the chosen one.";
    if (pick && place) return "Look at the fingers' outline. The ring's knob turns them; boxes can be dragged by their middle, sides and corners.";
    const next = names[pick ? "place" : "pick"].toLowerCase();
    return `Drag the knob around box ${active === "pick" ? "A" : "B"} to turn the fingers, or drag a box around the ${next}.`;
  }
}

/** The cards of the pick and the place. */
function endCards() {
  return all(".end", HTMLElement, byId("ends")).map((card) => ({ card, end: /** @type {EndName} */ (card.dataset.end) }));
}
