// @ts-check
/**
 * The connection page, which tests the features that depend on the address, and opens the guide for
 * this device.
 *
 * @typedef {object} Feature
 * @property {string} title
 * @property {boolean} isThere
 * @property {string} why reason for a missing feature; "" for an available feature
 */
import { made, put } from "../core/dom.js";
import { mark, t } from "../core/words.js";
import { part } from "../live/badge.js";

const NEEDS_HTTPS = mark("Browsers offer this feature only over HTTPS, or on the computer that runs URC.");
const NEEDS_NAME = mark("Browsers offer this feature only over HTTPS with a domain name, not with an IP address.");
const NEEDS_TRUST = mark("Browsers offer this feature only with a certificate that this device trusts.");
const NOT_HERE = mark("This browser or device does not offer this feature.");

/** An IP address in the form of `location.hostname`. */
const IP = /^(\d+(\.\d+){3}|\[.*\])$/;

/** @param {boolean} isThere @returns {string} */
function why(isThere) {
  if (isThere) return "";
  return t(isSecureContext ? NOT_HERE : NEEDS_HTTPS);
}

/** @param {string} title @param {boolean} isThere @param {string} [reason] @returns {Feature} */
function feature(title, isThere, reason) {
  return { title, isThere, why: isThere ? "" : reason || why(false) };
}

/** @returns {Feature} */
function encryption() {
  if (location.protocol === "https:") return feature(t("Encrypted connection"), true);
  const isNear = isSecureContext;
  const reason = isNear
    ? t("Not needed: nothing leaves this computer.")
    : t("Everyone on this network can read and change the data, including keys and commands.");
  return feature(t("Encrypted connection"), false, reason);
}

/** @returns {Promise<boolean>} whether the browser accepts a service worker from this address */
async function keepsPages() {
  if (!isSecureContext || !("serviceWorker" in navigator)) return false;
  const late = new Promise((resolve) => setTimeout(resolve, 3000));
  return Boolean(await Promise.race([navigator.serviceWorker.ready, late]));
}

/** @param {boolean} isKept @returns {Feature[]} */
function features(isKept) {
  const hasWorkers = isSecureContext && "serviceWorker" in navigator;
  const hasName = !IP.test(location.hostname);
  const isPass = isSecureContext && hasName && "PublicKeyCredential" in globalThis;
  return [
    encryption(),
    feature(t("Tilt sensors"), isSecureContext && "DeviceOrientationEvent" in globalThis),
    feature(t("Gamepad"), "getGamepads" in navigator),
    feature(t("Screen stays on"), "wakeLock" in navigator),
    feature(t("Clipboard"), "clipboard" in navigator),
    feature(t("Installing as an app"), isKept, hasWorkers ? t(NEEDS_TRUST) : ""),
    feature(t("Passkeys"), isPass, hasName && isSecureContext ? t(NOT_HERE) : t(NEEDS_NAME)),
  ];
}

/** @param {Feature} one @returns {HTMLElement} */
function row(one) {
  const word = one.isThere ? t("available") : t("not available");
  return made(
    "li",
    { "data-there": String(one.isThere) },
    made("span", { "aria-hidden": "true" }, one.isThere ? "●" : "○"),
    made("span", {}, `${one.title}: ${word}`),
    one.why ? made("small", {}, one.why) : null,
  );
}

/** @returns {string} name of the guide for this device; "" if unknown */
function device() {
  const agent = navigator.userAgent;
  if (/Firefox/.test(agent) && !/Android/.test(agent)) return "firefox";
  if (/Android/.test(agent)) return "android";
  // An iPad identifies itself as a Mac, but has a touch screen.
  if (/iPhone|iPad/.test(agent) || (/Macintosh/.test(agent) && navigator.maxTouchPoints > 1)) return "ios";
  if (/Windows/.test(agent)) return "windows";
  if (/Macintosh/.test(agent)) return "macos";
  return /Linux|X11/.test(agent) ? "linux" : "";
}

part(document, "[data-place]").textContent = location.origin;
const list = part(document, "[data-features]");
put(list, features(false).map(row));
keepsPages().then((isKept) => put(list, features(isKept).map(row)));
const guide = document.querySelector(`[data-guide="${device()}"]`);
if (guide instanceof HTMLDetailsElement) guide.open = true;
// Safari installs a profile only from a page, not from a saved file.
if (device() === "ios") document.querySelector("[data-download]")?.removeAttribute("download");
