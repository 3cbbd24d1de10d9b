// The panel beside the picture: instruction, primitive, both ends, execute, the episode, the policy.

import { BUSY, EndCards } from "./end_cards.js";
import { all, askFirst, button, buttons, byId, element, input, LONGEST_INSTRUCTION, press, say, suggest, wordsOf } from "./page.js";

/** @import { Call, CommandName, Given, Primitive, SeenDraft, View } from "./protocol" */
/** @import { Stage } from "./stage.js" */

const TYPING_MS = 500;
const ENOUGH = 50; // episodes from which a policy learns something new; after these, so many more

export class Panel {
  #call;
  #stage;
  #ends;
  /** @type {View | null} */
  #view = null;
  #open = false; // whether there is a connection
  #typing = 0; // the timer that sends what was typed
  /** @type {string | null} what stands in the field and was not taken by the server, refused or not sent yet */
  #typed = null;
  #askingDataSet = false;

  /**
   * @param {Call} call
   * @param {Stage} stage
   */
  constructor(call, stage) {
    this.#call = call;
    this.#stage = stage;
    this.#ends = new EndCards(stage);
    stage.addEventListener("change", () => this.#showEnds());
    stage.addEventListener("clear", () => this.#do("clear"));
    stage.addEventListener("point", (event) => this.#do("point", /** @type {CustomEvent} */ (event).detail));
    this.#listenToFields();
    this.#listenToButtons();
  }

  /**
   * Say how something ended.
   * @param {boolean} ok
   * @param {string} words
   */
  answer(ok, words) {
    const place = byId("answer");
    place.dataset.ok = String(ok);
    say(place, words && !ok ? `✗ ${words}` : words);
  }

  /** Offer the choice of a data set, though one is open. */
  askDataSet() {
    this.#askingDataSet = true;
    this.#showDataSet();
    byId("data-set").focus();
  }

  disable() {
    this.#open = false;
    for (const control of buttons(".panel button")) control.disabled = true;
    for (const control of all(".panel input, #instruction", HTMLInputElement)) control.disabled = true;
  }

  /**
   * @param {View} view
   * @param {boolean} open whether there is a connection
   */
  show(view, open) {
    const before = this.#view;
    this.#view = { ...view };
    this.#open = open;
    this.#showInstruction(view);
    this.#enable(view);
    this.#showDataSet();
    this.#showEpisode(view);
    this.#showPolicy(view);
    this.#showEnds();
    this.#showPlan(view);
    for (const choice of buttons("#primitive button")) press(choice, choice.dataset.primitive === view.primitive);
    if (!before || before.last !== view.last || before.state !== view.state) this.#showLast(view);
  }

  /**
   * What was said last, unless it stands beside a box, in the verdict or at the top already.
   * @param {View} view
   */
  #showLast({ last, draft, words, state, plan }) {
    if (BUSY.includes(state) || (plan && last.words.endsWith(plan.words))) {
      this.answer(true, "");
      return;
    }
    const said = [draft.pick, draft.place].some((end) => end?.words && last.words.endsWith(end.words)) || words.toLowerCase().startsWith(last.words.toLowerCase());
    this.answer(last.ok, said ? "" : last.words);
  }

  /** @param {View} view */
  #enable(view) {
    const mine = this.#open && view.holder === "me";
    const idle = mine && !BUSY.includes(view.state);
    const { pick, place } = view.draft;
    const text = (this.#typed ?? view.instruction).trim();
    const steps = view.episode?.steps.length ?? 0;
    const saved = view.unsaved === null;
    const whole = idle && saved && pick && place && view.data_set && text;
    const allowed = {
      execute: whole && view.state !== "stopped", "record-only": whole,
      preview: idle && pick && place && view.state !== "stopped", clear: idle && (pick || place),
      "save-again": idle, "drop-unsaved": idle, "restore-step": idle && saved,
      undo: idle && saved && steps > 0, success: mine && view.episode, failure: mine && view.episode,
      "next-episode": idle && saved && steps > 0, discard: idle && view.episode,
      "new-scene": idle && saved && steps === 0 && view.state !== "stopped",
      ask: idle && text && view.state !== "stopped", correct: idle && view.policy.proposal,
    };
    byId("new-scene").hidden = !view.scenes;
    for (const [id, may] of Object.entries(allowed)) button(id).disabled = !may;
    for (const control of buttons("#primitive button, #data-set-card button, .end-name")) control.disabled = !idle;
    input("instruction").disabled = !mine;
    input("data-set").disabled = !idle;
  }

  // the step

  /** @param {View} view */
  #showInstruction(view) {
    const field = input("instruction");
    suggest(byId("history", HTMLDataListElement), view.history);
    if (view.holder !== "me") this.#typed = null;
    if (this.#typed === null && document.activeElement !== field) field.value = view.instruction;
  }

  #showEnds() {
    if (this.#view) this.#ends.show(this.#view);
  }

  /** @param {View} view */
  #showPlan({ plan, state, phase, progress }) {
    const place = byId("plan");
    place.hidden = !plan;
    if (plan) {
      place.classList.toggle("bad", !plan.reachable);
      say(place, `${plan.reachable ? "✓ Reachable" : "✗ Not reachable"}: ${plan.words}`);
    }
    const bar = byId("progress", HTMLProgressElement);
    bar.hidden = state !== "executing";
    bar.value = progress ?? 0;
    bar.setAttribute("aria-label", phase || "progress");
  }

  // the episode and the policy

  /** @param {View} view */
  #showEpisode({ data_set: dataSet, recorded, episode, verdict, unsaved }) {
    byId("recorded").hidden = dataSet === null;
    say(byId("recorded"), `${recorded} of ${Math.max(1, Math.ceil(recorded / ENOUGH)) * ENOUGH} episodes are recorded.`);
    byId("unsaved").hidden = unsaved === null;
    say(byId("unsaved-words"), unsaved ?? "");
    byId("restore-step").hidden = !episode?.restorable;
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

  /** @param {View} view */
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
    suggest(byId("data-sets", HTMLDataListElement), view.data_sets);
    byId("data-set-card").hidden = Boolean(view.data_set) && !this.#askingDataSet;
  }

