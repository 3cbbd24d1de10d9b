// Small things that every part of the page uses. Texts from outside become text nodes, never markup.

export const byId = (id) => document.getElementById(id);

/** An element with properties and children; strings become text. */
export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.includes("-")) made.setAttribute(name, value);
    else made[name] = value;
  }
  made.append(...children);
  return made;
}

/** Set a text only where it differs, so that screen readers do not repeat it. */
export function say(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

/** Fill a datalist, only where it differs. */
export function suggest(list, texts) {
  const known = Array.from(list.children, (option) => option.value);
  if (known.length === texts.length && known.every((text, index) => text === texts[index])) return;
  list.replaceChildren(...texts.map((value) => element("option", { value })));
}

export function press(button, pressed) {
  button.setAttribute("aria-pressed", String(pressed));
}

/** A button that acts on its second press only; the first one asks. */
export function askFirst(button, question, act) {
  const name = button.textContent;
  let timer = 0;
  const calm = () => {
    clearTimeout(timer);
    timer = 0;
    button.textContent = name;
    button.classList.remove("asks");
  };
  button.addEventListener("blur", calm);
  button.addEventListener("click", () => {
    if (timer) {
      calm();
      act();
      return;
    }
    button.textContent = question;
    button.classList.add("asks");
    timer = setTimeout(calm, 5000);
  });
}

/** Whether keys are text here. */
export function isTextField(node) {
  return node instanceof HTMLInputElement || node instanceof HTMLTextAreaElement || node instanceof HTMLSelectElement;
}
