// Keys that press the buttons of the record page: the letter that a button names in aria-keyshortcuts.

import { button, buttons, byId, isTextField } from "./page.js";

const LETTER = /^[A-Z]$/;

/** Let each letter press its button, but not where it is text, a browser's own key, or held down. */
export function setUpShortcuts() {
  /** @type {Map<string, HTMLButtonElement>} */
  const pressed = new Map();
  for (const control of buttons("#record [aria-keyshortcuts]")) {
    const key = control.getAttribute("aria-keyshortcuts") ?? "";
    if (LETTER.test(key)) pressed.set(key, button(control.id));
  }
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.repeat || isTextField(event.target)) return;
    if (event.key === "Enter" && event.target instanceof HTMLInputElement && event.target.type === "checkbox") {
      event.preventDefault(); // else a form that the box is in would be sent
      event.target.click(); // the space bar, which ticks elsewhere, stops
    }
    if (byId("record").hidden) return;
    pressed.get(event.key.toUpperCase())?.click(); // a disabled button takes no click
  });
}
