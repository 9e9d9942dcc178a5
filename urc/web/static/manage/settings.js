// @ts-check
/**
 * A robot's settings. The page sends them as text, the server tests them, and the page marks
 * invalid fields. Unsaved input stays in the fields.
 *
 * @typedef {object} Line
 * @property {string} transport
 * @property {string} type
 * @property {string} address
 * @property {"answers" | "opens" | "fails"} verdict
 * @property {string} text
 * @property {string} advice
 * @property {string} cause name of the cause of a failure; "" if unknown
 * @property {string} field setting that the result concerns; "" if unknown
 *
 * @typedef {object} Answer
 * @property {boolean} isSaved
 * @property {string} text
 * @property {Record<string, string>} faults
 * @property {string[]} missing
 * @property {Line[]} lines
 */
import { ask, reason } from "../core/api_client.js";
import { part } from "../live/badge.js";
import { causeWords } from "../core/connection_causes.js";
import { button, made, ready } from "../core/dom.js";
import { mark, t } from "../core/words.js";
import { SettingChanges } from "./setting_changes.js";
import { renewGroups } from "./setting_groups.js";

const KEPT_S = 365 * 24 * 3600;
/** @type {Record<string, [string, string]>} */
const VERDICTS = {
  answers: ["●", mark("answers")],
  opens: ["◆", mark("connected, nothing heard")],
  fails: ["▲", mark("not reached")],
};

/** @type {Record<Line["verdict"], string>} */
const TONES = { answers: "good", opens: "caution", fails: "bad" };

const root = part(document, "[data-settings]");
const form = /** @type {HTMLFormElement} */ (part(root, "[data-form]"));
const said = part(root, "[data-said]");
const found = part(root, "[data-found]");
const tester = form.querySelector("[data-test]");
const plain = form.querySelector("[data-plain]");
const hint = form.querySelector("[data-save-hint]");
const changes = new SettingChanges(form);
let isBusy = false;
const version = form.elements.namedItem("version");
/** Driver version whose settings the form shows. */
let shownVersion = chosen("version");

/** @returns {Record<string, string | null>} */
function filled() {
  /** @type {Record<string, string | null>} */
  const settings = {};
  for (const field of form.querySelectorAll("[data-field] :is(input, select)")) {
    if (!(field instanceof HTMLInputElement || field instanceof HTMLSelectElement)) continue;
    if (field.disabled) continue;
    const isUntouched = "secret" in field.dataset && field.value === "" && !changes.forgotten.has(field.name);
    settings[field.name] = isUntouched ? null : field.value;
  }
  return settings;
}

/** @param {string} name @returns {string} */
function chosen(name) {
  const field = form.elements.namedItem(name);
  return field instanceof HTMLSelectElement ? field.value : "";
}

/** Offer to save only what has changed; a test is possible at any time. */
function offer() {
  const hasChange = changes.unsaved().length > 0;
  changes.show();
  warn(hasChange);
  if (plain instanceof HTMLButtonElement) {
    plain.disabled = isBusy;
    plain.hidden = !hasChange;
  }
  if (hint instanceof HTMLElement) hint.hidden = !hasChange;
  if (!(tester instanceof HTMLButtonElement)) return;
  tester.disabled = isBusy;
  tester.textContent = hasChange ? t("Test & save") : t("Test connection");
  tester.classList.toggle("urc-button-main", hasChange);
  const open = form.querySelector("[data-open]");
  open?.classList.toggle("urc-button-main", !hasChange);
  if (open instanceof HTMLElement) open.hidden = !changes.isComplete();
}

/** Let the browser ask before the page is left. @param {boolean} hasChange */
function warn(hasChange) {
  if (hasChange) addEventListener("beforeunload", hold);
  else removeEventListener("beforeunload", hold); // else browsers keep no copy for “Back”
}

/** @param {BeforeUnloadEvent} event */
function hold(event) {
  event.preventDefault();
}

