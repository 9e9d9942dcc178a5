// @ts-check
/**
 * Starts the developer page with two sockets: the usual socket for values and commands, and one for
 * the traffic, the profile and requests.
 *
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {{severity: string, text: string}} Found
 */
import { Badge, part } from "../live/badge.js";
import { element, visible } from "./bytes.js";
import { Commands } from "./commands.js";
import { WireLog } from "./log.js";
import { Timeline } from "./timeline.js";
import { TopicTable } from "./topics.js";
import { TryOut } from "./try.js";
import { Socket } from "../live/socket.js";
import { DASH, Store, ageText } from "../live/store.js";

const DRAW_EVERY_MS = 200;
/** Most characters of a value, such as a map, in the table of signals. */
const LONGEST = 200;
const ANSWER_WITHIN_MS = 10_000;
/** @type {Record<string, string>} */
const STATES = { running: "●", waiting: "◆", broken: "▲" };

const root = part(document, "[data-dev]");
const store = new Store();
const badge = new Badge(part(root, "[data-badge]"));
const log = new WireLog(root);
const table = part(root, "[data-signals]");
const state = part(root, "[data-profile-state]");
const findings = part(root, "[data-findings]");

/** @type {Map<number, {resolve: (message: any) => void, reject: (error: Error) => void}>} */
const waiting = new Map();
let lastId = 0;
/** @type {{el: HTMLElement, value: HTMLElement, age: HTMLElement, alarm: HTMLElement, name: string}[]} */
let cells = [];

const values = new Socket(address(root.dataset["values"]), {
  message: takeValues,
  trip() {},
  state(isUp) {
    store.setUp(isUp, performance.now());
    if (!isUp) giveUp();
  },
});
const line = new Socket(address(root.dataset["socket"]), {
  message: take,
  trip() {},
  state(isUp) {
    if (!isUp) giveUp();
  },
});
const desk = {
  ask: (/** @type {object} */ message) => request(line, message),
  run: async (
    /** @type {string} */ command,
    /** @type {Record<string, unknown>} */ args,
    /** @type {boolean} */ confirmed,
  ) => {
    const said = { command, arguments: args };
    const { token } = confirmed ? await request(values, { t: "prepare", ...said }) : { token: "" };
    const reply = await request(values, { t: "run", ...said, token });
    if (!reply.ok) throw new Error(reply.message ?? reply.code ?? "the command was not run");
    return reply.values ?? {};
  },
};
const tryOut = new TryOut(root, desk);
const commands = new Commands(part(root, "[data-commands]"), desk);
const topics = root.querySelector("[data-topics]") ? new TopicTable(root, (message) => line.send(message)) : null;
const timeline = new Timeline(root, root.dataset["timeline"] ?? "");

/**
 * Send a request and wait for its only reply.
 *
 * @param {Socket} socket
 * @param {object} message
 * @returns {Promise<any>}
 */
function request(socket, message) {
  lastId += 1;
  const id = lastId;
  return new Promise((resolve, reject) => {
    // The server always replies within its own limit; this limit is for an unresponsive server.
    const patience = socket === values ? 4 * ANSWER_WITHIN_MS : ANSWER_WITHIN_MS;
    const alarm = setTimeout(() => settle(id, new Error("URC has not answered")), patience);
    const done = () => clearTimeout(alarm);
    waiting.set(id, {
      resolve: (answer) => (done(), resolve(answer)),
      reject: (error) => (done(), reject(error)),
    });
    if (!socket.send({ ...message, id })) settle(id, new Error("there is no connection to URC"));
  });
}

/**
 * @param {number} id
 * @param {any} answer
 */
function settle(id, answer) {
  const asked = waiting.get(id);
  waiting.delete(id);
  if (answer instanceof Error) asked?.reject(answer);
  else asked?.resolve(answer);
}

function giveUp() {
  for (const id of [...waiting.keys()]) settle(id, new Error("the connection to URC was lost"));
}

