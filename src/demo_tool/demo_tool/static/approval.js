// The bar of a plan that waits for a person: its id, why an approval was not taken, and the button and keys that approve.

import { button, byId, say } from "./page.js";

/** @import { View } from "./protocol" */

export class ApprovalBar {
  #plan = ""; // that may be approved here
  #approve;

  /** @param {(plan: string) => void} approve is given the id that was shown */
  constructor(approve) {
    this.#approve = approve;
    button("approve").addEventListener("click", () => this.#act());
    window.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" || !event.ctrlKey || !this.#plan) return;
      event.preventDefault();
      event.stopPropagation(); // it is no Enter for what has the focus
      if (!event.repeat) this.#act();
    }, { capture: true });
  }

  /**
   * @param {View} view
   * @param {boolean} open whether there is a connection
   */
  show({ approval, holder }, open) {
    this.#plan = approval && !approval.asked && holder === "me" && open ? approval.plan : "";
    byId("approval").hidden = !approval;
    button("approve").disabled = !this.#plan;
    if (!approval) return;
    say(byId("approval-plan"), approval.plan);
    say(byId("approval-words"), wordsFor(approval, holder));
  }

  disable() {
    this.#plan = "";
    button("approve").disabled = true;
  }

  #act() {
    if (this.#plan) this.#approve(this.#plan);
  }
}

/**
 * @param {NonNullable<View["approval"]>} approval
 * @param {View["holder"]} holder
 */
function wordsFor({ asked, words }, holder) {
  if (holder !== "me") return "Only the page that holds the arm can approve it.";
  if (asked) return "The approval is on its way.";
  return words ? `✗ Not approved: ${words}` : "";
}
