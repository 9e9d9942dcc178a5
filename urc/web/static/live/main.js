// @ts-check
/**
 * Starts the live page: socket → store → one animation frame → widgets, badge, panel.
 *
 * @typedef {import("../core/types.js").Reply} Reply
 * @typedef {import("../core/types.js").Value} Value
 */
import { ConfirmDialog } from "../control/confirm_dialog.js";
import { backSafely } from "./leave_page.js";
import { Badge, part } from "./badge.js";
import { Controls } from "../control/controls.js";
import { Drive } from "../control/drive.js";
import { PageAlarms } from "../alarms/page_alarms.js";
import { PictureLine } from "./picture_line.js";
import { PageTopics, Log, Themes, watched } from "./page_topics.js";
import { frameOf } from "./frames.js";
import { offerHints } from "./hints.js";
import { Host } from "../widgets/host.js";
import { Input } from "../control/input.js";
import { LostGoals } from "./lost_goals.js";
import { LostCard } from "./lost_card.js";
import { Panel } from "./panel.js";
import { FullScreen, WakeLock } from "./screen.js";
import { ScreenName } from "./screen_name.js";
import { Socket } from "./socket.js";
import { ViewSwitch } from "./view_switch.js";
import { StopButton } from "../control/stop.js";
import { tapWithAnyFinger } from "../control/second_finger.js";
import { Store } from "./store.js";
import { Videos } from "./videos.js";
import { offerSystems } from "../core/units.js";
import { said, t } from "../core/words.js";

/** Reasons for stops without an operator's action. @type {Record<string, string>} */
const STOPPED = {
  expired: t("No input from this page for too long"),
  revoked: t("Lost contact while driving"),
};
/** Maximum time for which a confirmation waits for the server. */
const MEANT_MS = 5000;
/** Interval for checking ages without new data. */
const AGE_EVERY_MS = 250;

const root = part(document, "[data-robot]");
const store = new Store();
const videos = new Videos(store, wakeWidgets, () => wake());
const badge = new Badge(part(root, "[data-badge]"));
const panel = new Panel(part(root, "[data-panel]"));

/** @type {Map<number, {resolve: (values: Record<string, Value>) => void, reject: (error: Error) => void}>} */
const waiting = new Map();
/** Confirmed commands without a token yet. @type {Map<number, {atMs: number, said: object}>} */
const meant = new Map();
let lastId = 0;
let isFrameDue = false;
/** Whether the next frame must draw more than the widgets. */
let isAllDue = false;
let session = "";

