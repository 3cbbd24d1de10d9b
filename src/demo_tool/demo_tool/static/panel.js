// The panel beside the picture: instruction, primitive, both ends, execute, the episode, the policy.

import { askFirst, byId, element, press, say, suggest } from "./page.js";

const NAMES = {
  pick_place: { pick: "Pick", place: "Place" },
  sweep: { pick: "Start", place: "End" },
  fold: { pick: "Corner", place: "Onto" },
};
const BUSY = ["planning", "executing", "recording", "proposing"];
const TYPING_MS = 500;
const LONGEST_INSTRUCTION = 500;

export class Panel {
  #call;
  #stage;
  #view = null;
  #typing = 0; // the timer that sends what was typed
  #askingDataSet = false;

  constructor(call, stage) {
    this.#call = call;
    this.#stage = stage;
    stage.addEventListener("change", () => this.#showEnds());
    stage.addEventListener("clear", () => this.#do("clear"));
    this.#listenToFields();
    this.#listenToButtons();
  }

  /** Say how something ended. */
  answer(ok, words) {
    const place = byId("answer");
    place.dataset.ok = ok;
    say(place, words && !ok ? `✗ ${words}` : words);
  }

  /** Offer the choice of a data set, though one is open. */
  askDataSet() {
    this.#askingDataSet = true;
    this.#showDataSet();
    byId("data-set").focus();
  }

  disable() {
    for (const control of document.querySelectorAll(".panel button, .panel input, #instruction")) control.disabled = true;
  }

  show(view, open) {
    const before = this.#view;
    this.#view = { ...view };
    const mine = open && view.holder === "me";
    const idle = mine && !BUSY.includes(view.state);
    this.#enable(mine, idle, view);
    this.#showInstruction(view);
    this.#showDataSet();
    this.#showEpisode(view);
    this.#showPolicy(view);
    this.#showEnds();
    this.#showPlan(view);
    for (const button of byId("primitive").children) press(button, button.dataset.primitive === view.primitive);
    if (!before || before.last !== view.last || before.state !== view.state) this.#showLast(view);
  }

  /** What was said last, unless it stands beside a box, in the verdict or at the top already. */
  #showLast({ last, draft, words, state, plan }) {
    if (BUSY.includes(state) || (plan && last.words.endsWith(plan.words))) {
      this.answer(true, "");
      return;
    }
    const beside = [draft.pick?.words, draft.place?.words].filter(Boolean);
    const said = beside.some((text) => last.words.endsWith(text)) || words.toLowerCase().startsWith(last.words.toLowerCase());
    this.answer(last.ok, said ? "" : last.words);
  }

  #enable(mine, idle, view) {
    const { pick, place } = view.draft;
    const steps = view.episode?.steps.length ?? 0;
    const whole = idle && pick && place && view.data_set && view.instruction;
    const allowed = {
      instruction: mine, execute: whole && view.state !== "stopped", "record-only": whole,
      preview: idle && pick && place && view.state !== "stopped", clear: idle && (pick || place),
      undo: idle && steps > 0, success: mine && view.episode, failure: mine && view.episode,
      "next-episode": idle && steps > 0, discard: idle && view.episode,
      ask: idle && view.instruction && view.state !== "stopped", correct: idle && view.policy.proposal,
    };
    for (const [id, may] of Object.entries(allowed)) byId(id).disabled = !may;
    for (const button of document.querySelectorAll("#primitive button, #data-set-card button")) button.disabled = !idle;
    for (const button of document.querySelectorAll(".end-name")) button.disabled = !idle;
    byId("data-set").disabled = !idle;
  }

  // the step

  #showInstruction(view) {
    const field = byId("instruction");
    suggest(byId("history"), view.history);
    if (!this.#typing && document.activeElement !== field) field.value = view.instruction;
  }

  #showEnds() {
    if (!this.#view) return;
    for (const card of byId("ends").children) {
      const end = card.dataset.end;
      const shown = this.#stage.shown(end);
      const name = NAMES[this.#view.primitive]?.[end] ?? end;
      const chosen = end === this.#stage.active;
      card.classList.toggle("chosen", chosen);
      press(card.querySelector(".end-name"), chosen);
      say(card.querySelector(".end-name").lastChild, ` ${name}`);
      say(card.querySelector(".end-angle"), shown ? `${shown.rotation * 360 / this.#view.n_rotations}°` : "");
      for (const button of card.querySelectorAll(".turn")) button.disabled = !shown || !this.#stage.enabled || this.#view.primitive === "sweep";
      const words = card.querySelector(".end-words");
      const bad = Boolean(shown?.judged && !shown.judged.grasp && !shown.judged.footprint.length);
      words.classList.toggle("bad", bad);
      say(words, shown ? `${bad ? "✗ " : ""}${this.#turning(end, shown.rotation)}${shown.judged?.words ?? "…"}` : "No box yet.");
    }
    say(byId("hint"), this.#hint());
  }

  /** How far the object is turned on its way. */
  #turning(end, rotation) {
    const pick = this.#stage.shown("pick");
    if (end === "pick" || !pick) return "";
    const all = this.#view.n_rotations;
    const ticks = (rotation - pick.rotation + all + all / 2) % all - all / 2;
    return `Turns it by ${ticks > 0 ? "+" : ""}${ticks * 360 / all}°; `;
  }

  #hint() {
    const view = this.#view;
    if (view.holder !== "me") return "";
    if (BUSY.includes(view.state) || !this.#stage.enabled) return "";
    if (!view.data_set) return "First open a data set in the panel.";
    const names = NAMES[view.primitive] ?? NAMES.pick_place;
    const { active } = this.#stage;
    const pick = this.#stage.shown("pick"), place = this.#stage.shown("place");
    if (!pick && !place) return `Drag a box around the ${names.pick.toLowerCase()} (A).`;
    if (pick && place && view.primitive === "sweep") return "The closed hand stands across its way. A new box replaces the chosen one.";
    if (pick && place) return "Look at the fingers' outline. A click around a box turns them; a new box replaces the chosen one.";
    const next = names[pick ? "place" : "pick"].toLowerCase();
    return `Click around box ${active === "pick" ? "A" : "B"} to turn the fingers, or drag the ${next} box.`;
  }

  #showPlan({ plan, state, phase, progress }) {
    const place = byId("plan");
    place.hidden = !plan;
    if (plan) {
      place.classList.toggle("bad", !plan.reachable);
      say(place, `${plan.reachable ? "✓ Reachable" : "✗ Not reachable"}: ${plan.words}`);
    }
    const bar = byId("progress");
    bar.hidden = state !== "executing";
    bar.value = progress ?? 0;
    bar.setAttribute("aria-label", phase || "progress");
  }

