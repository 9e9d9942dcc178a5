// @ts-check
/**
 * Starts the gallery: each widget in each state of its demo, with a stub of a robot.
 *
 * Every cell has its own store, host and stub, so that states do not influence each other. A list
 * shows each widget's commands.
 *
 * Once all widgets are mounted and drawn, the page sets `data-ready` on the element with
 * `data-gallery`.
 */
import { part } from "../live/badge.js";
import { t } from "./kit.js";
import { DemoRobot } from "./demo_robot.js";
import { Themes } from "../live/page_topics.js";
import { chosenSystem } from "../core/units.js";

/** Interval for repeating readings, so that they do not become stale. */
const REPEAT_MS = 1000;
const STAMP_EVERY_MS = 700;
const LINES_KEPT = 100;

const gallery = part(document, "[data-gallery]");
const sent = part(gallery, "[data-sent]");
const bar = part(document, "[data-bar]");

/**
 * Add a command to the list.
 *
 * @param {string} state
 * @param {string} text
 */
function tell(state, text) {
  const line = document.createElement("li");
  line.textContent = `${state}: ${text}`;
  sent.prepend(line);
  while (sent.childElementCount > LINES_KEPT) sent.lastElementChild?.remove();
}

/** @type {DemoRobot[]} */
const exhibits = [];
let isFrameDue = false;

function wake() {
  if (isFrameDue) return;
  isFrameDue = true;
  requestAnimationFrame(() => {
    isFrameDue = false;
    const nowMs = performance.now();
    for (const exhibit of exhibits) exhibit.frame(nowMs);
  });
}

async function start() {
  const themes = new Themes(wake);
  for (const el of gallery.querySelectorAll("[data-news]")) {
    if (el instanceof HTMLElement) exhibits.push(new DemoRobot(el, bar, wake, tell, themes));
  }
  const mounted = exhibits.map((exhibit) => exhibit.start(chosenSystem()));
  setInterval(() => {
    for (const exhibit of exhibits) exhibit.keep();
    wake();
  }, REPEAT_MS);
  wake();
  await Promise.all(mounted);
  for (const exhibit of exhibits) exhibit.play();
  wake();
  await frames(3);
  gallery.dataset["ready"] = "";
}

/** @param {number} count */
async function frames(count) {
  for (let frame = 0; frame < count; frame += 1) {
    await new Promise((resolve) => requestAnimationFrame(resolve));
  }
}

/** Reload the page when a file of its widgets was saved after the server read them. */
async function watch() {
  const url = gallery.dataset["stamp"];
  if (!url) return;
  const before = gallery.dataset["stampNow"];
  for (;;) {
    try {
      const answer = await fetch(url, { cache: "no-store" });
      if (answer.ok && (await answer.text()) !== before) {
        location.reload();
        return;
      }
    } catch {
      // The server may be restarting, so try again later.
    }
    await new Promise((resolve) => setTimeout(resolve, STAMP_EVERY_MS));
  }
}

const choice = document.querySelector("select[data-size-choice]");
choice?.addEventListener("change", () => {
  if (choice instanceof HTMLSelectElement) gallery.dataset["size"] = choice.value;
});

void start().catch((error) => tell("URC", t("the gallery could not start: {error}", { error: String(error) })));
void watch();
