// The websocket to the server: keeps itself alive, hands out the state, carries commands and their answers.

/** @import { Answer, CommandName, Given, Message, View } from "./protocol" */

/** @typedef {{ resolve: (answer: any) => void, reject: (error: Error) => void, timer: number }} Waiting */

const SILENCE_MS = 5000; // the server says something every second
const RETRY_MS = [200, 500, 1000, 2000];
const ANSWER_MS = 15000;
const COPIED_MS = 600000;
const COPYING = ["merge", "split"];
const OPENED_AGAIN = 4001;

function newName() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (b) => b.toString(16).padStart(2, "0")).join("");
}

/** This page's name: kept over a reload, so that the page that held the arm holds it again. */
function pageName(fresh = false) {
  let name = fresh ? null : sessionStorage.getItem("page");
  if (!name) {
    name = newName();
    sessionStorage.setItem("page", name);
  }
  return name;
}

export class Connection extends EventTarget {
  /** @type {WebSocket | null} */
  #socket = null;
  #page = pageName();
  #number = 0;
  /** @type {Map<number, Waiting>} */
  #waiting = new Map();
  #failures = 0;
  #silence = 0;
  /** @type {Partial<View>} */
  #view = {};
  open = false;
  /** @type {(view: View) => void} called with the whole view whenever something of it changed */
  onView = () => {};

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/session?page=${this.#page}`);
    this.#socket = socket;
    this.#watchSilence(socket);
    socket.onmessage = (event) => this.#take(socket, JSON.parse(event.data));
    socket.onclose = (event) => this.#closed(socket, event.code);
  }

  /**
   * Ask the station for something; resolves with its answer, rejects with an Error that has words for a person.
   * @template {CommandName} Name
   * @param {Name} command
   * @param {Given<Name>} given
   * @returns {Promise<Answer<Name>>}
   */
  call(command, ...given) {
    return new Promise((resolve, reject) => {
      const socket = this.#socket;
      if (!this.open || !socket) {
        reject(new Error("There is no connection to the server: nothing was sent."));
        return;
      }
      const id = ++this.#number;
      const timer = setTimeout(() => {
        this.#waiting.delete(id);
        reject(new Error("The server did not answer in time."));
      }, COPYING.includes(command) ? COPIED_MS : ANSWER_MS);
      this.#waiting.set(id, { resolve, reject, timer });
      socket.send(JSON.stringify({ id, command, arguments: given[0] ?? {} }));
    });
  }

  /** By both ways at once: one of them may be clogged. */
  stop() {
    const byPost = fetch("/stop", { method: "POST", keepalive: true }).then((answer) => {
      if (!answer.ok) throw new Error(`STOP was refused (${answer.status})`);
    });
    return Promise.any([this.call("stop"), byPost]).catch(() => {
      throw new Error("STOP did not reach the server. Use the arm's own emergency stop.");
    });
  }

  /**
   * @param {WebSocket} socket
   * @param {Message} message
   */
  #take(socket, message) {
    this.#watchSilence(socket);
    if ("view" in message) {
      Object.assign(this.#view, message.view);
      if (!this.open) {
        this.open = true;
        this.#failures = 0;
        this.dispatchEvent(new Event("open"));
      }
      this.onView(/** @type {View} */ (this.#view)); // the first message of a connection has all of it
      return;
    }
    const waiting = this.#waiting.get(message.id);
    if (!waiting) return;
    this.#waiting.delete(message.id);
    clearTimeout(waiting.timer);
    if (message.ok) waiting.resolve(message.answer);
    else waiting.reject(new Error(message.error));
  }

  /** @param {WebSocket} socket */
  #watchSilence(socket) {
    clearTimeout(this.#silence);
    this.#silence = setTimeout(() => {
      socket.close();
      this.#closed(socket, 1006); // a dead link would answer the close much later
    }, SILENCE_MS);
  }

  /**
   * @param {WebSocket} socket
   * @param {number} code
   */
  #closed(socket, code) {
    if (socket !== this.#socket) return;
    this.#socket = null;
    clearTimeout(this.#silence);
    for (const { reject, timer } of this.#waiting.values()) {
      clearTimeout(timer);
      reject(new Error("The connection was lost before the server answered."));
    }
    this.#waiting.clear();
    if (code === OPENED_AGAIN) this.#page = pageName(true); // a duplicate of this tab has the old name now
    const wasOpen = this.open;
    this.open = false;
    this.#view = {};
    if (wasOpen) this.dispatchEvent(new Event("lost"));
    const delay = RETRY_MS[Math.min(this.#failures++, RETRY_MS.length - 1)];
    setTimeout(() => this.connect(), delay);
  }
}
