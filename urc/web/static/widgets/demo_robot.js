// @ts-check
/**
 * One widget in one state of its demo. The page simulates its robot.
 *
 * Held controls run through the same modules as on the live page; only the socket is a stub.
 *
 * @typedef {import("../live/page_topics.js").Themes} Themes
 * @typedef {import("../core/types.js").Alarm} Alarm
 * @typedef {import("../core/types.js").Held} Held
 * @typedef {import("../core/types.js").Hello} Hello
 * @typedef {import("../core/types.js").Lease} Lease
 * @typedef {import("../core/types.js").Link} Link
 * @typedef {import("../core/types.js").StopState} StopState
 * @typedef {import("../core/types.js").Topics} Topics
 * @typedef {import("../core/types.js").Value} Value
 *
 * @typedef {object} Told One reading of a demo; an image has `picture` in base64.
 * @property {string} signal
 * @property {number} age In seconds.
 * @property {Alarm} alarm
 * @property {Held} [value]
 * @property {string} [picture]
 * @property {string} [type]
 *
 * @typedef {object} News Content of demo.yaml from the server.
 * @property {Hello} hello
 * @property {Told[]} readings
 * @property {Record<string, [number, Held][]>} history Signal → older readings, oldest first, each with
 *   its age in seconds.
 * @property {Partial<Topics> & {stop?: StopState}} follow
 * @property {Record<string, string | Record<string, Value>>} replies Values or failure reason of
 *   each command or output.
 */
import { ConfirmDialog } from "../control/confirm_dialog.js";
import { Drive } from "../control/drive.js";
import { DemoAlarms } from "../alarms/demo_alarms.js";
import { PageTopics, watched } from "../live/page_topics.js";
import { Host } from "./host.js";
import { Input } from "../control/input.js";
import { StopButton } from "../control/stop.js";
import { Store } from "../live/store.js";

const BEAT_MS = 50;
/** @type {Link} */
const LINE = {
  transport: "wire",
  state: "live",
  address: "tcp 192.168.1.20:6789",
  since: 0,
  detail: "",
  attempts: 0,
  faults: 0,
  cause: "",
  ready: true,
};
/** @type {Lease} */
const FREE = {
  you: "page",
  name: "This page",
  epoch: 1,
  holder: null,
  asker: null,
  left: 0,
  latched: "",
  stops: 0,
  confirmed: false,
  drives: true,
  forces: true,
  role: "maintain",
  spare: "",
};

/** A stub of the socket, which grants control on request. */
class PlayedSocket {
  /** @param {(text: string) => void} tell */
  constructor(tell) {
    this.tell = tell;
    this.unsent = 0;
    /** @type {Drive | null} */
    this.drive = null;
    this.epoch = FREE.epoch;
    this.beat = 0;
    this.stops = FREE.stops;
    setInterval(() => {
      if (this.drive?.isMine) this.drive.beat = this.beat += 1;
    }, BEAT_MS);
  }

  /** @param {any} message */
  send(message) {
    const { t: kind, ...rest } = message;
    if (kind === "drive") this.grant(message.verb);
    else if (kind === "stop") {
      this.stops += 1;
      this.lease({ latched: FREE.name, confirmed: true });
    }
    if (kind === "tick") this.tell(`${rest.command} ${JSON.stringify(rest.arguments ?? rest.values ?? {})}`);
    else this.tell(`${kind} ${JSON.stringify(rest)}`);
    return true;
  }

  /** @param {string} verb */
  grant(verb) {
    if (verb === "take" || verb === "force" || verb === "ask") {
      this.epoch += 1;
      this.lease({ holder: { id: FREE.you, name: FREE.name } });
    } else if (verb === "leave" || verb === "reset") this.lease({});
  }

  /** @param {Partial<Lease>} changed */
  lease(changed) {
    const lease = { ...FREE, epoch: this.epoch, stops: this.stops, ...changed };
    queueMicrotask(() => this.drive?.setLease(lease, performance.now()));
  }
}

export class DemoRobot {
  /**
   * @param {HTMLElement} el
   * @param {HTMLElement} bar element for questions of other pages
   * @param {() => void} wake
   * @param {(state: string, text: string) => void} tell
   * @param {Themes} themes
   */
  constructor(el, bar, wake, tell, themes) {
    this.el = el;
    this.themes = themes;
    /** @type {News} */
    this.news = JSON.parse(el.dataset["news"] ?? "{}");
    const state = el.dataset["stateName"] ?? "";
    const say = (/** @type {string} */ text) => tell(state, text);
    this.store = new Store();
    const socket = new PlayedSocket(say);
    this.drive = new Drive(/** @type {any} */ (socket), "", () => {
      this.input?.leaseChanged();
      wake();
    });
    socket.drive = this.drive;
    this.input = new Input(this.drive);
    this.stop = new StopButton(this.drive, this.input, this.store, []);
    this.alarms = new DemoAlarms(this.store, this.news.follow.alarms, say, wake);
    this.follows = new PageTopics(this.sources(), wake);
    this.host = new Host(this.store, this.doors(bar, wake, say));
    this.host.isAllInSight = true;
  }

