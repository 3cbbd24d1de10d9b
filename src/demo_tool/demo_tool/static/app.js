// The page: joins the connection, the picture, the panel and the episodes.

import { ApprovalBar } from "./approval.js";
import { CalibrationCard } from "./calibration.js";
import { Connection } from "./connection.js";
import { CoveredPlaces } from "./covered.js";
import { BUSY } from "./end_cards.js";
import { Episodes } from "./episodes.js";
import { LivePicture } from "./live.js";
import { button, buttons, byId, press, say, wordsOf } from "./page.js";
import { Panel } from "./panel.js";
import { Prefill } from "./prefill.js";
import { disableRecovery, setUpRecovery, showRecovery } from "./recovery.js";
import { Stage } from "./stage.js";
import { setUpShortcuts } from "./shortcuts.js";
import { setUpStopping } from "./stopping.js";
import { Zoom } from "./zoom.js";

/** @import { Call, View } from "./protocol" */

/** @type {Record<View["state"] | "connecting", [sign: string, name: string]>} */
const STATES = {
  connecting: ["…", "Connecting"],
  waiting_for_camera: ["…", "Waiting for the camera"],
  stale: ["!", "Old picture"],
  ready: ["●", "Ready"],
  planning: ["◌", "Planning"],
  executing: ["▶", "The arm moves"],
  recording: ["◉", "Recording"],
  proposing: ["◌", "The policy looks"],
  failed: ["✗", "Failed"],
  stopped: ["■", "Stopped"],
  waiting_for_approval: ["?", "Waits for your approval"],
  recovering: ["▶", "The arm goes back"],
};
/** @type {Record<string, string>} */
const SIDE_WORDS = {
  heightmap: "The table from above, as someone behind the robot sees it.",
  pick_affordance: "Where the policy would pick, seen from behind the robot.",
  place_affordance: "Where the policy would place, seen from behind the robot.",
};
const SAID_TWICE = /^(?:Ready|Planning|Executing|Recording|Proposing|Stopped|Waiting for approval|Recovering): (.)/;
const CLOCKS_APART_MS = 60000; // the camera's stamps are then of another clock, as in a simulation

const connection = new Connection();
/** @type {(error: unknown) => void} */
const tell = (error) => panel.answer(false, wordsOf(error));
/** @type {Call} */
const call = (command, ...args) => connection.call(command, ...args);
const stage = new Stage(byId("overlay", SVGSVGElement), (end, drawn) => call(end, drawn).catch(tell));
new Zoom(byId("stage"), () => stage.cancel());
const panel = new Panel(call, stage);
const prefill = new Prefill(call, tell);
const episodes = new Episodes(call);
const calibration = new CalibrationCard(call, tell);
const covered = new CoveredPlaces();
const approvalBar = new ApprovalBar((plan) => call("approve", { plan }).catch(tell));

/** @param {{ state: keyof typeof STATES, words: string }} view */
function showState({ state, words }) {
  const [sign, name] = STATES[state] ?? ["?", state];
  byId("state").dataset.state = state;
  say(byId("state-name"), `${sign} ${name}`);
  say(byId("state-words"), words.replace(SAID_TWICE, (_, first) => first.toUpperCase()));
  document.title = `${sign} ${name} – Demonstrate`;
}

/**
 * How old the picture is, beside the words that are announced: a count that runs would be announced every second.
 * @param {View} view
 */
function showAge({ state, camera }) {
  const seconds = Math.round((camera.age_ms ?? 0) / 1000);
  say(byId("state-age"), state === "stale" && Math.abs(1000 * seconds) < CLOCKS_APART_MS ? `The picture is ${seconds} s old.` : "");
}

/** @param {View} view */
function showHolder({ holder, may_take_over: mayTakeOver, pages }) {
  byId("watching").hidden = holder === "me";
  byId("take-over").hidden = !mayTakeOver;
  byId("give-up").hidden = !(holder === "me" && pages > 1);
  say(byId("watching-words"), holder === "other"
    ? `This page watches: another page holds the arm.${mayTakeOver ? " It is away." : " It can hand it on."} STOP works here too.`
    : "No page holds the arm.");
}

