// @ts-check
/**
 * A new ROS robot: the page finds the topics at an address, offers those that fit each part, and
 * adds the robot. All names are from the robot, so they are shown only as text.
 *
 * @typedef {{name: string, type: string}} Topic
 *
 * @typedef {object} Found
 * @property {"rosbridge" | "foxglove" | "zenoh"} via
 * @property {number} port
 * @property {1 | 2} version
 * @property {number} total
 * @property {Record<string, Topic[]>} parts
 */
import { ask, reason } from "../core/api_client.js";
import { made, ready } from "../core/dom.js";
import { t } from "../core/words.js";
import { part } from "../live/badge.js";

const TWIST = "geometry_msgs/Twist";

const root = part(document, "[data-new]");
const find = root.querySelector("[data-find]");
const choose = root.querySelector("[data-choose]");
/** @type {(Found & {host: string}) | null} */
let found = null;

/** @param {HTMLFormElement} form @param {string} name */
function valueOf(form, name) {
  const field = form.elements.namedItem(name);
  return field instanceof HTMLInputElement || field instanceof HTMLSelectElement ? field.value.trim() : "";
}

/** @param {string} place @param {string} text @param {boolean} [isBad] */
function tell(place, text, isBad = false) {
  const said = part(root, place);
  said.className = isBad ? "urc-said urc-bad" : "urc-said";
  said.textContent = text;
}

/** @param {HTMLFormElement} form @param {boolean} isBusy */
function lock(form, isBusy) {
  for (const one of form.querySelectorAll("button")) one.disabled = isBusy;
  form.toggleAttribute("aria-busy", isBusy);
}

/** @param {HTMLFormElement} form @param {HTMLFormElement} next */
async function look(form, next) {
  const host = valueOf(form, "host");
  const port = valueOf(form, "port");
  next.hidden = true;
  if (host === "") return tell("[data-said]", `▲ ${t("Enter the address of the robot.")}`, true);
  if (port !== "" && !(/^\d+$/.test(port) && Number(port) >= 1 && Number(port) <= 65535)) {
    return tell("[data-said]", `▲ ${t("Port of the bridge")}. ${t("A port, 1 to 65535")}`, true);
  }
  lock(form, true);
  tell("[data-said]", t("looking for topics …"));
  try {
    /** @type {Found} */
    const answer = await ask("/api/v1/new/topics", { host, port: port === "" ? null : Number(port) });
    found = { ...answer, host };
    tell("[data-said]", "");
    offer(next, answer);
  } catch (error) {
    tell("[data-said]", `▲ ${reason(error)}`, true);
  }
  lock(form, false);
}

/** @param {HTMLFormElement} form @param {Found} answer */
function offer(form, { via, port, version, total, parts }) {
  part(form, "[data-found]").textContent = t("{total} topics of ROS {version}, over {via} on port {port}", { total, version, via, port });
  for (const select of form.querySelectorAll("[data-part]")) {
    if (!(select instanceof HTMLSelectElement)) continue;
    const topics = parts[select.name] ?? [];
    const options = topics.map(({ name, type }) => made("option", { value: name }, `${name} (${type || t("unknown type")})`));
    if (!("needed" in select.dataset)) options.push(made("option", { value: "" }, t("none")));
    else if (topics.length === 0) options.push(made("option", { value: "" }, t("no topic fits")));
    select.replaceChildren(...options);
  }
  const lacks = [...form.querySelectorAll("[data-needed]")].some((one) => one instanceof HTMLSelectElement && one.value === "");
  tell("[data-added]", lacks ? `▲ ${t("URC cannot drive a robot without these topics.")}` : "", lacks);
  form.hidden = false;
  lock(form, lacks);
  part(form, "h2").focus();
}

/** @param {HTMLFormElement} form */
async function add(form) {
  if (!found) return;
  const { host, port, via, version, parts } = found;
  const topics = Object.fromEntries(
    [...form.querySelectorAll("[data-part]")].map((one) => {
      const name = one instanceof HTMLSelectElement ? one.name : "";
      return [name, valueOf(form, name)];
    }),
  );
  const command = parts["cmd_vel"]?.find(({ name }) => name === topics["cmd_vel"]);
  const title = valueOf(form, "title") || host;
  lock(form, true);
  tell("[data-added]", t("adding …"));
  try {
    const answer = await ask("/api/v1/new/robot", { title, host, port, via, version, commandType: command?.type || TWIST, topics });
    location.assign(answer.url);
  } catch (error) {
    tell("[data-added]", `▲ ${reason(error)}`, true);
    lock(form, false);
  }
}

if (find instanceof HTMLFormElement && choose instanceof HTMLFormElement) {
  find.addEventListener("submit", (event) => {
    event.preventDefault();
    void look(find, choose);
  });
  choose.addEventListener("submit", (event) => {
    event.preventDefault();
    void add(choose);
  });
}
ready(root);