const address = new URL(root.dataset["socket"] ?? "/ws", location.href);
address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
const UNKNOWN_GOALS = { look: "", value: { isKnown: false, goals: [] } };
/** Autonomous motion of all pages; each widget gets that of its own outputs. @type {{look: string, value: any}} */
let goals = UNKNOWN_GOALS;
const socket = new Socket(address.href, {
  message: take,
  picture: takePicture,
  trip: wake,
  state(isUp) {
    store.setUp(isUp, performance.now());
    if (!isUp) {
      pictures.join("");
      giveUpCommands();
      goals = UNKNOWN_GOALS; // until the server tells of them again
      lostGoals.show([]);
      drive.lost();
      asks.lost();
      input.spendAll(t("the connection to URC was lost"));
    }
    tellOfDoor();
    wake();
  },
});
const apart = new URL(address);
apart.pathname += "/pictures";
const pictures = new PictureLine(apart.href, takePicture);
const spare = new URL(address);
spare.pathname += "/spare";
const drive = new Drive(socket, root.dataset["stop"] ?? "", wake, spare.href);
const input = new Input(drive);
const bar = root.querySelector("[data-controls]");
const stop = new StopButton(drive, input, store, JSON.parse(root.dataset["lines"] ?? "[]"), bar !== null);
const asks = new ConfirmDialog(part(root, "[data-bands]"), (message) => socket.send(message));
stop.onPressed = forgetQuestions;
const lostGoals = new LostGoals(
  part(root, "[data-bands]"),
  part(root, "[data-alarm-strip]").hasAttribute("data-may-act"),
  (message) => socket.send(message),
);
/** States of the sequences. @type {Record<string, import("../core/types.js").Progress>} */
let sequences = {};
const controls = bar instanceof HTMLElement ? new Controls(root, bar, drive, stop, input) : null;
const log = new Log();
const themes = new Themes(wake);
const follows = new PageTopics(
  {
    links: () => {
      const isRefused = socket.refusal !== "";
      const value = { isUp: store.isUp, isRefused, links: [...store.links.values()], isReplay: badge.isReplay };
      return { look: JSON.stringify(value), value };
    },
    log: () => log.news(),
    lease: () => {
      const value = { lease: drive.lease, isMine: drive.isMine, refusal: drive.refusal };
      return { look: JSON.stringify(value), value };
    },
    alarms: () => alarms.news(),
    watched: () => watched(store, performance.now()),
    latency: () => {
      const { isUp, tripMs, failures, skewMs, messages, bytes } = socket;
      const value = { isUp, tripMs, failures, skewMs, messages, bytes, inputMs: drive.input?.age ?? null };
      return { look: JSON.stringify(value), value };
    },
    sequences: () => ({ look: JSON.stringify(sequences), value: sequences }),
    goals: () => goals,
    theme: () => themes.news(),
  },
  wake,
);
const strip = part(root, "[data-alarm-strip]");
const alarms = new PageAlarms({
  root,
  strip,
  said: part(root, "[data-alarms]"),
  store,
  path: strip.dataset["path"] ?? "",
  lease: () => drive.lease,
  wake,
  tell: (text) => tell(text),
});
const host = new Host(store, {
  alarms,
  run,
  asks,
  steer: (command, verb) => void socket.send({ t: "steer", command, verb }),
  drive: (wish) => {
    drive.say(wish);
    drive.changed();
  },
  wake,
  again: wakeWidgets,
  input,
  stop,
  follows,
});
const note = part(root, "[data-note]");
/** Time for which a note is shown, in ms. */
const NOTE_MS = 10_000;
let noteTimer = 0;
/** Show a note over the stage for a while, or until the next one if it `stays`. */
const tell = (/** @type {string} */ text, stays = false) => {
  clearTimeout(noteTimer);
  note.textContent = text;
  if (!stays) noteTimer = setTimeout(() => (note.textContent = ""), NOTE_MS);
};
const AT_THE_DOOR = t("URC was restarted: open the address that it printed; this page then continues.");
/** Show how to get access if the server does not know this browser; STOP still works. */
function tellOfDoor() {
  if (socket.isShutOut) tell(AT_THE_DOOR, true);
  else if (note.textContent === AT_THE_DOOR) tell("");
}
new FullScreen(root.querySelector("[data-fullscreen]"), tell);
const lost = new LostCard(part(root, "[data-lost]"), root, () => {
  if (!socket.send({ t: "reconnect" })) socket.hurry();
});
const screenName = new ScreenName((message) => socket.send(message));
const wakeLock = new WakeLock(tell);
const stage = new ViewSwitch(root, { store, run, input, asks, host, wake, book: alarms.book });
/** JSON list of the images that the server sends. */
let shown = "";

/** Request an animation frame that draws everything. */
function wake() {
  isAllDue = true;
  wakeWidgets();
}

/**
 * Request an animation frame only for new readings, which is the usual case. Only widgets show
 * readings.
 */
function wakeWidgets() {
  if (isFrameDue) return;
  isFrameDue = true;
  requestAnimationFrame(draw);
}

function draw() {
  isFrameDue = false;
  const nowMs = performance.now();
  host.frame(nowMs);
  stage.frame(nowMs);
  if (!isAllDue) return;
  isAllDue = false;
  follows.frame();
  askPictures();
  badge.frame(store, socket);
  panel.frame(store, socket.reason, socket.refusal !== "");
  lost.frame(store, socket, nowMs, badge.isReplay);
  alarms.frame(nowMs);
  stop.frame();
  controls?.frame(nowMs);
  wakeLock.want(drive.isMine);
}

/** Whether a signal is drawn with each reading. @param {string} name */
function shows(name) {
  return stage.debug !== null || host.shows(name);
}

/** Request only the visible images. */
function askPictures() {
  const signals = [...new Set([...host.pictures(), ...stage.pictures()])];
  const stills = videos.undecoded(signals);
  const apart = signals.length > 0 && pictures.use();
  const wanted = JSON.stringify([signals, stills, apart]);
  const said = { t: "show", signals, ...(stills.length > 0 && { stills }), ...(apart && { apart }) };
  if (wanted === shown || !socket.send(said)) return;
  shown = wanted;
  videos.keep(signals);
}

/**
 * @param {ArrayBuffer} data
 * @param {number} [nowMs] time of arrival
 */
function takePicture(data, nowMs = performance.now()) {
  const frame = frameOf(data);
  if (!frame) return;
  if (frame.video) {
    videos.take(frame, nowMs);
    return;
  }
  store.picture(frame, nowMs);
  wakeWidgets();
}

