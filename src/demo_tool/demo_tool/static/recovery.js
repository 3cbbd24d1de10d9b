// The bar of an arm that stands away from its ready pose, and the button that takes it back.

import { BUSY } from "./end_cards.js";
import { button, byId, say } from "./page.js";

/** @import { View } from "./protocol" */

/** @param {() => void} recover */
export function setUpRecovery(recover) {
  button("recover").addEventListener("click", recover);
}

/**
 * @param {View} view
 * @param {boolean} open whether there is a connection
 */
export function showRecovery({ away, state, holder }, open) {
  const recovering = state === "recovering";
  byId("away").hidden = !recovering && (!away || BUSY.includes(state));
  button("recover").disabled = !open || holder !== "me" || state === "stopped" || BUSY.includes(state);
  say(byId("away-words"), recovering ? "The arm goes back to its ready pose. STOP stops it." : wordsFor(state));
}

/** @param {View["state"]} state */
function wordsFor(state) {
  const next = state === "stopped"
    ? "Look at it, resume, then Recover takes it back."
    : "Recover moves it up and back, with what it holds.";
  return `The arm stands away from its ready pose. ${next}`;
}
