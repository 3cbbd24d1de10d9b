// STOP: the button, the space bar, and Escape pressed twice.

import { button, isTextField } from "./page.js";

const TWICE_MS = 700;

/** @param {() => void} stop */
export function setUpStopping(stop) {
  const control = button("stop");
  const act = () => {
    control.classList.add("pressed");
    setTimeout(() => control.classList.remove("pressed"), 400);
    stop();
  };
  control.addEventListener("pointerdown", (event) => {
    if (event.button === 0) act(); // at the press, not at the release
  });
  control.addEventListener("click", (event) => {
    if (event.detail === 0) act(); // by keys or a screen reader: no pointer came before
  });

  let escaped = -Infinity;
  window.addEventListener("keydown", (event) => {
    if (event.key === " " && !isTextField(event.target)) {
      event.preventDefault();
      event.stopPropagation();
      if (!event.repeat) act();
    } else if (event.key === "Escape" && !event.repeat) {
      if (isTextField(event.target)) event.target.blur();
      if (event.timeStamp - escaped < TWICE_MS) act();
      escaped = event.timeStamp;
    }
  }, { capture: true });
  window.addEventListener("keyup", (event) => {
    if (event.key === " " && !isTextField(event.target)) event.preventDefault(); // it presses no button
  }, { capture: true });
}
