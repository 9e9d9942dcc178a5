// @ts-check
/**
 * Starts the live page: socket → store → one animation frame → widgets, badge, panel.
 *
 * @typedef {import("./types.js").Reply} Reply
 * @typedef {import("./types.js").Value} Value
 */
import { Alarms } from "./alarms.js";
import { Badge, part } from "./badge.js";
import { Controls } from "./controls.js";
import { Drive } from "./drive.js";
import { Host } from "./host.js";
import { Input } from "./input.js";
import { Panel } from "./panel.js";
import { Socket } from "./socket.js";
import { StopButton } from "./stop.js";
import { Store } from "./store.js";

/** What the server says of a stop that nobody's hand made. @type {Record<string, string>} */
const STOPPED = {
  expired: "too long without a sign of this page",
  revoked: "the line to the robot was cut",
};
/** How often ages are looked at when nothing arrives. */
const AGE_EVERY_MS = 250;

const root = part(document, "[data-robot]");
const store = new Store();
const badge = new Badge(part(root, "[data-badge]"));
const panel = new Panel(part(root, "[data-panel]"));
const alarms = new Alarms(part(root, "[data-alarms]"));

/** @type {Map<number, {resolve: (values: Record<string, Value>) => void, reject: (error: Error) => void}>} */
const waiting = new Map();
let lastId = 0;
let isFrameDue = false;
let session = "";

const address = new URL(root.dataset["socket"] ?? "/ws", location.href);
address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
const socket = new Socket(address.href, {
  message: take,
  trip: wake,
  state(isUp) {
    store.setUp(isUp, performance.now());
    if (!isUp) {
      giveUpCommands();
      drive.lost();
      input.spendAll("the connection to URC was lost");
    }
    wake();
  },
});
const drive = new Drive(socket, root.dataset["stop"] ?? "", wake);
const input = new Input(drive);
const stop = new StopButton(drive, input, store, JSON.parse(root.dataset["lines"] ?? "[]"));
const bar = root.querySelector("[data-controls]");
const controls = bar instanceof HTMLElement ? new Controls(bar, drive, stop) : null;
const host = new Host(store, { run, wake, input, stop });

/** Ask for the one animation frame in which everything is drawn. */
function wake() {
  if (isFrameDue) return;
  isFrameDue = true;
  requestAnimationFrame(draw);
}

function draw() {
  isFrameDue = false;
  const nowMs = performance.now();
  host.frame(nowMs);
  badge.frame(store, socket);
  panel.frame(store, socket.reason);
  alarms.frame(store, nowMs);
  stop.frame();
  controls?.frame(nowMs);
}

/** @param {any} message */
function take(message) {
  const nowMs = performance.now();
  switch (message.t) {
    case "v":
      store.values(message, nowMs);
      break;
    case "hello":
      store.hello(message, nowMs);
      session = message.session;
      break;
    case "links":
      store.setLinks(message.links, nowMs);
      break;
    case "log":
      panel.addLines(message.lines, message.first, session);
      break;
    case "pong":
      store.pong(message.n, nowMs, socket.tripMs);
      break;
    case "reply":
      settle(message);
      break;
    case "lease":
      drive.setLease(message, nowMs);
      input.leaseChanged();
      break;
    case "beat":
      drive.beat = message.n;
      return; // nothing to draw
    case "stopped":
      input.stopped(message.command, STOPPED[message.reason] ?? message.reason);
      break;
    case "refused":
      if (message.command) input.stopped(message.command, message.message);
      else {
        drive.refused(message.message);
        input.refused(message.message);
      }
      break;
    case "error":
      console.warn(`URC: ${message.message}`);
      break;
  }
  wake();
}

/**
 * @param {string} command
 * @param {Record<string, Value>} args
 * @returns {Promise<Record<string, Value>>}
 */
function run(command, args) {
  lastId += 1;
  const id = lastId;
  return new Promise((resolve, reject) => {
    waiting.set(id, { resolve, reject });
    if (!socket.send({ t: "run", id, command, arguments: args })) {
      waiting.delete(id);
      reject(new Error("there is no connection to URC"));
    }
  });
}

/** @param {Reply} reply */
function settle(reply) {
  const asked = waiting.get(reply.id);
  waiting.delete(reply.id);
  if (reply.ok) asked?.resolve(reply.values ?? {});
  else asked?.reject(new Error(reply.message ?? reply.code ?? "it was not done"));
}

/** One command, one answer: without a line there will be none. Nothing is ever sent again. */
function giveUpCommands() {
  for (const { reject } of waiting.values()) {
    reject(new Error("the connection to URC was lost; whether it was done is not known"));
  }
  waiting.clear();
}

host.mountAll(root);
socket.open();
setInterval(wake, AGE_EVERY_MS);

addEventListener("pagehide", () => socket.close());
addEventListener("pageshow", (event) => {
  if (event.persisted) socket.open();
});
addEventListener("online", () => socket.hurry());
document.addEventListener("visibilitychange", () => {
  if (document.hidden) return;
  socket.hurry();
  wake();
});
