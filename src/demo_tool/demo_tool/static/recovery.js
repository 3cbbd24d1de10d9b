// The bars of an arm that stands away from its ready pose, or holds something, and the buttons that mend it.

import { BUSY } from "./end_cards.js";
import { button, byId, say } from "./page.js";

/** @import { View } from "./protocol" */

const BUTTONS = ["recover", "open-hand"];

/**
 * @param {() => void} recover
 * @param {() => void} openHand
 */
export function setUpRecovery(recover, openHand) {
  button("recover").addEventListener("click", recover);
  button("open-hand").addEventListener("click", openHand);
}

/**
 * @param {View} view
 * @param {boolean} open whether there is a connection
 */
export function showRecovery({ away, held_width: width, state, holder }, open) {
  const recovering = state === "recovering";
  byId("away").hidden = !recovering && (!away || BUSY.includes(state));
  byId("held").hidden = width === null || BUSY.includes(state);
  if (!open || holder !== "me" || state === "stopped" || BUSY.includes(state)) disableRecovery();
  else for (const id of BUTTONS) button(id).disabled = false;
  say(byId("away-words"), recovering ? "The arm goes back to its ready pose. STOP stops it." : wordsFor(state));
  say(byId("held-words"), `The hand still holds something ${Math.round(1000 * (width ?? 0))} mm wide. When it opens, that falls.`);
}

export function disableRecovery() {
  for (const id of BUTTONS) button(id).disabled = true;
}

/** @param {View["state"]} state */
function wordsFor(state) {
  const next = state === "stopped"
    ? "Look at it, resume, then Recover takes it back."
    : "Recover moves it up and back, with what it holds.";
  return `The arm stands away from its ready pose. ${next}`;
}
