// Statistics in words: what lacks balance first, then the counts.

import { element } from "./page.js";

/** @import { Counts, Statistics } from "./protocol" */

/** @type {["success" | "instructions" | "color_words" | "primitives" | "sources", name: string][]} */
const TABLES = [
  ["success", "Episodes"],
  ["instructions", "Steps for each instruction"],
  ["color_words", "Steps for each colour word"],
  ["primitives", "Steps for each primitive"],
  ["sources", "Steps for each origin"],
];

/**
 * @param {string} name
 * @param {Counts} counts
 */
function table(name, counts) {
  const rows = Object.entries(counts).map(([key, count]) =>
    element("tr", {}, element("th", { scope: "row" }, key || "(none)"), element("td", {}, String(count))));
  return element("table", { className: "counts" }, element("caption", {}, name), element("tbody", {}, ...rows));
}

/**
 * The elements for a data set's statistics, with the picture at an address.
 * @param {Statistics} statistics
 * @param {string} address
 */
export function statisticsParts(statistics, address) {
  const { n_steps: steps, n_executed: executed, n_episodes: episodes } = statistics;
  const biases = statistics.biases.map((line) => element("li", {}, line));
  return [
    element("p", {}, `${steps} steps in ${episodes} episodes, ${executed} of them executed.`),
    ...(biases.length ? [element("ul", { className: "biases" }, ...biases)] : []),
    element("img", { src: address, alt: "Where picks and places were, and how often" }),
    element("div", { className: "tables" },
      ...TABLES.filter(([key]) => Object.keys(statistics[key]).length).map(([key, name]) => table(name, statistics[key]))),
  ];
}