/** @param {any} message */
function takeValues(message) {
  const nowMs = performance.now();
  switch (message.t) {
    case "hello":
      store.hello(message, nowMs);
      build();
      break;
    case "v":
      store.values(message, nowMs);
      break;
    case "links":
      store.setLinks(message.links, nowMs);
      break;
    case "pong":
      store.pong(message.n, nowMs, values.tripMs);
      break;
    case "token":
    case "reply":
      settle(message.id, message);
      break;
  }
}

/** @param {any} message */
function take(message) {
  switch (message.t) {
    case "hello":
      log.restart();
      topics?.tell();
      // Opened last, because the robot connects for the first of the two sockets, and its first
      // messages matter.
      if (!values.isWanted) values.open();
      break;
    case "rows":
      log.add(message);
      break;
    case "profile":
      profile(message);
      break;
    case "topics":
      topics?.show(message.tables);
      break;
    case "tried":
    case "shown":
      settle(message.id, message);
      break;
    case "error":
      console.warn(`URC: ${message.message}`);
      break;
  }
}

/** @param {{edition: number, state: string, file: string, told: string, problems: Found[], lines: any[], commands: any[]}} told */
function profile(told) {
  state.dataset["state"] = told.state;
  const words = told.told || "is running; URC reloads it when you save it";
  state.textContent = `${STATES[told.state] ?? ""} ${visible(told.file)} ${visible(words)}`;
  findings.replaceChildren(
    ...told.problems.map(({ severity, text }) => {
      const el = element("pre", "dev-finding", text);
      el.dataset["severity"] = severity;
      el.tabIndex = 0; // it may be wider than the page
      return el;
    }),
  );
  log.setLines(told.lines);
  tryOut.setLines(told.lines);
  commands.set(told.commands, told.lines);
}

/** Make a row for each signal. */
function build() {
  cells = store.names.map((name) => {
    const el = element("tr", "");
    const head = element("th", "", name);
    head.setAttribute("scope", "row");
    const [value, age, alarm] = [element("td", ""), element("td", ""), element("td", "")];
    el.append(head, value, age, alarm);
    return { el, value, age, alarm, name };
  });
  table.replaceChildren(...cells.map(({ el }) => el));
}

function draw() {
  badge.frame(store, values);
  const nowMs = performance.now();
  for (const { el, value, age, alarm, name } of cells) {
    const reading = store.reading(name, nowMs);
    el.dataset["state"] = reading.state;
    const unit = reading.signal.unit && reading.value !== null ? ` ${reading.signal.unit}` : "";
    write(value, shown(reading) + unit);
    write(age, reading.state === "none" ? DASH : ageText(nowMs / 1000 - reading.time));
    write(alarm, reading.alarm ? `▲ ${reading.alarm}` : "");
    alarm.className = reading.alarm ? "dev-bad" : "";
  }
}

/** @param {Reading} reading */
function shown(reading) {
  /** @type {unknown} */
  const value = reading.value;
  if (value === null || typeof value !== "object") return visible(reading.text);
  if ("bytes" in value) return `<${String(value.bytes)} bytes>`;
  const text = JSON.stringify(value);
  return visible(text.length > LONGEST ? `${text.slice(0, LONGEST)}…` : text);
}

/**
 * @param {HTMLElement} el
 * @param {string} text
 */
function write(el, text) {
  if (el.textContent !== text) el.textContent = text;
}

/** @param {string | undefined} path */
function address(path) {
  const url = new URL(path ?? "/", location.href);
  url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
  return url.href;
}

line.open();
timeline.refresh();
setInterval(draw, DRAW_EVERY_MS);
addEventListener("pagehide", () => [values, line].forEach((socket) => socket.close()));
addEventListener("pageshow", (event) => {
  if (event.persisted) line.open();
});
addEventListener("online", () => [values, line].forEach((socket) => socket.hurry()));
