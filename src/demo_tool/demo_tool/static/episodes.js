// The episodes of the open data set: list, look through, relabel, mark, trim, trash; merge, split; what it lacks.

import { DataSets } from "./datasets.js";
import { EpisodeView } from "./episode.js";
import { LessonCard } from "./lesson.js";
import { askFirst, button, buttons, byId, element, one, say, wordsOf } from "./page.js";
import { statisticsParts } from "./statistics.js";

/** @import { Call, CommandName, EpisodeInfo, Given, View } from "./protocol" */

/** @type {Map<boolean | null, string>} */
const RESULTS = new Map([[true, "✓ success"], [false, "✗ failure"], [null, "unmarked"]]);
const NAME = /^(\d{4})(\d\d)(\d\d)-(\d\d)(\d\d)/;

/**
 * "21 Nov 13:15" for an episode's name, where it is one that the recorder gave.
 * @param {string} name
 */
function when(name) {
  const found = NAME.exec(name);
  if (!found) return name;
  const [year = 0, month = 1, day = 1, hour = 0, minute = 0] = found.slice(1).map(Number);
  const date = new Date(year, month - 1, day, hour, minute);
  return date.toLocaleString(undefined, { day: "numeric", month: "short", hour: "2-digit", minute: "2-digit" });
}

export class Episodes extends EventTarget {
  #call;
  #one;
  #others;
  #lesson;
  /** @type {string | null} */
  #dataSet = null;
  #mine = false;
  #shown = false;

  /** @param {Call} call */
  constructor(call) {
    super();
    this.#call = call;
    this.#one = new EpisodeView(byId("one-episode"), (command, ...args) => this.#edit(command, ...args));
    this.#others = new DataSets((command, ...args) => this.#edit(command, ...args), (words) => this.#say(false, words));
    this.#lesson = new LessonCard((command, ...args) => this.#edit(command, ...args));
    byId("episodes-refresh").addEventListener("click", () => this.refresh());
    byId("data-set-other").addEventListener("click", () => this.dispatchEvent(new Event("another-data-set")));
    byId("count").addEventListener("click", () => this.#count());
    askFirst(button("empty-trash"), "Delete for good: sure?", () => this.#edit("empty_trash"));
  }

  /**
   * @param {View} view
   * @param {boolean} open whether there is a connection
   */
  show(view, open) {
    const mine = open && view.holder === "me";
    if (mine !== this.#mine) {
      this.#mine = mine;
      document.body.classList.toggle("may-edit", mine);
      this.#allow();
    }
    this.#lesson.show(view, mine);
    this.#others.show(view.data_sets, view.data_set, mine);
    if (view.data_set !== this.#dataSet) {
      this.#dataSet = view.data_set;
      this.#one.close();
      byId("statistics").replaceChildren();
      if (this.#shown) this.refresh();
    }
  }

  async refresh() {
    this.#shown = true;
    say(byId("episodes-title"), this.#dataSet ? `Episodes of ${this.#dataSet}` : "Episodes");
    try {
      const [{ episodes }, { trashed, undone_steps: undone }] = await Promise.all([this.#call("episodes"), this.#call("trash")]);
      this.#list(episodes);
      this.#listTrash(trashed, undone);
      this.#allow();
    } catch (error) {
      this.#say(false, wordsOf(error));
    }
  }

  /** @param {EpisodeInfo[]} episodes */
  #list(episodes) {
    const rows = episodes.map((info) => {
      const open = element("button", { type: "button", "aria-label": `Open episode ${info.name}` }, "Open");
      open.addEventListener("click", () => this.#open(info.name));
      const notes = [info.finished ? "" : "not finished", ...info.complaints].filter(Boolean).join("; ");
      return element("tr", {},
        element("th", { scope: "row", title: info.name }, when(info.name), notes ? element("small", {}, notes) : ""),
        element("td", {}, info.instructions.join(" · ") || "–"),
        element("td", {}, String(info.n_steps)),
        element("td", {}, RESULTS.get(info.success) ?? "unmarked"),
        element("td", {}, open));
    });
    const none = element("tr", {}, element("td", { colSpan: 5 }, "No episode yet."));
    one("#episode-table tbody").replaceChildren(...(rows.length ? rows.reverse() : [none]));
  }

  /**
   * @param {string[]} names
   * @param {number} undone how many undone steps are kept
   */
  #listTrash(names, undone) {
    byId("trash").replaceChildren(...names.map((name) => {
      const restore = element("button", { type: "button", className: "edits", "aria-label": `Restore episode ${name}` }, "Restore");
      restore.addEventListener("click", () => this.#edit("restore", { name }));
      return element("li", {}, `${when(name)} `, restore);
    }));
    if (undone) byId("trash").append(element("li", {}, `${undone} undone ${undone === 1 ? "step" : "steps"}`));
    if (!names.length && !undone) byId("trash").replaceChildren(element("li", {}, "The trash is empty."));
    byId("empty-trash").hidden = !names.length && !undone;
  }

  /** Only the page that holds the arm edits. */
  #allow() {
    button("empty-trash").disabled = !this.#mine;
    button("data-set-other").disabled = !this.#mine;
    for (const control of buttons("#episodes .edits")) control.disabled = !this.#mine;
  }

  /** @param {string} name */
  async #open(name) {
    try {
      const episode = await this.#call("episode", { name });
      if (this.#dataSet !== null) this.#one.open(episode, this.#dataSet);
      this.#allow();
    } catch (error) {
      this.#say(false, wordsOf(error));
    }
  }

  /**
   * @template {CommandName} Name
   * @param {Name} command
   * @param {Given<Name>} given
   */
  async #edit(command, ...given) {
    this.#say(true, "…");
    try {
      const answer = await this.#call(command, ...given);
      this.#say(true, answer && "words" in answer && answer.words || "Done.");
      await this.refresh();
      if (command === "delete") this.#one.close();
      else if (this.#one.name) await this.#open(this.#one.name);
    } catch (error) {
      this.#say(false, wordsOf(error));
    }
  }

  async #count() {
    try {
      const { statistics } = await this.#call("statistics");
      const address = `/statistics.png?at=${Date.now()}`;
      byId("statistics").replaceChildren(...statisticsParts(statistics, address));
    } catch (error) {
      this.#say(false, wordsOf(error));
    }
  }

  /**
   * @param {boolean} ok
   * @param {string} words
   */
  #say(ok, words) {
    byId("episodes-answer").dataset.ok = String(ok);
    say(byId("episodes-answer"), ok ? words : `✗ ${words}`);
  }
}