/** @param {boolean} open */
function showConnection(open) {
  byId("lost").hidden = open;
  document.body.classList.toggle("offline", !open);
}

/** @param {View} view */
function show(view) {
  showState(view);
  showAge(view);
  showHolder(view);
  byId("stopped").hidden = view.state !== "stopped";
  button("resume").disabled = view.holder !== "me";
  approvalBar.show(view, connection.open);
  showRecovery(view, connection.open);
  byId("no-picture").hidden = view.camera.age_ms !== null;
  byId("stage").style.aspectRatio = `${view.camera.width || 16} / ${view.camera.height || 9}`;
  byId("stage").style.setProperty("--aspect", String((view.camera.width || 16) / (view.camera.height || 9)));
  byId("stage").classList.toggle("empty", view.camera.age_ms === null);
  const name = view.data_set ? `Data set ${view.data_set}` : "No data set";
  say(byId("where"), view.episode ? `${name} · episode ${view.episode.name}` : name);
  stage.enabled = connection.open && view.holder === "me" && !BUSY.includes(view.state);
  stage.reachable = view.plan && view.plan.reachable;
  stage.take(view.draft, view.camera, view.n_rotations);
  panel.show(view, connection.open);
  prefill.show(view, connection.open);
  covered.show(view.covered, view.camera);
  episodes.show(view, connection.open);
  calibration.show(view, connection.open);
}

connection.onView = show;
connection.addEventListener("open", () => showConnection(true));
connection.addEventListener("lost", () => {
  showConnection(false);
  showState({ state: "connecting", words: "The connection to the server is lost." });
  say(byId("state-age"), "");
  stage.enabled = false;
  panel.disable();
  approvalBar.disable();
  disableRecovery();
});

// pictures

const live = new LivePicture(byId("live", HTMLCanvasElement), ({ ageMs, perSecond, width }) => {
  const age = Math.abs(ageMs) < CLOCKS_APART_MS ? `${Math.max(0, Math.round(ageMs))} ms old, ` : "";
  say(byId("live-words"), `Picture ${age}${perSecond.toFixed(0)} a second, ${width} pixels wide.`);
  window.dispatchEvent(new CustomEvent("livepicture", { detail: { ageMs } }));
}, (words) => say(byId("live-words"), `No picture: ${words}`));
const side = new LivePicture(byId("side", HTMLCanvasElement), () => {
  byId("side").hidden = false;
  say(byId("side-words"), SIDE_WORDS[chosenSide]);
}, (words) => say(byId("side-words"), `No picture: ${words}`));
let chosenSide = "";

/** @param {string} name */
function chooseSide(name) {
  chosenSide = name;
  for (const choice of buttons("#side-choice button")) press(choice, choice.dataset.picture === name);
  byId("side").hidden = true;
  byId("side").setAttribute("aria-label", SIDE_WORDS[name] ?? "");
  byId("side-figure").hidden = !name;
  say(byId("side-words"), name ? "Nothing has come of this yet." : "");
  side.show(name);
}

for (const choice of buttons("#side-choice button")) {
  choice.addEventListener("click", () => chooseSide(choice.dataset.picture ?? ""));
}

// parts of the page

const PARTS = /** @type {const} */ (["record", "episodes", "camera"]);

/** @param {typeof PARTS[number]} part */
function open(part) {
  for (const name of PARTS) {
    byId(name).hidden = part !== name;
    byId(`tab-${name}`).setAttribute("aria-current", name === part ? "page" : "false");
  }
  live.show(part === "record" ? "color" : "");
  side.show(part === "record" ? chosenSide : "");
  calibration.open(part === "camera");
  if (part === "episodes") episodes.refresh();
}

for (const part of PARTS) byId(`tab-${part}`).addEventListener("click", () => open(part));
byId("resume").addEventListener("click", () => call("resume").catch(tell));
byId("take-over").addEventListener("click", () => call("take_over").catch(tell));
byId("give-up").addEventListener("click", () => call("give_up").catch(tell));
episodes.addEventListener("another-data-set", () => {
  open("record");
  panel.askDataSet();
});
setUpRecovery(() => call("recover").catch(tell), () => call("open_hand").catch(tell));
setUpShortcuts();
setUpStopping(() => connection.stop().catch(tell));

open("record");
connection.connect();
