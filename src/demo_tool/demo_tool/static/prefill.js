// The policy draws each step first, where a person wants that: it is asked once a step, and its proposal is drawn.

import { input } from "./page.js";

/** @import { Call, View } from "./protocol" */

const REMEMBERED = "demonstrate.prefill";
const RETRY_MS = 1000;

export class Prefill {
  #call;
  #tell;
  #asked = ""; // the step that it was asked about last
  #drawn = ""; // the step whose proposal was drawn: one that a person clears stays away

  /**
   * @param {Call} call
   * @param {(error: unknown) => void} tell
   */
  constructor(call, tell) {
    this.#call = call;
    this.#tell = tell;
    const wanted = input("prefill");
    wanted.checked = localStorage.getItem(REMEMBERED) === "yes";
    wanted.addEventListener("change", () => {
      localStorage.setItem(REMEMBERED, wanted.checked ? "yes" : "no");
      this.#asked = this.#drawn = "";
    });
  }

  /**
   * @param {View} view
   * @param {boolean} open whether there is a connection
   */
  show(view, open) {
    const wanted = input("prefill");
    wanted.disabled = !open || view.holder !== "me";
    const { data_set: dataSet, instruction, episode, draft, policy, recorded } = view;
    if (wanted.disabled || !wanted.checked || view.state !== "ready" || !dataSet || !instruction) return;
    const step = JSON.stringify([dataSet, recorded, episode?.name, episode?.steps.length, instruction]);
    if (draft.pick || draft.place) {
      if (!this.#asked) this.#asked = this.#drawn = step; // drawn before this page was loaded: what is cleared stays away
      return;
    }
    if (step !== this.#asked) {
      this.#asked = step;
      this.#call("propose", { text: instruction }).catch((error) => this.#tryAgain(error));
    } else if (policy.proposal?.instruction === instruction && step !== this.#drawn) {
      this.#drawn = step;
      this.#call("correct").catch((error) => this.#tryAgain(error));
    }
  }

  /**
   * What is refused just now, as while a picture is old, is asked for again.
   * @param {unknown} error
   */
  #tryAgain(error) {
    this.#tell(error);
    setTimeout(() => { this.#asked = this.#drawn = ""; }, RETRY_MS);
  }
}
