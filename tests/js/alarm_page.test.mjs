// The alarms of a page as its elements: strip, list, hidden alarms, history, title and announcements.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

import { FakeElement, install } from "./dom.mjs";

const body = install();
const { PageAlarms } = await import("../../urc/web/static/alarms/page_alarms.js");
const { Store } = await import("../../urc/web/static/live/store.js");

/** @type {{path: string, body: any}[]} */
let asked = [];
/** @type {any} */
let answer = {};
/** @type {any} */
globalThis.fetch = async (/** @type {string} */ path, /** @type {any} */ how) => {
  asked.push({ path, body: how.body ? JSON.parse(how.body) : null });
  return { ok: true, headers: new Map([["content-type", "application/json"]]), json: async () => answer };
};

beforeEach(() => {
  body.replaceChildren();
  asked = [];
  answer = { signals: [], stored: true };
  document.title = "Rover";
});

/** @param {string} role */
function pageOf(role = "drive", count = 3) {
  const strip = new FakeElement("section");
  strip.hidden = true;
  strip.setAttribute("data-alarm-strip", "");
  const said = new FakeElement("div");
  body.append(strip, said);
  const store = new Store();
  const signals = Array.from({ length: count }, (_, at) => ({ name: `s${at}`, type: "number", title: `Signal ${at}`, unit: "%", stale_after_s: 60 }));
  store.hello(/** @type {any} */ ({ robot: "", title: "", now: 0, signals }), 0);
  store.setUp(true, 0);
  const told = /** @type {string[]} */ ([]);
  const page = new PageAlarms(/** @type {any} */ ({ root: body, strip, said, store, path: "/api/v1/robots/rover/alarms", lease: () => ({ role }), wake() {}, tell: (/** @type {string} */ text) => told.push(text) }));
  return { page, strip, said, told, store };
}

/** @param {number} at @param {object} more */
function row(at, more = {}) {
  return { signal: `s${at}`, condition: "high", priority: "high", state: "unacknowledged", number: at, group: 1, raised: 100 + at, began: Date.now(), value: "9", active: true, known: true, ...more };
}

/** @param {object[]} rows @returns {any} */
function message(rows, more = {}) {
  return { t: "alarms", now: Date.now(), rows, full: true, ...more };
}

/** @param {FakeElement} el @param {string} selector */
function texts(el, selector) {
  return el.querySelectorAll(selector).map(({ textContent }) => textContent);
}

test("the strip is there with an alarm only, and shows the worst one with its action", () => {
  const { page, strip } = pageOf();
  page.frame(0);
  assert.equal(strip.hidden, true);
  page.take(message([row(1, { priority: "medium" }), row(2, { action: "Dock now." })]));
  page.frame(0);
  assert.equal(strip.hidden, false);
  assert.deepEqual(texts(strip, ".urc-alarm-line"), ["Signal 2: High, 9"]);
  assert.deepEqual(texts(strip, ".urc-alarm-action"), ["Dock now."]);
  assert.deepEqual(texts(strip, ".urc-alarm-more"), ["1 more alarm"]);
  assert.deepEqual([strip.getAttribute("data-priority"), strip.getAttribute("data-flash"), document.title], ["high", "true", "▲ 2 · Rover"]);
  page.take({ ...message([row(2, { state: "acknowledged" }), row(1, { priority: "medium", state: "acknowledged" })]), full: false });
  page.frame(0);
  assert.equal(strip.getAttribute("data-flash"), null, "nothing flashes that was acknowledged");
  assert.equal(strip.querySelector("[data-alarm-seen]")?.hidden, true);
  page.take(message([]));
  page.frame(0);
  assert.deepEqual([strip.hidden, document.title], [true, "Rover"]);
});

test("the strip acknowledges the alarm that it shows, as it was seen", async () => {
  const { page, strip, told } = pageOf();
  page.take(message([row(1), row(2, { priority: "low" })]));
  page.frame(0);
  strip.querySelector("[data-alarm-seen]")?.fire("click");
  assert.deepEqual(asked, [{ path: "/api/v1/robots/rover/alarms/acknowledge", body: { alarms: { s1: 101 } } }]);
  await new Promise((resolve) => setTimeout(resolve));
  answer = { signals: ["s1"], stored: false };
  await page.acknowledge([{ signal: "s1", raised: 101 }]);
  assert.equal(told.length, 1, "an action that is not stored is told");
});

