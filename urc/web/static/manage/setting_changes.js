// @ts-check
/**
 * What a robot's settings form differs in: from the saved settings, and from the driver's defaults.
 *
 * The module marks each field that is not saved, offers the way back to the default, and writes the
 * summary of each group. An empty field means the default.
 *
 * @typedef {HTMLInputElement | HTMLSelectElement} Field
 */
import { t } from "../core/words.js";

/** Most changed settings that the summary of a group names; more are only counted. */
const MOST_NAMES = 2;

export class SettingChanges {
  /** @param {HTMLFormElement} form */
  constructor(form) {
    this.form = form;
    /** Secrets to delete. @type {Set<string>} */
    this.forgotten = new Set();
    /** Saved values since the page was loaded. @type {Map<Element, string>} */
    this.kept = new Map();
  }

  /** @returns {Field[]} */
  fields() {
    return /** @type {Field[]} */ ([...this.form.elements].filter(isField));
  }

  /** @returns {Map<Field, string>} */
  values() {
    return new Map(this.fields().map((field) => [field, field.value]));
  }

  /** Return the fields that differ from the saved settings. */
  unsaved() {
    return this.fields().filter((field) => this.isUnsaved(field));
  }

  /** Return the titles of empty fields without which the robot cannot connect. */
  missing() {
    const boxes = [...this.form.querySelectorAll("[data-needed]")];
    return boxes.filter((box) => !hasValue(box)).map(titleOf);
  }

  /** @param {Field} field */
  isUnsaved(field) {
    return this.forgotten.has(field.name) || field.value !== (this.kept.get(field) ?? firstOf(field));
  }

  /** Take values as saved. @param {Map<Field, string>} sent a field may have changed since */
  keep(sent) {
    for (const [field, value] of sent) {
      this.kept.set(field, value);
      if (!("secret" in field.dataset)) continue;
      if (value) setSecret(field, true);
      field.value = "";
      this.kept.set(field, "");
    }
    this.forgotten.clear();
    for (const box of this.form.querySelectorAll("[data-needed]")) {
      if (hasValue(box)) box.removeAttribute("data-needed");
    }
  }

  /** Return whether the saved settings are enough to connect. */
  isComplete() {
    return this.form.querySelector("[data-needed]") === null;
  }

  /** Mark a secret to be deleted. @param {string} name */
  forget(name) {
    this.forgotten.add(name);
    const field = this.form.elements.namedItem(name);
    if (!isField(field)) return;
    field.value = "";
    setSecret(field, false);
  }

  /** Put a field back to the driver's default. @param {Field} field */
  useDefault(field) {
    field.value = "";
    field.dispatchEvent(new Event("input", { bubbles: true }));
    field.focus();
  }

  /** Show all marks and summaries. */
  show() {
    for (const field of this.fields()) {
      const box = field.closest(".urc-field");
      if (!(box instanceof HTMLElement)) continue;
      const isUnsaved = this.isUnsaved(field);
      box.toggleAttribute("data-changed", isUnsaved);
      hide(box.querySelector("[data-unsaved]"), !isUnsaved);
      hide(box.querySelector("[data-usual]"), field.value === "");
    }
    for (const group of this.form.querySelectorAll("[data-group]")) {
      const place = group.querySelector("[data-group-says]");
      if (place) write(place, summaryOf(group));
    }
  }
}

/**
 * @param {unknown} one
 * @returns {one is Field}
 */
function isField(one) {
  return one instanceof HTMLInputElement || one instanceof HTMLSelectElement;
}

/** Return the value of a field when the page was loaded. @param {Field} field */
function firstOf(field) {
  if (field instanceof HTMLInputElement) return field.defaultValue;
  const options = [...field.options];
  return (options.find((one) => one.defaultSelected) ?? options[0])?.value ?? "";
}

/**
 * @param {Field} field
 * @param {boolean} isSet
 */
function setSecret(field, isSet) {
  field.toggleAttribute("data-set", isSet);
  if (field instanceof HTMLInputElement) field.placeholder = isSet ? "••••••" : "";
}

/** Return whether a value is entered or stored. @param {Element} box of a setting */
function hasValue(box) {
  const field = box.querySelector("input, select");
  return isField(field) && (field.value !== "" || "set" in field.dataset);
}

/** @param {Element} box of a setting */
function titleOf(box) {
  return box.querySelector("label")?.textContent?.trim() ?? "";
}

/** @param {Element} group */
function summaryOf(group) {
  const boxes = [...group.querySelectorAll("[data-field]")];
  if (boxes.length === 0) return namesIn(group);
  const own = boxes.filter(hasValue);
  const n = boxes.length;
  if (own.length === 0) return n === 1 ? t("1 setting, default") : t("{n} settings, all default", { n });
  if (n === 1) return t("1 setting, changed");
  if (own.length > MOST_NAMES) return t("{n} settings, {count} changed", { n, count: own.length });
  return t("{n} settings, changed: {names}", { n, names: own.map(titleOf).join(", ") });
}

/** Return the chosen driver and interface. @param {Element} group */
function namesIn(group) {
  const names = [...group.querySelectorAll("[data-named]")].map((one) =>
    one instanceof HTMLSelectElement ? one.selectedOptions[0]?.textContent : one.textContent,
  );
  return names.map((name) => name?.trim()).filter(Boolean).join(" · ");
}

/**
 * @param {Element | null} el
 * @param {boolean} isHidden
 */
function hide(el, isHidden) {
  if (el instanceof HTMLElement) el.hidden = isHidden;
}

/**
 * @param {Element} el
 * @param {string} text
 */
function write(el, text) {
  if (el.textContent !== text) el.textContent = text;
}