/** @param {boolean} isLocked */
function lock(isLocked) {
  isBusy = isLocked;
  for (const one of form.querySelectorAll("button")) one.disabled = isBusy;
  form.toggleAttribute("aria-busy", isBusy);
  offer();
}

/** @param {{test: boolean, anyway?: boolean}} how */
async function send({ test, anyway = false }) {
  lock(true);
  tell(test ? t("testing the connection …") : t("saving …"));
  mistakes({});
  lines([]);
  const [sent, hasChange] = [changes.values(), changes.unsaved().length > 0];
  try {
    /** @type {Answer} */
    const answer = await ask(root.dataset["post"] ?? "", {
      settings: filled(),
      version: chosen("version"),
      interface: chosen("interface"),
      monitorsAlarms: { true: true, false: false }[chosen("monitoring")] ?? null,
      test,
      anyway,
    });
    mistakes(answer.faults);
    lines(answer.lines);
    const isTest = test && !hasChange && answer.isSaved;
    tell(`${answer.isSaved ? "✓" : "▲"} ${isTest ? t("Tested. The settings are unchanged.") : answer.text}`, answer.isSaved ? "" : "urc-bad");
    if (answer.isSaved) saved(sent);
    else if (answer.lines.length) offerAnyway();
    showResults(answer.lines);
  } catch (error) {
    tell(`▲ ${reason(error)}`, "urc-bad");
  }
  lock(false);
  if (!form.querySelector("[aria-invalid]")) return;
  const first = form.querySelector("[aria-invalid='true']");
  if (first instanceof HTMLElement) first.focus();
}

/** @param {string} text @param {string} [kind] */
function tell(text, kind = "") {
  said.className = `urc-said ${kind}`.trim();
  if (said.textContent !== text) said.textContent = text; // the same text is not read out again
}

function offerAnyway() {
  const more = button(t("Save anyway"), "anyway", () => void send({ test: false }));
  const rows = part(found, "[data-lines]");
  found.querySelector("[data-key='anyway']")?.remove();
  rows.after(more);
}

/** @param {Map<import("./setting_changes.js").Field, string>} sent a field may have changed since */
function saved(sent) {
  changes.keep(sent);
  if (changes.unsaved().length > 0) count(); // changed while it was being saved
  // The interface chosen here becomes the device's choice.
  const path = root.dataset["robot"] ?? "/";
  const name = encodeURIComponent(chosen("interface"));
  if (name) document.cookie = `urc-interface=${name}; path=${path}; max-age=${KEPT_S}; samesite=strict`;
}

/** Say how many changes are not saved, or what the robot still needs. */
function count() {
  const [n, missing] = [changes.unsaved().length, changes.missing()];
  const words = n === 1 ? t("1 change is not saved")
    : n > 1 ? t("{n} changes are not saved", { n })
    : missing.length > 0 ? t("Not set yet: {names}.", { names: missing.join(", ") }) : "";
  tell(words ? `◆ ${words}` : t("All changes are saved"));
}

/** @param {Record<string, string>} faults */
function mistakes(faults) {
  for (const box of form.querySelectorAll("[data-field]")) {
    if (!(box instanceof HTMLElement)) continue;
    const text = faults[box.dataset["field"] ?? ""] ?? "";
    const told = part(box, "[data-fault]");
    told.textContent = text && `▲ ${text}`;
    told.hidden = !text;
    const field = box.querySelector("input, select");
    delete told.dataset["tested"];
    if (text) field?.setAttribute("aria-invalid", "true");
    else field?.removeAttribute("aria-invalid");
    if (text) unfold(box);
  }
}

/**
 * Show the results of a test at the fields that they concern; at each field, the failures first.
 *
 * @param {Line[]} some
 */
