// @ts-check
/**
 * Rows of a manager page: repositories, installed packages and available packages.
 *
 * @typedef {object} Job
 * @property {number} number
 * @property {string} title
 * @property {"working" | "asks" | "done" | "failed" | "cancelled"} state
 * @property {string} line
 * @property {number} done
 * @property {number} of
 * @property {boolean} isUpdate
 * @property {string[]} packages
 * @property {string[]} may
 * @property {string[]} risks
 * @property {string[]} unsigned
 * @property {string[]} gained
 * @property {string[]} lost
 * @property {string[]} wire
 * @property {string} stays
 * @property {string[]} notes
 *
 * @typedef {object} Place
 * @property {string} url
 * @property {string} name
 * @property {number} count
 * @property {string} fault
 * @property {boolean} isKept
 * @property {boolean} isPlain
 * @property {string} keeper
 *
 * @typedef {object} Known Common fields of packages.
 * @property {string} package
 * @property {string} name
 * @property {string} kind
 * @property {string} version
 * @property {string} summary
 * @property {string} licence
 * @property {string[]} authors
 *
 * @typedef {object} Has
 * @property {string[]} brings
 * @property {string} newer
 * @property {string} before
 * @property {string} url
 * @property {string} settingsUrl
 * @property {string[]} fits
 * @property {string} fault
 * @property {string[]} withdrawn
 * @typedef {Known & Has} Installed
 *
 * @typedef {object} Offer
 * @property {string[]} versions
 * @property {string} origin
 * @property {number} size
 * @property {string} has
 * @typedef {Known & Offer} Available
 *
 * @typedef {object} Shelf
 * @property {Place[]} repositories
 * @property {Installed[]} installed
 * @property {Available[]} available
 * @property {number} total
 * @property {boolean} isAsking
 * @property {boolean} mayManage
 * @property {Job | null} job
 *
 * @typedef {((path: string, body: object) => Promise<any>) | null} Act null if no action is
 *   permitted
 */
import { button, made } from "../core/dom.js";
import { mark, t } from "../core/words.js";

/** @type {Record<string, string>} */
const KINDS = {
  driver: mark("driver"),
  robot: mark("robot"),
  interface: mark("interface"),
  widget: mark("widget"),
};

/**
 * @param {string} text
 * @param {...(Node | string | false)} more
 */
export function row(text, ...more) {
  return made("li", { class: "urc-row" }, text, ...more);
}

/** @param {string} text @param {string} [kind] */
function line(text, kind = "urc-small") {
  return text ? made("p", { class: kind }, text) : null;
}

/** @param {Known} one */
function head(one) {
  return made("h3", { class: "urc-row-title" }, `${one.name} ${one.version}`);
}

/** @param {Known} one */
function about(one) {
  const parts = [t(KINDS[one.kind] ?? one.kind), one.licence, one.authors.join(", ")];
  return line(parts.filter(Boolean).join(" · "));
}

/** @param {string} href @param {string} text @param {string} name */
function link(href, text, name) {
  return href ? made("a", { class: "urc-button", href, "data-key": `${name} ${href}`, "aria-label": `${text}: ${name}` }, text) : null;
}

/**
 * @param {Installed} one
 * @param {Act} act
 * @param {(wish: string) => void} remove
 */
export function installedRow(one, act, remove) {
  const wish = `${one.package}@${one.version}`;
  const says = (/** @type {string} */ text) => ({ "aria-label": `${text}: ${one.name} ${one.version}` });
  return made(
    "li",
    { class: "urc-row", "data-package": one.package, "data-version": one.version },
    head(one),
    line(one.summary, ""),
    about(one),
    line(one.fault && `▲ ${one.fault}`, "urc-bad"),
    ...one.withdrawn.map((text) => made("p", { class: "urc-bad" }, `▲ ${text}`)),
    line(one.fits.length ? t("offered on: {names}", { names: one.fits.join(", ") }) : ""),
    line(one.kind === "interface" && !one.fits.length ? t("◆ no compatible robot on this server") : "", "urc-caution"),
    line(one.brings.length ? t("depends on: {names}", { names: one.brings.join(", ") }) : ""),
    made(
      "div",
      { class: "urc-ways" },
      link(one.url, one.kind === "widget" ? t("Show") : t("Open"), one.name),
      link(one.settingsUrl, t("Settings"), one.name),
      act && one.newer && button(t("Update to {version}", { version: one.newer }), `update ${wish}`, () => void act("packages/update", { package: wish }), says(t("Update to {version}", { version: one.newer }))),
      act && one.before && button(t("Restore {version}", { version: one.before }), `back ${wish}`, () => void act("packages/back", { package: wish }), says(t("Restore {version}", { version: one.before }))),
      act && button(t("Remove"), `remove ${wish}`, () => remove(wish), says(t("Remove"))),
    ),
  );
}

/** @param {Available} one @param {Act} act */
export function availableRow(one, act) {
  const isHere = one.has === one.version;
  const choice = act && one.versions.length > 1 && made(
    "select",
    { class: "urc-input", "aria-label": t("Version of {name}", { name: one.name }), "data-key": `version ${one.package}` },
    ...one.versions.map((version) => made("option", { value: version }, version)),
  );
  const install = () => {
    const version = choice instanceof HTMLSelectElement ? choice.value : one.version;
    void act?.("packages/install", { package: `${one.package}@${version}` });
  };
  const key = `install ${one.package}`;
  return made(
    "li",
    { class: "urc-row", "data-package": one.package },
    head(one),
    line(one.summary, ""),
    about(one),
    line(t("from {place}, {size} kB", { place: one.origin, size: Math.max(1, Math.round(one.size / 1000)) })),
    line(one.has ? t("✓ {version} is installed", { version: one.has }) : ""),
    act && made(
      "div",
      { class: "urc-ways" },
      choice,
      (!isHere || choice) && button(t("Install"), key, install, { "aria-label": `${t("Install")}: ${one.name}` }),
    ),
  );
}

/** @param {Place} one @param {Act} act */
export function placeRow(one, act) {
  const state = !one.fault
    ? t("● {count} package versions", { count: one.count })
    : one.isKept
      ? t("◆ unreachable; using its last index: {count} package versions", { count: one.count })
      : t("▲ not reached");
  const kind = !one.fault ? "" : one.isKept ? "urc-caution" : "urc-bad";
  return made(
    "li",
    { class: "urc-row", "data-repository": one.url },
    made("h3", { class: "urc-row-title" }, one.name || one.url),
    line(one.name ? one.url : ""),
    line(state, kind),
    line(one.fault),
    line(one.keeper ? t("its index is signed by {name}", { name: one.keeper }) : ""),
    line(one.isPlain ? t("not encrypted: others on the network can change its index") : ""),
    act && made(
      "div",
      { class: "urc-ways" },
      button(t("Forget"), `forget ${one.url}`, () => void act("repositories/remove", { url: one.url }), { "aria-label": `${t("Forget")}: ${one.name || one.url}` }),
    ),
  );
}
