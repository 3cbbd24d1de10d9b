// Small things that every part of the page uses. Texts from outside become text nodes, never markup.

/** The characters that an instruction may have; test_page_types.py holds it against the server. */
export const LONGEST_INSTRUCTION = 500;

/**
 * The element of a selector, which the page has; kind: its class, an HTMLElement where none is named.
 * @template {Element} [T=HTMLElement]
 * @param {string} selector
 * @param {abstract new (...args: any[]) => T} [kind]
 * @param {ParentNode} [within]
 * @returns {T}
 */
export function one(selector, kind = /** @type {any} */ (HTMLElement), within = document) {
  const found = within.querySelector(selector);
  if (!(found instanceof kind)) throw new TypeError(`the page has no ${kind.name} ${selector}`);
  return found;
}

/**
 * @template {Element} [T=HTMLElement]
 * @param {string} id
 * @param {abstract new (...args: any[]) => T} [kind]
 * @returns {T}
 */
export const byId = (id, kind) => one(`#${id}`, kind);

/** @param {string} id */
export const button = (id) => byId(id, HTMLButtonElement);

/** @param {string} id */
export const input = (id) => byId(id, HTMLInputElement);

/**
 * The elements of a selector that are of a class.
 * @template {Element} T
 * @param {string} selector
 * @param {abstract new (...args: any[]) => T} kind
 * @param {ParentNode} [within]
 * @returns {T[]}
 */
export function all(selector, kind, within = document) {
  /** @type {T[]} */
  const found = [];
  for (const element of within.querySelectorAll(selector)) if (element instanceof kind) found.push(element);
  return found;
}

/**
 * @param {string} selector
 * @param {ParentNode} [within]
 */
export const buttons = (selector, within) => all(selector, HTMLButtonElement, within);

/**
 * An element with properties and children; strings become text.
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag
 * @param {Partial<HTMLElementTagNameMap[Tag]> & Record<`aria-${string}`, string>} [properties]
 * @param {...(Node | string)} children
 * @returns {HTMLElementTagNameMap[Tag]}
 */
export function element(tag, properties, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties ?? {})) {
    if (name.includes("-")) made.setAttribute(name, String(value));
    else Object.assign(made, { [name]: value });
  }
  made.append(...children);
  return made;
}

/**
 * Set a text only where it differs, so that screen readers do not repeat it.
 * @param {Node} place
 * @param {string} text
 */
export function say(place, text) {
  if (place.textContent !== text) place.textContent = text;
}

/**
 * Fill a datalist, only where it differs.
 * @param {HTMLDataListElement} list
 * @param {string[]} texts
 */
export function suggest(list, texts) {
  const known = Array.from(list.options, (option) => option.value);
  if (known.length === texts.length && known.every((text, index) => text === texts[index])) return;
  list.replaceChildren(...texts.map((value) => element("option", { value })));
}

/**
 * @param {Element} control
 * @param {boolean} pressed
 */
export function press(control, pressed) {
  control.setAttribute("aria-pressed", String(pressed));
}

/**
 * What an error says to a person.
 * @param {unknown} error
 */
export const wordsOf = (error) => error instanceof Error ? error.message : String(error);

/**
 * A button that acts on its second press only; the first one asks.
 * @param {HTMLButtonElement} control
 * @param {string} question
 * @param {() => void} act
 */
export function askFirst(control, question, act) {
  const name = control.textContent;
  let timer = 0;
  const calm = () => {
    clearTimeout(timer);
    timer = 0;
    control.textContent = name;
    control.classList.remove("asks");
  };
  control.addEventListener("blur", calm);
  control.addEventListener("click", () => {
    if (timer) {
      calm();
      act();
      return;
    }
    control.textContent = question;
    control.classList.add("asks");
    timer = setTimeout(calm, 5000);
  });
}

const WITHOUT_TEXT = ["checkbox", "range"]; // types of input

/**
 * Whether keys are text here.
 * @param {EventTarget | null} node
 * @returns {node is HTMLInputElement | HTMLTextAreaElement | HTMLSelectElement}
 */
export function isTextField(node) {
  if (node instanceof HTMLInputElement) return !WITHOUT_TEXT.includes(node.type);
  return node instanceof HTMLTextAreaElement || node instanceof HTMLSelectElement;
}
