// @ts-check
/**
 * A manager page with repositories, installed packages and available packages. It shows the
 * server's lists, and polls them during a job or a refresh.
 *
 * @typedef {import("./rows.js").Shelf} Shelf
 */
import { ask, reason } from "../core/api_client.js";
import { part } from "../live/badge.js";
import { put, ready } from "../core/dom.js";
import { JobDialog } from "./job.js";
import { availableRow, installedRow, placeRow, row } from "./rows.js";
import { t } from "../core/words.js";

const BUSY_MS = 400;
/** Typing pause before the search starts. */
const TYPING_MS = 200;

const root = part(document, "[data-manage]");
const said = part(root, "[data-said]");
const counted = part(root, "[data-count]");
const lists = {
  installed: part(root, "[data-installed]"),
  available: part(root, "[data-available]"),
  repositories: part(root, "[data-repositories]"),
};
const words = /** @type {HTMLInputElement} */ (part(root, "[data-words]"));
const dialog = new JobDialog(
  /** @type {HTMLDialogElement} */ (part(root, "[data-job]")),
  (path, body) => act(path, body),
);

/** Number of the last request; responses to earlier requests are ignored. */
let round = 0;
/** @type {number | undefined} */
let again;
let looks = "";

/** @param {string} text @param {"" | "bad"} [kind] */
function say(text, kind = "") {
  said.textContent = text && kind === "bad" ? `▲ ${text}` : text;
  said.classList.toggle("urc-bad", kind === "bad");
}

/** @param {boolean} [force] whether to refresh from the repositories, regardless of their lists' age */
async function look(force = false) {
  try {
    await ask("/api/v1/repositories/ask", { force });
  } catch (error) {
    say(reason(error), "bad");
  }
  await refresh();
}

async function refresh() {
  round += 1;
  const mine = round;
  clearTimeout(again);
  const query = new URLSearchParams({ kinds: root.dataset["kinds"] ?? "", words: words.value });
  try {
    /** @type {Shelf} */
    const shelf = await ask(`/api/v1/packages?${query}`);
    if (mine !== round) return;
    show(shelf);
    const isBusy = shelf.isAsking || shelf.job?.state === "working";
    if (isBusy) again = window.setTimeout(() => void refresh(), BUSY_MS);
  } catch (error) {
    if (mine === round) say(reason(error), "bad");
  }
}

/** @param {Shelf} shelf */
function show(shelf) {
  root.dataset["asking"] = String(shelf.isAsking);
  dialog.show(shelf.job);
  const { job, ...rest } = shelf;
  const look = JSON.stringify(rest);
  if (look === looks) return; // a redraw could move a button under a finger
  looks = look;
  const doing = shelf.mayManage ? act : null;
  const { installed, available, repositories } = shelf;
  root.dataset["bare"] = String(repositories.length === 0 && !shelf.isAsking);
  put(lists.installed, installed.length ? installed.map((one) => installedRow(one, doing, remove)) : [
    row(t("Nothing is installed.")),
  ]);
  put(lists.available, available.map((one) => availableRow(one, doing)));
  put(lists.repositories, repositories.length ? repositories.map((one) => placeRow(one, doing)) : [
    row(shelf.isAsking ? t("asking …") : t("No repositories yet.")),
  ]);
  counted.textContent = countText(shelf);
}

/** @param {Shelf} shelf */
function countText({ total, available, isAsking, repositories }) {
  if (isAsking) return t("contacting the repositories …");
  if (repositories.length === 0) return t("Add a repository to see its packages.");
  if (total > available.length) return t("{shown} of {total} are shown: search for more", { shown: available.length, total });
  return t("{total} found", { total });
}

/**
 * Perform an action, show the result, and update the page.
 *
 * @param {string} path
 * @param {object | Blob} body
 * @returns {Promise<any>} the response; undefined for a refusal
 */
async function act(path, body) {
  say("");
  let answer;
  try {
    answer = await ask(`/api/v1/${path}`, body);
    const isJob = answer.state !== undefined;
    if (isJob && answer.state !== "cancelled") dialog.follow(answer);
    else if (!isJob && answer.line) say(`✓ ${answer.line}`);
  } catch (error) {
    say(reason(error), "bad");
  }
  await refresh();
  return answer;
}

/**
 * List the packages affected by a removal, and remove them after a confirmation.
 *
 * @param {string} wish
 */
async function remove(wish) {
  say("");
  try {
    const { gone, hasSettings } = await ask("/api/v1/packages/remove", { package: wish });
    dialog.confirm(wish, gone, hasSettings, (forget) => void act("packages/remove", { package: wish, yes: true, forget }));
  } catch (error) {
    say(reason(error), "bad");
  }
}

/** @param {string} selector @param {(form: HTMLFormElement) => Promise<any>} send */
function form(selector, send) {
  const el = root.querySelector(selector);
  if (!(el instanceof HTMLFormElement)) return;
  el.addEventListener("submit", (event) => {
    event.preventDefault();
    const submit = el.querySelector("button");
    if (submit) submit.disabled = true;
    void send(el).then((answer) => {
      if (answer) el.reset();
      if (submit) submit.disabled = false;
    });
  });
}

form("[data-connect]", (el) => {
  say(t("connecting …"));
  return act("repositories", { url: new FormData(el).get("url") });
});
form("[data-add]", (el) => act("packages/add", { path: new FormData(el).get("path") }));
form("[data-upload]", async (el) => {
  const file = new FormData(el).get("file");
  if (!(file instanceof File)) return undefined;
  return act(`packages/upload?${new URLSearchParams({ name: file.name })}`, new Blob([file]));
});

/** @type {number | undefined} */
let typing;
words.addEventListener("input", () => {
  clearTimeout(typing);
  typing = window.setTimeout(() => void refresh(), TYPING_MS);
});
part(root, "[data-ask]").addEventListener("click", () => void look(true));
document.addEventListener("visibilitychange", () => {
  if (!document.hidden) void look();
});
ready(root);
void look();
