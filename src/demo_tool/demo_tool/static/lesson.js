// What is learned of the open data set: begin, stop, how far it is, what it brought, and its use.

import { button, byId, element, input, one, say } from "./page.js";

/** @import { Beginning, Edit, Lesson, View } from "./protocol" */

/** @type {Record<Lesson["state"], string>} */
const SIGNS = { none: "", running: "…", stopped: "■", failed: "✗", learned: "✓" };

export class LessonCard {
  #table = "";

  /** @param {Edit} edit */
  constructor(edit) {
    const minutes = input("lesson-minutes"), init = byId("lesson-init", HTMLSelectElement);
    button("teach").addEventListener("click", () => {
      if (!minutes.reportValidity()) return;
      edit("teach", { minutes: minutes.value === "" ? null : minutes.valueAsNumber, init: /** @type {Beginning} */ (init.value) });
    });
    button("stop-teaching").addEventListener("click", () => edit("stop_teaching"));
    button("use-learned").addEventListener("click", () => edit("use_learned"));
  }

  /**
   * @param {View} view
   * @param {boolean} mine whether this page may command
   */
  show({ lesson, data_set: dataSet, episode, policy }, mine) {
    const { state, share, words, table } = lesson;
    const running = state === "running";
    byId("lesson").dataset.state = state;
    button("teach").disabled = !mine || running || !dataSet || episode !== null;
    say(button("teach"), state === "stopped" && lesson.data_set === dataSet ? "Go on" : "Teach now");
    byId("stop-teaching").hidden = !running;
    button("stop-teaching").disabled = !mine;
    input("lesson-minutes").disabled = byId("lesson-init", HTMLSelectElement).disabled = !mine || running;
    byId("use-learned").hidden = lesson.policy === null;
    button("use-learned").disabled = !mine;
    const bar = byId("lesson-share", HTMLProgressElement);
    bar.hidden = !running;
    if (share === null) bar.removeAttribute("value");
    else bar.value = share;
    byId("lesson-words").dataset.ok = String(state !== "failed");
    say(byId("lesson-words"), state === "none" ? "" : `${SIGNS[state]} ${lesson.data_set}: ${words}`);
    say(byId("lesson-policy"), lesson.policy ? `Policy server: ${policy.words}` : "");
    this.#compare(table);
  }

  /** @param {Lesson["table"]} rows */
  #compare(rows) {
    const news = JSON.stringify(rows);
    if (this.#table === news) return;
    this.#table = news;
    byId("lesson-table").hidden = !rows.some(([, , after]) => after);
    one("#lesson-table tbody").replaceChildren(...rows.map(([what, before, after]) =>
      element("tr", {}, element("th", { scope: "row" }, what), element("td", {}, before || "–"), element("td", {}, after || "–"))));
  }
}
