// @ts-check
/**
 * The menu: the state of each robot on its card, the order of the cards, search, filters, STOP ALL.
 *
 * @typedef {import("./card_words.js").Summary} Summary
 * @typedef {import("./card_words.js").Said} Said
 * @typedef {import("./fleet_poll.js").RobotList} RobotList
 */
import { SIGNS } from "../core/alarm_signs.js";
import { alarmWords, batteryWords, linkWords, whoWords } from "./card_words.js";
import { watchPictures } from "./card.js";
import { followRobots } from "./fleet_poll.js";
import { fits } from "./search.js";
import { placeSheets } from "./sheets.js";
import { StopAll } from "./stop_all.js";
import { t } from "../core/words.js";

/**
 * Time without input after which cards may change places, so that no card moves away under a
 * finger.
 */
const CALM_MS = 3000;
const KEPT = "urc-menu-filter";

const root = document.querySelector("[data-fleet]");
const list = document.querySelector("[data-cards]");
const cards = [...document.querySelectorAll("[data-robot-card]")].filter((el) => el instanceof HTMLElement);
/** @type {Map<string, HTMLElement>} */
const byName = new Map(cards.map((card) => [card.dataset["robotCard"] ?? "", card]));
const field = document.querySelector("[data-find-robot]");
const filters = [...document.querySelectorAll("[data-filter]")].filter((el) => el instanceof HTMLElement);
const tags = [...document.querySelectorAll("[data-tag]")].filter((el) => el instanceof HTMLElement);
const none = document.querySelector("[data-no-match]");
const noneOn = document.querySelector("[data-none-on]");
const title = document.title;
/** Wanted order of the cards. @type {string[]} */
let order = [];
let touchedMs = -CALM_MS;
/** @type {RobotList | null} */
let newest = null;
/** Poll the states at once. */
let poll = () => Promise.resolve();
const dock = document.querySelector("[data-stop-all]");
const stopAll = dock instanceof HTMLElement ? new StopAll(dock, onStopped) : null;

/** Show the results of STOP ALL on the cards, then ask for the new states. */
function onStopped() {
  if (newest) showAll(newest);
  void poll();
}

/** @param {RobotList | null} news */
function take(news) {
  if (root instanceof HTMLElement) root.dataset["stale"] = String(news === null);
  if (news === null) stopAll?.lose();
  if (news === null) return; // without a server, the last states stay, greyed out
  newest = news;
  stopAll?.follow(news.robots);
  showAll(news);
  order = news.robots.map(({ name }) => name);
  count();
  find();
  sort();
}

/** @param {RobotList} news */
function showAll(news) {
  for (const robot of news.robots) {
    const card = byName.get(robot.name);
    if (card && "live" in card.dataset) show(card, robot, news.time);
  }
}

/**
 * @param {HTMLElement} card
 * @param {Summary} robot
 * @param {number} nowS
 */
function show(card, robot, nowS) {
  const link = linkWords(robot, nowS);
  card.dataset["state"] = link.state;
  card.dataset["alarms"] = String(robot.alarms.count);
  card.dataset["worst"] = robot.alarms.worst;
  put(card, "[data-link]", link.words ? link : null);
  put(card, "[data-alarms]", alarmWords(robot));
  put(card, "[data-battery]", batteryWords(robot));
  put(card, "[data-who]", whoWords(robot, stopAll?.results.get(robot.name)?.result));
}

/**
 * @param {HTMLElement} card
 * @param {string} selector
 * @param {Said | null} what
 */
function put(card, selector, what) {
  const el = card.querySelector(`.urc-robot-state ${selector}`);
  if (!(el instanceof HTMLElement)) return;
  el.hidden = what === null;
  el.dataset["tone"] = what?.tone ?? "";
  if (el.textContent !== (what?.words ?? "")) el.textContent = what?.words ?? "";
}

function count() {
  const on = cards.filter(isOn).length;
  const alarms = cards.filter(hasAlarm).length;
  if (noneOn instanceof HTMLElement) noneOn.hidden = on > 0;
  /** @type {Record<string, number>} */
  const figures = { "": cards.length, on, alarms };
  for (const button of filters) {
    const figure = figures[button.dataset["filter"] ?? ""] ?? 0;
    const el = button.querySelector("[data-count]");
    if (el) el.textContent = String(figure);
  }
  document.title = alarms > 0 ? `${SIGNS[worstAlarm()]} ${alarms} · ${title}` : title;
}

