// @ts-check
/**
 * Causes of failed connections in the user's language, each with a hint. The server determines the
 * cause; see `urc.runtime.connection_cause`.
 */
import { ageText } from "./formatting.js";
import { mark, t } from "./words.js";

/**
 * Program at the robot that a transport needs, by transport type.
 *
 * @type {Record<string, string>}
 */
const PROGRAMS = {
  ros: mark("Is rosbridge running?"),
  mqtt: mark("Is the MQTT broker running?"),
  zenoh: mark("Is the Zenoh router running?"),
  ssh: mark("Is the SSH server running?"),
  http: mark("Is the robot's web server running?"),
  websocket: mark("Is the robot's web server running?"),
  telnet: mark("Is the Telnet server running?"),
};

/** Message about an extra that is not installed; see `urc._extras.missing`. */
const MISSING_PACKAGE = /\bneeds? the package /;

/** @type {Record<string, {cause: string, step: string}>} */
const CAUSES = {
  refused: { cause: mark("{place} refuses the connection."), step: mark("Is the robot's program running?") },
  unreachable: {
    cause: mark("URC's computer has no route to {place}."),
    step: mark("Is URC's computer on the robot's network?"),
  },
  timeout: { cause: mark("{place} does not answer."), step: mark("Is the robot switched on? Is its address correct?") },
  name: { cause: mark("The host name in {place} is unknown."), step: mark("Check the spelling, or enter a numeric address.") },
  "host-key": {
    cause: mark("URC does not trust the host key of {place}."),
    step: mark("Compare the host key with the one on the robot. If they match, run “urc trust”."),
  },
  permission: {
    cause: mark("URC has no permission to open {place}."),
    step: mark("Add the user that runs URC to the device's group."),
  },
  "sign-in": { cause: mark("{place} refuses the sign-in."), step: mark("Check the user name, password and key.") },
  tls: {
    cause: mark("URC cannot verify {place} over TLS."),
    step: mark("Check the certificate, and whether the port uses TLS."),
  },
  device: { cause: mark("{place} does not exist."), step: mark("Is the device plugged in? Check its path.") },
  closed: {
    cause: mark("{place} closes the connection."),
    step: mark("Does another program use the robot? Many robots accept only one connection."),
  },
  login: {
    cause: mark("{place} does not answer the sign-in."),
    step: mark("Check the user name and password, and the kind of robot."),
  },
  silent: {
    cause: mark("{place} accepts the connection, but sends nothing."),
    step: mark("Check the port and the kind of robot."),
  },
};

/**
 * Return the cause of a failure and a hint.
 *
 * @param {string} cause name of the cause; "" if unknown
 * @param {string} address such as `ros 127.0.0.1:9090`
 * @param {string} detail the transport's message, for an unknown cause
 * @returns {{cause: string, step: string, isForeign: boolean}} `isForeign`: the cause is in English
 */
export function causeWords(cause, address, detail) {
  const known = CAUSES[cause];
  if (!known) return { cause: detail, step: stepOf(detail), isForeign: detail !== "" };
  const program = cause === "refused" ? PROGRAMS[typeOf(address)] : undefined;
  return { cause: t(known.cause, { place: placeOf(address) }), step: t(program ?? known.step), isForeign: false };
}

/**
 * Return a hint for a failure without a known cause.
 *
 * @param {string} detail message of the server or the transport
 */
export function stepOf(detail) {
  // The message names the command that installs the package.
  if (MISSING_PACKAGE.test(detail)) return t("Install it, then start URC again.");
  return t("Check the settings of the robot.");
}

/** @param {string} address */
function typeOf(address) {
  return address.split(" ", 1)[0] ?? "";
}

/**
 * Return an address without its transport type, such as `127.0.0.1:9090` for `ros 127.0.0.1:9090`.
 *
 * @param {string} address
 */
export function placeOf(address) {
  const blank = address.indexOf(" ");
  return blank > 0 ? address.slice(blank + 1) : address;
}

/** @param {number} attempts failed attempts to connect */
export function attemptsText(attempts) {
  if (attempts === 1) return t("1 failed attempt");
  return attempts > 0 ? t("{n} failed attempts", { n: attempts }) : "";
}

/** @param {number} lostMs duration of the loss; no text below 1 s */
export function lostForText(lostMs) {
  return lostMs >= 1000 ? t("for {age}", { age: ageText(lostMs / 1000) }) : "";
}