  /**
   * @param {HTMLElement} bar
   * @param {() => void} wake
   * @param {(text: string) => void} say
   * @returns {Omit<import("./cell.js").Doors, "store">}
   */
  doors(bar, wake, say) {
    const { drive, input, stop, follows, news } = this;
    return {
      wake,
      again: wake,
      input,
      follows,
      alarms: this.alarms,
      asks: new ConfirmDialog(bar, (message) => {
        say(JSON.stringify(message));
        return true;
      }),
      run: (command, args) => {
        say(`${command} ${JSON.stringify(args)}`);
        const reply = this.reply(command);
        if (typeof reply === "string") return Promise.reject(new Error(reply));
        return Promise.resolve(reply);
      },
      steer: (command, verb) => say(`${verb} ${command}`),
      drive: (wish) => {
        drive.say(wish);
        drive.changed();
      },
      stop: {
        press: () => stop.press(),
        follow: (listener, signal) => {
          if (news.follow.stop) listener(news.follow.stop);
          else stop.follow(listener, signal);
        },
      },
    };
  }

  /** @param {string} command */
  reply(command) {
    const { outputs } = JSON.parse(this.el.dataset["config"] ?? "{}");
    const names = Object.keys(outputs).filter((name) => outputs[name].command === command);
    const known = [command, ...names].find((name) => Object.hasOwn(this.news.replies, name));
    return known === undefined ? {} : (this.news.replies[known] ?? {});
  }

  /** @returns {import("../live/page_topics.js").Sources} */
  sources() {
    const { follow } = this.news;
    /** @type {Topics} */
    const calm = {
      links: { isUp: true, links: [LINE] },
      log: { lines: [], missing: 0 },
      lease: { lease: FREE, isMine: false, refusal: "" },
      alarms: [],
      watched: { limited: 0, known: 0 },
      latency: { isUp: true, tripMs: 12, failures: 0, skewMs: 0, messages: 0, bytes: 0 },
      sequences: {},
      goals: { isKnown: true, goals: [] },
      theme: { name: "" },
    };
    /** @type {any} */
    const made = {};
    for (const what of /** @type {(keyof Topics)[]} */ (Object.keys(calm))) {
      const value = follow[what] ?? calm[what];
      made[what] = () => ({ look: "", value });
    }
    made.alarms = () => this.alarms.news();
    if (!follow.watched) made.watched = () => watched(this.store, performance.now());
    if (!follow.lease) {
      made.lease = () => {
        const { lease, isMine, refusal } = this.drive;
        return { look: JSON.stringify([lease, refusal]), value: { lease, isMine, refusal } };
      };
    }
    made.theme = () => this.themes.news(); // the page's own colours in all states
    return made;
  }

  /**
   * Start the widget; resolves when the widget is mounted or shows a card with the reason.
   *
   * @param {string} system unit system
   */
  async start(system) {
    const { store, news } = this;
    const nowMs = performance.now();
    store.hello(news.hello, nowMs);
    store.setUnits(system);
    const { isUp, links } = news.follow.links ?? { isUp: true, links: [LINE] };
    store.setUp(true, nowMs);
    store.setLinks([...links], nowMs);
    if (!isUp) store.setUp(false, nowMs);
    const { lease } = news.follow.lease ?? { lease: FREE };
    if (lease) this.drive.setLease(lease, nowMs);
    await this.host.mountAll(this.el.parentNode ?? document);
  }

  /** Play the older readings one after the other, then the current readings. */
  play() {
    const past = Object.entries(this.news.history);
    const steps = Math.max(0, ...past.map(([, readings]) => readings.length));
    for (let step = 0; step < steps; step += 1) {
      for (const [signal, readings] of past) {
        const reading = readings[step];
        if (reading) this.say({ signal, age: reading[0], alarm: "", value: reading[1] });
      }
      this.host.frame(performance.now());
    }
    for (const told of this.news.readings) this.say(told);
  }

  /** Keep the readings at their declared age, without announcing them again. */
  keep() {
    const nowMs = performance.now();
    for (const { signal, age } of this.news.readings) {
      const sample = this.store.samples.get(signal);
      if (sample) sample.timeMs = nowMs - age * 1000;
    }
  }

  /** @param {Told} told */
  say({ signal, age, alarm, value, picture, type }) {
    const nowMs = performance.now();
    const index = this.store.names.indexOf(signal);
    const ageMs = age * 1000;
    if (picture === undefined) {
      this.store.values({ n: nowMs, i: [index], v: [value ?? null], a: [ageMs], s: [alarm] }, nowMs);
    } else {
      const bytes = Uint8Array.from(atob(picture), (letter) => letter.charCodeAt(0));
      this.store.picture({ index, sentMs: nowMs, ageMs, number: 0, type: type ?? "", bytes }, nowMs);
    }
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    this.host.frame(nowMs);
    this.follows.frame();
    this.stop.frame();
  }
}
