// One recorded episode: its steps as pictures, and what can be changed about it.

import { element, press } from "./page.js";

const LONGEST_INSTRUCTION = 500;
const MOST_STEPS = 100000;

export class EpisodeView {
  #place;
  #edit;
  #episode = null;
  #dataSet = "";
  #step = 0;

  /** edit(command, arguments) asks the station and shows what it says. */
  constructor(place, edit) {
    this.#place = place;
    this.#edit = edit;
  }

  get name() {
    return this.#episode?.name ?? null;
  }

  open(episode, dataSet) {
    const again = episode.name === this.name;
    this.#episode = episode;
    this.#dataSet = dataSet;
    this.#step = again ? Math.min(this.#step, episode.steps.length - 1) : 0;
    this.#place.hidden = false;
    this.#draw();
    if (!again) {
      this.#place.scrollIntoView({ block: "start" });
      this.#place.querySelector("h2").focus({ preventScroll: true });
    }
  }

  close() {
    this.#episode = null;
    this.#place.hidden = true;
    this.#place.replaceChildren();
  }

  #draw() {
    const { name, complaints, steps } = this.#episode;
    this.#place.replaceChildren(
      element("h2", { tabIndex: -1 }, `Episode ${name}`),
      ...complaints.map((text) => element("p", { className: "bad" }, text)),
      ...(steps.length ? this.#stepParts() : [element("p", {}, "It has no whole step.")]),
      this.#marks(),
      ...(steps.length ? [this.#trim()] : []),
      this.#ending());
  }

  #stepParts() {
    const { name, steps } = this.#episode;
    const step = steps[this.#step];
    const address = ["/episode", this.#dataSet, name, `${this.#step}.jpg`].map((part, i) => i ? encodeURIComponent(part) : part);
    const picture = element("img", { src: address.join("/"), alt: `The table before step ${this.#step + 1}` });
    const back = this.#button("‹ Before", () => this.#go(-1), "", this.#step === 0);
    const on = this.#button("Next ›", () => this.#go(1), "", this.#step === steps.length - 1);
    const words = `Step ${this.#step + 1} of ${steps.length}: ${step.outcome}${step.message ? ` (${step.message})` : ""}`;
    return [
      picture,
      element("div", { className: "row wrap" }, back, element("span", {}, words), on),
      this.#relabel(step),
    ];
  }

  #relabel(step) {
    const id = "relabel-text";
    const text = element("input", { id, value: step.instruction, maxLength: LONGEST_INSTRUCTION, autocomplete: "off" });
    const { name } = this.#episode;
    const one = this.#button("This step", () => this.#edit("relabel", { name, text: text.value, step: step.step }), "edits");
    const all = this.#button("All steps", () => this.#edit("relabel", { name, text: text.value }), "edits");
    return element("div", { className: "relabel" }, element("label", { htmlFor: id }, "Instruction"), text,
      element("div", { className: "row wrap" }, element("span", {}, "Write it to"), one, all));
  }

  #marks() {
    const { name, success } = this.#episode;
    const choices = [["✓ Success", true], ["✗ Failure", false], ["Not marked", null]].map(([words, value]) => {
      const button = this.#button(words, () => this.#edit("mark", { episode: name, success: value }), "edits");
      press(button, (success ?? null) === value);
      return button;
    });
    return element("div", { className: "choice", role: "group", "aria-label": "How the episode ended" }, ...choices);
  }

  /** By the steps' numbers as recorded, which start at 0; a person counts from 1. */
  #trim() {
    const { name, steps } = this.#episode;
    const numbers = steps.map(({ step }) => step);
    const select = (label, chosen) => element("select", { "aria-label": label },
      ...numbers.map((number) => element("option", { value: String(number), selected: number === chosen }, String(number + 1))));
    const first = select("First step that stays", numbers[0]), last = select("Last step that stays", numbers.at(-1));
    const trim = (from, to) => this.#edit("trim", { name, first: from, last: to });
    return element("div", { className: "row wrap" }, "Keep steps", first, "to", last,
      this.#button("Trim", () => trim(Number(first.value), Number(last.value)), "edits"),
      this.#button("Keep all again", () => trim(0, MOST_STEPS), "edits"));
  }

  #ending() {
    const { name } = this.#episode;
    return element("div", { className: "row wrap" },
      this.#button("Move to the trash", () => this.#edit("delete", { name }), "edits"),
      this.#button("Close", () => this.close()));
  }

  #go(steps) {
    this.#step += steps;
    this.#draw();
  }

  #button(words, act, className = "", disabled = false) {
    const button = element("button", { type: "button", className, disabled }, words);
    button.addEventListener("click", act);
    return button;
  }
}