/** @param {any} message */
function take(message) {
  const nowMs = performance.now();
  switch (message.t) {
    case "v":
      if (store.values(message, nowMs, shows)) wakeWidgets();
      return;
    case "hello":
      store.each.begin(message.session);
      store.hello(message, nowMs);
      session = message.session;
      sequences = {};
      stop.moving = [];
      screenName.tell();
      alarms.clear();
      videos.keep([]);
      pictures.join(message.pictures ?? "");
      input.images.clear();
      shown = "[[],[],false]"; // a new connection sends no images before a request
      break;
    case "alarms":
      alarms.take(message);
      break;
    case "links":
      store.setLinks(message.links, nowMs);
      break;
    case "topics":
      store.setTopics(message.mismatches);
      break;
    case "log":
      log.add(message.lines, message.first, session);
      panel.addLines(message.lines, message.first, session);
      break;
    case "ask":
    case "asked":
      asks.take(message);
      break;
    case "progress":
      sequences = Object.fromEntries(message.sequences.map((/** @type {import("../core/types.js").Progress} */ one) => [one.command, one]));
      stop.moving = message.moving;
      goals = sentGoals(message.goals, nowMs);
      lostGoals.show(goals.value.goals);
      break;
    case "pong":
      store.pong(message.n, nowMs, socket.tripMs);
      break;
    case "token":
      give(message);
      break;
    case "reply":
      settle(message);
      break;
    case "lease":
      if (drive.setLease(message, nowMs)) {
        input.spendAll(input.against() || t("STOP was pressed meanwhile: send it again"));
        stop.heard();
      }
      input.leaseChanged();
      break;
    case "beat":
      drive.hear(message.n, nowMs, message.input);
      return; // nothing to draw
    case "stopped":
      input.stopped(
        message.command,
        message.reason === "expired" && drive.isLossy
          ? t("Link to URC too slow for this control")
          : (STOPPED[message.reason] ?? message.reason),
      );
      break;
    case "refused":
      if (message.command) input.stopped(message.command, said(message.message));
      else {
        drive.refused(message.message);
        input.refused(said(message.message));
      }
      break;
    case "error":
      console.warn(`URC: ${message.message}`);
      break;
  }
  wake();
}

/**
 * @param {any[]} rows
 * @param {number} nowMs
 */
function sentGoals(rows, nowMs) {
  const value = rows.map(({ number, command, places, by, page, since, lost = false, title = "" }) => ({
    number,
    command,
    title,
    places,
    by,
    isOurs: page === drive.lease?.you,
    since: (nowMs - since) / 1000,
    isLost: lost,
  }));
  return { look: JSON.stringify(rows.map(({ number, lost }) => [number, lost])), value: { isKnown: true, goals: value } };
}

/**
 * @param {string} command
 * @param {Record<string, import("../core/types.js").Given>} args
 * @param {import("../control/confirm_dialog.js").Ticket} [ticket] the confirmation of the command
 * @returns {Promise<Record<string, Value>>}
 */
function run(command, args, ticket) {
  lastId += 1;
  const id = lastId;
  return new Promise((resolve, reject) => {
    waiting.set(id, { resolve, reject });
    const said = { id, command, arguments: args, stops: drive.stops };
    ticket?.began(id);
    if (ticket) meant.set(id, { atMs: performance.now(), said });
    if (!socket.send({ t: ticket ? "prepare" : "run", ...said })) {
      meant.delete(id);
      waiting.delete(id);
      reject(new Error(t("no connection to URC")));
    }
  });
}

/**
 * Send a confirmed command, unless the confirmation is too old.
 *
 * @param {{id: number, token: string}} message
 */
function give({ id, token }) {
  const yes = meant.get(id);
  meant.delete(id);
  if (!yes) return;
  const isLate = performance.now() - yes.atMs > MEANT_MS;
  if (isLate || !socket.send({ t: "run", ...yes.said, token })) {
    settle({ id, ok: false, message: t("Not sent: the server answered too late") });
  }
}

/** Withdraw questions and confirmations after STOP. */
function forgetQuestions() {
  const why = t("STOP was pressed meanwhile: send it again");
  asks.stopped(why);
  for (const id of [...meant.keys()]) settle({ id, ok: false, message: why });
  meant.clear();
}

/** @param {Reply} reply */
function settle(reply) {
  const asked = waiting.get(reply.id);
  waiting.delete(reply.id);
  if (reply.ok) asked?.resolve(reply.values ?? {});
  else asked?.reject(failure(said(reply.message ?? reply.code ?? t("the command was not run")), reply.code ?? ""));
}

/**
 * @param {string} message
 * @param {string} code code of the failure; widgets decide with it whether the robot may still act
 */
function failure(message, code) {
  return Object.assign(new Error(message), { code });
}

/**
 * Fail pending commands, because no reply can arrive after the loss of the socket. Commands are
 * never repeated.
 */
function giveUpCommands() {
  for (const { reject } of waiting.values()) {
    reject(failure(t("Connection to URC lost: the result is unknown"), "disconnected"));
  }
  waiting.clear();
  meant.clear();
}

backSafely(part(root, "[data-back]"), {
  letGo: () => input.letGo(t("you left the page")),
  isMine: () => drive.isMine,
  leave: () => void drive.say("leave"),
  close: () => socket.close(),
});
offerSystems((system) => store.setUnits(system));
stop.takeOver(root);
offerHints(root);
tapWithAnyFinger();
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