test("the list has every alarm, its cause and its actions, and hidden ones apart", () => {
  const { page } = pageOf();
  page.take(message([row(0, { cause: "Dust.", action: "Clean it.", times: 4 }), row(1, { state: "shelved", shelved_by: "Ada", shelved_until: Date.now() + 60_500 }), row(2, { known: false })]));
  page.open();
  page.frame(0);
  const list = /** @type {FakeElement} */ (body.querySelector("[data-alarm-list]"));
  assert.deepEqual(list.children.map((item) => item.getAttribute("data-alarm")), ["s0", "s2"]);
  const [first, second] = list.children;
  assert.match(first?.textContent ?? "", /Signal 0: High, 9→ Clean it\.Dust\.not acknowledged · high priority · since .* · number 0 · 4 times/);
  assert.match(second?.textContent ?? "", /value unknown: the alarm stays active/);
  const hidden = /** @type {FakeElement} */ (body.querySelector("[data-alarm-hidden]"));
  assert.match(hidden.textContent, /Signal 1.*shelved by Ada, 1 min left/);
  first?.querySelector("[data-key=see-s0]")?.fire("click");
  const choice = /** @type {FakeElement} */ (first?.querySelector("[data-key=shelve-s0]"));
  choice.value = "60";
  choice.fire("change");
  hidden.querySelector("[data-key=back-s1]")?.fire("click");
  assert.deepEqual(asked.map(({ path, body: said }) => [path.split("/").at(-1), said]), [
    ["acknowledge", { alarms: { s0: 100 } }],
    ["shelve", { signals: ["s0"], for_s: 3600 }],
    ["unshelve", { signals: ["s1"] }],
  ]);
});

test("who only watches is offered no action", () => {
  const { page, strip } = pageOf("watch");
  page.take(message([row(0), row(1)]));
  page.open();
  page.frame(0);
  assert.equal(strip.querySelector("[data-alarm-seen]")?.hidden, true);
  assert.equal(body.querySelectorAll(".urc-alarm-deeds").length, 0);
  assert.equal(body.querySelector("[data-key=all]")?.hidden, true);
});

test("first-out order is one press away", () => {
  const { page } = pageOf();
  page.take(message([row(0, { priority: "low" }), row(1, { priority: "medium" }), row(2)]));
  page.open();
  page.frame(0);
  const order = () => body.querySelector("[data-alarm-list]")?.children.map((item) => item.getAttribute("data-alarm"));
  assert.deepEqual(order(), ["s2", "s1", "s0"]);
  body.querySelector("[data-key=order]")?.fire("click");
  page.frame(0);
  assert.deepEqual(order(), ["s0", "s1", "s2"]);
});

test("elements stay while only values change, so that no button is lost under a finger", () => {
  const { page, store } = pageOf();
  page.take(message([row(0)]));
  page.open();
  page.frame(0);
  const item = body.querySelector("[data-alarm=s0]");
  store.values({ n: 0, i: [0], v: [88], a: 0, s: ["high"] }, 0);
  page.frame(100);
  assert.equal(body.querySelector("[data-alarm=s0]"), item);
  assert.match(item?.textContent ?? "", /Signal 0: High, 88 %/);
});

test("200 alarms are one line of the list, one announcement and one frame's work", () => {
  const { page, said } = pageOf("drive", 200);
  const spoken = new Set();
  for (let at = 0; at < 200; at += 4) {
    const rows = [0, 1, 2, 3].map((more) => row(at + more));
    page.take({ ...message(rows), full: false, flood: at > 10 });
    page.frame(at);
    spoken.add(said.textContent);
  }
  clearTimeout(page.timer);
  assert.ok(spoken.size <= 2, [...spoken].join("; "));
  page.open();
  page.frame(200);
  const list = /** @type {FakeElement} */ (body.querySelector("[data-alarm-list]"));
  assert.equal(list.childElementCount, 1);
  assert.match(list.textContent, /200 alarms in one burst.*first: Signal 0/);
  assert.match(body.querySelector(".urc-alarm-note")?.textContent ?? "", /^200 alarms\. Flood/);
  list.querySelector("[data-key=burst-1]")?.fire("click");
  page.frame(201);
  assert.equal(list.childElementCount, 1 + 99 + 1, "the burst, 99 of its alarms, and the rest as a number");
  assert.match(list.children.at(-1)?.textContent ?? "", /^101 more alarms$/);
  body.querySelector("[data-key=all]")?.fire("click");
  assert.equal(Object.keys(asked[0]?.body.alarms).length, 200, "none is left out");
  assert.equal(document.title, "▲ 200 · Rover");
});

test("the history is searched, and older events follow", async () => {
  const { page } = pageOf();
  const event = (/** @type {number} */ id, more = {}) => ({ id, at: 1e9 + id, signal: "s0", title: "Signal 0", kind: "raised", condition: "high", priority: "high", value: "9", who: "", until: 0, times: 1, ...more });
  answer = { events: [event(9, { kind: "acknowledged", who: "Ada" }), event(8)], has_more: true, fault: "", lost: 2 };
  page.open();
  const { history } = page.sheet;
  history.el.setAttribute("open", "");
  /** @type {any} */ (history.el).fire("toggle");
  await new Promise((resolve) => setTimeout(resolve));
  const list = /** @type {FakeElement} */ (body.querySelector("[data-alarm-events]"));
  assert.equal(list.childElementCount, 2);
  assert.match(list.children[0]?.textContent ?? "", /Signal 0: High · acknowledged · by Ada/);
  assert.match(body.querySelector(".urc-alarm-history")?.textContent ?? "", /2 events could not be stored/);
  answer = { events: [event(7)], has_more: false, fault: "", lost: 0 };
  await history.show(true);
  assert.equal(list.childElementCount, 3);
  assert.match(asked.at(-1)?.path ?? "", /history\?last=50&before=8$/);
  assert.equal(history.more.hidden, true);
});