function showResults(some) {
  const order = ["fails", "opens", "answers"];
  const sorted = some.toSorted((one, other) => order.indexOf(one.verdict) - order.indexOf(other.verdict));
  for (const box of form.querySelectorAll("[data-field]")) {
    const name = box instanceof HTMLElement ? box.dataset["field"] : "";
    const here = sorted.filter(({ field }) => field !== "" && field === name);
    const told = box.querySelector("[data-fault]");
    const verdict = here[0]?.verdict; // the worst
    if (!verdict || !(told instanceof HTMLElement) || !told.hidden) continue;
    told.replaceChildren(...here.map((one) => {
      const about = { class: "urc-result", "data-tone": TONES[one.verdict] };
      return made("span", about, resultOf(one, some.length > 1));
    }));
    told.dataset["tested"] = "";
    told.hidden = false;
    if (verdict === "fails") box.querySelector("input, select")?.setAttribute("aria-invalid", "true");
    if (verdict !== "answers") unfold(box);
  }
}

/**
 * @param {Line} line
 * @param {boolean} isNamed whether the name of the transport is needed
 */
function resultOf({ verdict, transport, cause, address, text }, isNamed) {
  const [sign, word] = VERDICTS[verdict] ?? ["", verdict];
  const name = isNamed ? `${transport}: ` : "";
  if (verdict === "answers") return `${sign} ${name}${t(word)}`;
  const words = causeWords(cause, address, text);
  return `${sign} ${name}${words.cause} ${words.step}`;
}

/** Remove the result of a test from a changed field. @param {Event} event */
function outdate(event) {
  const box = event.target instanceof Element ? event.target.closest("[data-field]") : null;
  const told = box?.querySelector("[data-fault][data-tested]");
  if (!box || !(told instanceof HTMLElement) || told.hidden) return;
  told.hidden = true;
  box.querySelector("input, select")?.removeAttribute("aria-invalid");
}

/** Open the group of a field. @param {Element} box */
function unfold(box) {
  box.closest("[data-group]")?.setAttribute("open", "");
}

/** @param {Line[]} some */
function lines(some) {
  found.hidden = some.length === 0;
  found.querySelector("[data-key='anyway']")?.remove();
  part(found, "[data-lines]").replaceChildren(
    ...some.map((one) => {
      const [sign, word] = VERDICTS[one.verdict] ?? ["", one.verdict];
      const kind = one.verdict === "fails" ? "urc-bad" : one.verdict === "opens" && one.advice ? "urc-caution" : "";
      return made(
        "li",
        { class: "urc-row", "data-line": one.transport, "data-verdict": one.verdict },
        made("h3", { class: `urc-row-title ${kind}`.trim() }, `${sign} ${one.transport}: ${t(word)}`),
        made("p", { class: "urc-small" }, one.address),
        one.verdict !== "answers" && made("p", { lang: "en" }, one.text),
        one.verdict !== "answers" && one.cause === "" && one.advice && made("p", { lang: "en" }, one.advice),
      );
    }),
  );
}

/** Show the settings of the chosen driver version, which may differ from those of the former one. */
async function changeVersion() {
  if (!(version instanceof HTMLSelectElement)) return;
  const wanted = version.value;
  lock(true);
  mistakes({});
  lines([]);
  try {
    await renewGroups(form, changes, version);
    shownVersion = wanted;
    count();
  } catch (error) {
    version.value = shownVersion; // the fields are still those of this version
    tell(`▲ ${reason(error)}`, "urc-bad");
  }
  lock(false);
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  void send({ test: true });
});
form.addEventListener("input", outdate);
form.addEventListener("input", (event) => {
  offer();
  count();
  if (event.target === version) void changeVersion();
});
plain?.addEventListener("click", () => void send({ test: false }));
// On the form, because another driver version brings other fields.
form.addEventListener("click", ({ target }) => {
  const pressed = target instanceof Element ? target.closest("[data-forget], [data-usual]") : null;
  if (!(pressed instanceof HTMLElement)) return;
  if (pressed.dataset["forget"] !== undefined) {
    changes.forget(pressed.dataset["forget"]);
    offer();
    tell(t("To be deleted when you save"));
    return;
  }
  const field = pressed.closest("[data-field]")?.querySelector("input, select");
  if (field instanceof HTMLInputElement || field instanceof HTMLSelectElement) changes.useDefault(field);
});
ready(root);
offer();
if (tester) count();
