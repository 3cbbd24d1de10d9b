// Keys that press the buttons of the record page: the letter that a button names in aria-keyshortcuts. Enter ticks a box.

import { button, buttons, byId, isTextField } from "./page.js";

const LETTER = /^[A-Z]$/;

/** Let each letter press its button, but not where it is text, a browser's own key, or held down; the space bar stops. */
export function setUpShortcuts() {
  /** @type {Map<string, HTMLButtonElement>} */
  const pressed = new Map();
  for (const control of buttons("#record [aria-keyshortcuts]")) {
    const key = control.getAttribute("aria-keyshortcuts") ?? "";
    if (LETTER.test(key)) pressed.set(key, button(control.id));
  }
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.repeat || isTextField(event.target)) return;
    const node = event.target;
    if (event.key === "Enter" && node instanceof HTMLInputElement && node.type === "checkbox") node.click();
    if (byId("record").hidden) return;
    pressed.get(event.key.toUpperCase())?.click(); // a disabled button takes no click
  });
}