  // what a person does

  #listenToFields() {
    const field = input("instruction");
    field.addEventListener("input", () => {
      this.#typed = field.value;
      if (this.#view) this.#enable(this.#view);
      clearTimeout(this.#typing);
      this.#typing = setTimeout(() => this.#sendInstruction(), TYPING_MS);
    });
    field.addEventListener("change", () => this.#sendInstruction());
    field.addEventListener("keydown", (event) => {
      if (event.key === "Enter") field.blur();
    });
    byId("data-set-card").addEventListener("submit", (event) => {
      event.preventDefault();
      const name = input("data-set").value.trim();
      input("data-set").blur();
      this.#do("open_data_set", { name }).then((ok) => {
        this.#askingDataSet = this.#askingDataSet && !ok;
        this.#showDataSet();
      });
    });
  }

  #listenToButtons() {
    /** @type {(id: string, act: () => void) => void} */
    const on = (id, act) => byId(id).addEventListener("click", act);
    on("execute", () => this.#act("execute"));
    on("record-only", () => this.#act("record"));
    on("preview", () => this.#preview());
    on("clear", () => this.#do("clear"));
    on("undo", () => this.#do("undo"));
    on("restore-step", () => this.#do("restore_step"));
    on("save-again", () => this.#do("save_again"));
    askFirst(button("drop-unsaved"), "Drop it: sure?", () => this.#do("drop_unsaved"));
    on("success", () => this.#do("mark", { success: this.#view?.verdict === true ? null : true }));
    on("failure", () => this.#do("mark", { success: this.#view?.verdict === false ? null : false }));
    on("next-episode", () => this.#do("end_episode"));
    askFirst(button("discard"), "Discard: sure?", () => this.#do("discard_episode"));
    on("new-scene", () => this.#do("new_scene"));
    on("ask", () => this.#ask());
    on("correct", () => this.#do("correct"));
    for (const choice of buttons("#primitive button")) {
      const name = /** @type {Primitive} */ (choice.dataset.primitive);
      choice.addEventListener("click", () => this.#do("primitive", { name }));
    }
  }

  /**
   * The text and what is drawn travel with the command, as this page shows them: nothing moves unless both are taken.
   * @param {"execute" | "record"} command
   */
  async #act(command) {
    const text = this.#instruction(), draft = this.#draft();
    if (text !== null && draft) this.#took(text, await this.#do(command, { text, draft }));
  }

  async #ask() {
    const text = this.#instruction();
    if (text !== null) this.#took(text, await this.#do("propose", { text }));
  }

  async #preview() {
    const draft = this.#draft();
    if (draft) await this.#do("preview", { draft });
  }

  async #sendInstruction() {
    const text = this.#instruction();
    if (text === null) return;
    if (text === this.#view?.instruction) this.#took(text, true);
    else this.#took(text, await this.#do("instruction", { text }));
  }

  /** What stands in the field, or null where it is too long to be sent; that is said then. */
  #instruction() {
    clearTimeout(this.#typing);
    const text = input("instruction").value;
    if (text.length <= LONGEST_INSTRUCTION) return text;
    this.answer(false, `The instruction has ${text.length} characters; at most ${LONGEST_INSTRUCTION} are taken.`);
    return null;
  }

  /**
   * @param {string} text what was sent
   * @param {boolean} ok
   */
  #took(text, ok) {
    if (ok && this.#typed === text) this.#typed = null;
    if (this.#view) this.#showInstruction(this.#view);
  }

  /** @returns {SeenDraft | null} */
  #draft() {
    return this.#view && { primitive: this.#view.primitive, pick: this.#stage.seen("pick"), place: this.#stage.seen("place") };
  }

  /**
   * Whether it was obeyed; what was said comes with the next state.
   * @template {CommandName} Name
   * @param {Name} command
   * @param {Given<Name>} given
   */
  async #do(command, ...given) {
    try {
      await this.#call(command, ...given);
      return true;
    } catch (error) {
      this.answer(false, wordsOf(error));
      return false;
    }
  }
}