/** @param {HTMLElement} card */
function isOn(card) {
  return "live" in card.dataset && card.dataset["state"] !== "off";
}

/** @param {HTMLElement} card */
function hasAlarm(card) {
  return Number(card.dataset["alarms"] ?? 0) > 0;
}

/** Return the highest priority of all alarms. @returns {"low" | "medium" | "high"} */
function worstAlarm() {
  const worst = new Set(cards.map((card) => card.dataset["worst"]));
  return worst.has("high") ? "high" : worst.has("medium") ? "medium" : "low";
}

/** Show the cards that match the typed words, the filter and the tag. */
function find() {
  const typed = field instanceof HTMLInputElement ? field.value : "";
  const filter = pressed(filters)?.dataset["filter"] ?? "";
  const tag = pressed(tags)?.dataset["tag"] ?? "";
  let found = 0;
  for (const card of cards) {
    const said = [...card.querySelectorAll("h2, [data-summary], .urc-robot-facts")].map((el) => el.textContent ?? "");
    const own = (card.dataset["cardTags"] ?? "").split(" ");
    const isShown =
      fits([card.dataset["robotCard"] ?? "", ...said, ...own.map((one) => `#${one}`)].join(" "), typed) &&
      (filter !== "on" || isOn(card)) &&
      (filter !== "alarms" || hasAlarm(card)) &&
      (tag === "" || own.includes(tag));
    card.hidden = !isShown;
    if (isShown) found += 1;
  }
  if (none instanceof HTMLElement) none.hidden = found > 0;
  const shown = cards.filter((card) => !card.hidden).map((card) => card.dataset["robotCard"] ?? "");
  stopAll?.choose(shown, typed.trim() === "" && filter === "" ? tag : "", found < cards.length);
}

/** Sort the cards, unless the page is currently in use. */
function sort() {
  if (!list || performance.now() - touchedMs < CALM_MS) return;
  if (list.contains(document.activeElement) || document.querySelector("[data-more]:popover-open")) return;
  const wanted = [...order.flatMap((name) => byName.get(name) ?? []), ...cards.filter((card) => !order.includes(card.dataset["robotCard"] ?? ""))];
  if (wanted.every((card, place) => list.children[place] === card)) return;
  list.append(...wanted);
}

/** @param {HTMLElement[]} buttons */
function pressed(buttons) {
  return buttons.find((one) => one.getAttribute("aria-pressed") === "true");
}

/**
 * @param {HTMLElement[]} buttons
 * @param {HTMLElement} chosen
 * @param {boolean} isOptional whether a second press undoes the choice
 */
function choose(buttons, chosen, isOptional) {
  const isBack = isOptional && chosen === pressed(buttons);
  for (const one of buttons) one.setAttribute("aria-pressed", String(one === chosen && !isBack));
  keep();
  find();
}

/** Store the filter for the return from a robot's page. */
function keep() {
  const kept = { filter: pressed(filters)?.dataset["filter"], tag: pressed(tags)?.dataset["tag"] };
  try {
    sessionStorage.setItem(KEPT, JSON.stringify(kept));
  } catch {
    // In private mode, the filter lasts until the page closes.
  }
}

function restore() {
  try {
    const kept = JSON.parse(sessionStorage.getItem(KEPT) ?? "{}");
    const filter = filters.find((one) => one.dataset["filter"] === kept.filter);
    const tag = tags.find((one) => one.dataset["tag"] === kept.tag);
    if (filter) choose(filters, filter, false);
    if (tag) choose(tags, tag, false);
  } catch {
    // If no valid filter is stored, all robots are shown.
  }
}

for (const button of filters) button.addEventListener("click", () => choose(filters, button, false));
for (const button of tags) button.addEventListener("click", () => choose(tags, button, true));
if (field instanceof HTMLInputElement) field.addEventListener("input", find);
for (const event of ["pointerdown", "pointermove", "keydown", "wheel", "scroll"]) {
  addEventListener(event, () => { touchedMs = performance.now(); }, { passive: true, capture: true });
}

restore();
if (root instanceof HTMLElement) take(JSON.parse(root.dataset["states"] ?? "null"));
find(); // the browser restores earlier input
poll = followRobots(take);
watchPictures();
placeSheets(t("Close"));