  // the episode and the policy

  #showEpisode({ episode, verdict }) {
    const steps = episode?.steps ?? [];
    say(byId("step-title"), `Instruction of step ${steps.length + 1}`);
    say(byId("episode-title"), episode ? `Episode, ${steps.length} ${steps.length === 1 ? "step" : "steps"}` : "Episode");
    const texts = steps.map((step) => `${step.instruction || "(no instruction)"}: ${step.outcome}`);
    const list = byId("steps");
    if (Array.from(list.children, (item) => item.textContent).join("\n") !== texts.join("\n")) {
      list.replaceChildren(...texts.map((text) => element("li", {}, text)));
    }
    press(byId("success"), verdict === true);
    press(byId("failure"), verdict === false);
  }

  #showPolicy({ policy }) {
    const { proposal } = policy;
    const sure = typeof proposal?.confidence === "number" ? `, ${Math.round(100 * proposal.confidence)} % sure` : "";
    say(byId("policy-words"), proposal
      ? `It has a proposal${sure}. Correct it: it is drawn on the picture, and you change what is wrong.`
      : policy.words);
  }

  // the data set

  #showDataSet() {
    const view = this.#view;
    if (!view) return;
    suggest(byId("data-sets"), view.data_sets);
    byId("data-set-card").hidden = Boolean(view.data_set) && !this.#askingDataSet;
  }

  // what a person does

  #listenToFields() {
    const field = byId("instruction");
    field.addEventListener("input", () => {
      clearTimeout(this.#typing);
      this.#typing = setTimeout(() => this.#sendInstruction(), TYPING_MS);
    });
    field.addEventListener("change", () => this.#sendInstruction());
    field.addEventListener("keydown", (event) => {
      if (event.key === "Enter") field.blur();
    });
    byId("data-set-card").addEventListener("submit", (event) => {
      event.preventDefault();
      const name = byId("data-set").value.trim();
      byId("data-set").blur();
      this.#do("open_data_set", { name }).then((ok) => {
        this.#askingDataSet = this.#askingDataSet && !ok;
        this.#showDataSet();
      });
    });
  }

  #listenToButtons() {
    const on = (id, act) => byId(id).addEventListener("click", act);
    on("execute", () => this.#act("execute"));
    on("record-only", () => this.#act("record"));
    on("preview", () => this.#act("preview"));
    on("clear", () => this.#do("clear"));
    on("undo", () => this.#do("undo"));
    on("success", () => this.#do("mark", { success: this.#view.verdict === true ? null : true }));
    on("failure", () => this.#do("mark", { success: this.#view.verdict === false ? null : false }));
    on("next-episode", () => this.#do("end_episode"));
    askFirst(byId("discard"), "Discard: sure?", () => this.#do("discard_episode"));
    on("ask", () => this.#act("propose"));
    on("correct", () => this.#do("correct"));
    for (const button of byId("primitive").children) {
      button.addEventListener("click", () => this.#do("primitive", { name: button.dataset.primitive }));
    }
    for (const card of byId("ends").children) {
      card.querySelector(".end-name").addEventListener("click", () => this.#stage.choose(card.dataset.end));
      for (const button of card.querySelectorAll(".turn")) {
        button.addEventListener("click", () => this.#stage.turn(card.dataset.end, Number(button.dataset.turn)));
      }
    }
  }

  /** A command that goes by the instruction: what was just typed is sent first. */
  async #act(command) {
    await this.#sendInstruction();
    await this.#do(command);
  }

  async #sendInstruction() {
    clearTimeout(this.#typing);
    const text = byId("instruction").value;
    if (text.length > LONGEST_INSTRUCTION) {
      this.answer(false, `The instruction has ${text.length} characters; at most ${LONGEST_INSTRUCTION} are taken.`);
    } else if (text !== this.#view?.instruction) {
      await this.#do("instruction", { text });
    }
    this.#typing = 0;
  }

  /** Whether it was obeyed; what was said comes with the next state. */
  async #do(command, args = {}) {
    try {
      const answer = await this.#call(command, args);
      return true;
    } catch (error) {
      this.answer(false, error.message);
      return false;
    }
  }
}
