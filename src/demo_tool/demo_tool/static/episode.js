// One recorded episode: its steps as pictures, and what can be changed about it.

import { motionControls } from "./motion.js";
import { element, LONGEST_INSTRUCTION, press } from "./page.js";

/** @import { Edit, Episode, Step } from "./protocol" */

export class EpisodeView {
  #place;
  #edit;
  /** @type {Episode | null} */
  #episode = null;
  #dataSet = "";
  #step = 0;

  /**
   * @param {HTMLElement} place
   * @param {Edit} edit
   */
  constructor(place, edit) {
    this.#place = place;
    this.#edit = edit;
  }

  get name() {
    return this.#episode?.name ?? null;
  }

  /**
   * @param {Episode} episode
   * @param {string} dataSet
   */
  open(episode, dataSet) {
    const again = episode.name === this.name;
    this.#episode = episode;
    this.#dataSet = dataSet;
    this.#step = again ? Math.min(this.#step, episode.steps.length - 1) : 0;
    this.#place.hidden = false;
    this.#draw(episode);
    if (!again) {
      this.#place.scrollIntoView({ block: "start" });
      this.#place.querySelector("h2")?.focus({ preventScroll: true });
    }
  }

  close() {
    this.#episode = null;
    this.#place.hidden = true;
    this.#place.replaceChildren();
  }

  /** @param {Episode} episode */
  #draw(episode) {
    const { name, complaints, steps } = episode;
    this.#place.replaceChildren(
      element("h2", { tabIndex: -1 }, `Episode ${name}`),
      ...complaints.map((text) => element("p", { className: "bad" }, text)),
      ...(steps.length ? this.#stepParts(episode) : [element("p", {}, "It has no whole step.")]),
      this.#marks(episode),
      ...(steps.length ? [this.#trim(episode)] : []),
      this.#ending(episode));
  }

  /** @param {Episode} episode */
  #stepParts(episode) {
    const { name, steps } = episode;
    const step = steps[this.#step];
    const address = ["/episode", this.#dataSet, name, `${step.step}`].map((part, i) => i ? encodeURIComponent(part) : part).join("/");
    const picture = element("img", { src: `${address}.jpg`, alt: `The table before step ${step.step + 1}` });
    const back = this.#button("‹ Before", () => this.#go(episode, -1), "", this.#step === 0);
    const on = this.#button("Next ›", () => this.#go(episode, 1), "", this.#step === steps.length - 1);
    const among = step.step === this.#step ? `of ${steps.length}` : `(${this.#step + 1} of the ${steps.length} that stay)`;
    const words = `Step ${step.step + 1} ${among}: ${step.outcome}${step.message ? ` (${step.message})` : ""}`;
    return [
      picture,
      ...(step.frames ? [motionControls(picture, address, step)] : []),
      element("div", { className: "row wrap" }, back, element("span", {}, words), on),
      this.#relabel(name, step),
    ];
  }

  /**
   * @param {string} name
   * @param {Step} step
   */
  #relabel(name, step) {
    const id = "relabel-text";
    const text = element("input", { id, value: step.instruction, maxLength: LONGEST_INSTRUCTION, autocomplete: "off" });
    const one = this.#button("This step", () => this.#edit("relabel", { name, text: text.value, step: step.step }), "edits");
    const all = this.#button("All steps", () => this.#edit("relabel", { name, text: text.value }), "edits");
    return element("div", { className: "relabel" }, element("label", { htmlFor: id }, "Instruction"), text,
      element("div", { className: "row wrap" }, element("span", {}, "Write it to"), one, all));
  }

  /** @param {Episode} episode */
  #marks({ name, success }) {
    /** @type {[words: string, value: boolean | null][]} */
    const verdicts = [["✓ Success", true], ["✗ Failure", false], ["Not marked", null]];
    const choices = verdicts.map(([words, value]) => {
      const button = this.#button(words, () => this.#edit("mark", { episode: name, success: value }), "edits");
      press(button, (success ?? null) === value);
      return button;
    });
    return element("div", { className: "choice", role: "group", "aria-label": "How the episode ended" }, ...choices);
  }

  /**
   * By the steps' numbers as recorded, which start at 0; a person counts from 1.
   * @param {Episode} episode
   */
  #trim({ name, steps }) {
    const numbers = steps.map(({ step }) => step);
    /** @type {(label: string, chosen: number | undefined) => HTMLSelectElement} */
    const select = (label, chosen) => element("select", { "aria-label": label },
      ...numbers.map((number) => element("option", { value: String(number), selected: number === chosen }, String(number + 1))));
    const first = select("First step that stays", numbers[0]), last = select("Last step that stays", numbers.at(-1));
    /** @type {(from: number | null, to: number | null) => Promise<void>} */
    const trim = (from, to) => this.#edit("trim", { name, first: from, last: to });
    return element("div", { className: "row wrap" }, "Keep steps", first, "to", last,
      this.#button("Trim", () => trim(Number(first.value), Number(last.value)), "edits"),
      this.#button("Keep all again", () => trim(null, null), "edits"));
  }

  /** @param {Episode} episode */
  #ending({ name }) {
    return element("div", { className: "row wrap" },
      this.#button("Add steps to it", () => this.#edit("continue_episode", { name }), "edits"),
      this.#button("Move to the trash", () => this.#edit("delete", { name }), "edits"),
      this.#button("Close", () => this.close()));
  }

  /**
   * @param {Episode} episode
   * @param {number} steps
   */
  #go(episode, steps) {
    this.#step += steps;
    this.#draw(episode);
  }

  /**
   * @param {string} words
   * @param {() => void} act
   */
  #button(words, act, className = "", disabled = false) {
    const button = element("button", { type: "button", className, disabled }, words);
    button.addEventListener("click", act);
    return button;
  }
}
