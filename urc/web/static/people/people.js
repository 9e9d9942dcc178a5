// @ts-check
/**
 * The administrator's page: people, devices, programs, guests and sign-ins.
 *
 * @typedef {import("./rows.js").Principal} Principal
 * @typedef {import("./rows.js").SignIn} SignIn
 */
import { ask, reason } from "../core/api_client.js";
import { button, made, put, ready } from "../core/dom.js";
import { t } from "../core/words.js";
import { part } from "../live/badge.js";
import { roleText, sayer } from "./code.js";
import { PeopleDialog } from "./dialogs.js";
import { principalRow, quiet, signInRow, time } from "./rows.js";

/** Interval for updating the lists. */
const LOOK_MS = 5000;
const LISTS = /** @type {const} */ (["people", "devices", "tokens", "guests"]);
/** @type {Record<string, () => string>} */
const EMPTY = {
  people: () => t("No people yet."),
  devices: () => t("No paired devices yet."),
  tokens: () => t("No tokens yet."),
  guests: () => t("No guest links yet."),
};

const root = part(document, "[data-people]");
const say = sayer(root);
const dialog = new PeopleDialog(/** @type {HTMLDialogElement} */ (part(root, "[data-dialog]")));
const owners = /** @type {HTMLSelectElement} */ (part(root, "[data-owners]"));
const roleFields = /** @type {HTMLTemplateElement} */ (part(root, "[data-role-fields]"));

/** Number of the last update; responses to earlier updates are ignored. */
let round = 0;
let shown = "";

async function refresh() {
  round += 1;
  const mine = round;
  try {
    const answers = await Promise.all([...LISTS, "sign-ins"].map((name) => ask(`/api/v1/${name}`)));
    const look = JSON.stringify(answers);
    if (mine !== round || look === shown) return; // a redraw could move a button under a finger
    shown = look;
    LISTS.forEach((name, index) => list(name, answers[index].entries));
    signIns(answers[LISTS.length].entries);
    ownersOf(answers[0].entries);
  } catch (error) {
    say(reason(error), "bad");
  }
}

/** @param {string} name @param {Principal[]} entries */
function list(name, entries) {
  const rows = entries.map((one) => principalRow(one, buttonsOf(one)));
  put(part(root, `[data-rows="${name}"]`), rows.length ? rows : [quiet(EMPTY[name]?.() ?? "")]);
}

/** @param {SignIn[]} entries */
function signIns(entries) {
  const rows = entries.filter(({ way }) => way !== "token").map((one) => signInRow(one, [
    button(t("End"), `end ${one.id}`, () => endSignIn(one), { "aria-label": t("End the sign-in of {name}", { name: one.name }) }),
  ]));
  put(part(root, '[data-rows="sign-ins"]'), rows.length ? rows : [quiet(t("No sign-ins."))]);
}

/** @param {Principal[]} people */
function ownersOf(people) {
  const chosen = owners.value;
  owners.replaceChildren(owners.options[0] ?? "", ...people.map(({ id, name }) => made("option", { value: id }, name)));
  owners.value = people.some(({ id }) => id === chosen) ? chosen : "";
}

/** @param {Principal} one @returns {HTMLElement[]} */
function buttonsOf(one) {
  const key = one.id;
  const { name } = one;
  /** @param {string} text @param {string} word @param {string} label @param {() => void} act */
  const make = (text, word, label, act) => button(text, `${word} ${key}`, act, { "aria-label": label });
  return [
    one.kind === "person" && make(t("Invite"), "invite", t("Invite {name}", { name }), () => void invite(one)),
    one.kind !== "guest" && !one.owner && make(t("Roles"), "roles", t("Roles of {name}", { name }), () => roles(one)),
    make(t("Rename"), "rename", t("Rename {name}", { name }), () => rename(one)),
    (one.kind === "person" || one.kind === "guest") && one.signIns > 0 &&
      make(t("End all sign-ins"), "revoke", t("End all sign-ins of {name}", { name }), () => revoke(one)),
    make(t("Remove"), "remove", t("Remove {name}", { name }), () => remove(one.id, name, one.kind)),
  ].filter((made) => made !== false);
}

/**
 * Perform a change, show the result, and update the lists.
 *
 * @param {string} path
 * @param {object} body
 * @returns {Promise<any>} the response; undefined for a refusal
 */
async function act(path, body) {
  say("");
  let answer;
  try {
    answer = await ask(`/api/v1/${path}`, body);
    if (answer.line) say(`✓ ${answer.line}`);
  } catch (error) {
    say(reason(error), "bad");
    part(root, "[data-said]").scrollIntoView({ block: "nearest" });
  }
  await refresh();
  return answer;
}

/** @param {Principal} one */
async function invite(one) {
  const made = await act("people/invite", { id: one.id });
  if (!made) return;
  dialog.secret(
    t("Invitation of {name}", { name: one.name }),
    t("{name} can open this link to choose a passphrase. The link works once, until {time}. URC never shows it again.", { name: one.name, time: time(made.endsAt) }),
    made.link,
    made.qr,
  );
}

/** @param {Principal} one */
function rename(one) {
  const field = /** @type {HTMLInputElement} */ (made("input", { class: "urc-input", type: "text", value: one.name, maxlength: "64", "aria-label": t("Name") }));
  const save = () => {
    dialog.close();
    void act("people/rename", { id: one.id, name: field.value });
  };
  const form = made("form", { class: "urc-fields" }, field, ways(save));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    save();
  });
  dialog.show(t("Rename {name}", { name: one.name }), form);
}

/** @param {Principal} one */
function roles(one) {
  let grants = [...one.roles];
  const rows = made("ul", { class: "urc-rows" });
  const fields = made("div", { class: "urc-form" }, roleFields.content.cloneNode(true));
  const draw = () => {
    const taken = grants.map((grant) => made("li", { class: "urc-row urc-pair" }, made("span", { class: "urc-grow" }, roleText(grant)),
      button(t("Remove"), `take ${grant}`, () => {
        grants = grants.filter((other) => other !== grant);
        draw();
      }, { "aria-label": t("Remove {role}", { role: roleText(grant) }) })));
    put(rows, taken.length ? taken : [quiet(t("no role"))]);
  };
  fields.append(button(t("Add"), "add", () => {
    const grant = grantIn(fields);
    if (!grants.includes(grant)) grants.push(grant);
    draw();
  }));
  draw();
  dialog.show(t("Roles of {name}", { name: one.name }), rows, fields, ways(() => {
    dialog.close();
    void act("people/roles", { id: one.id, roles: grants });
  }));
}

/** @param {() => void} save */
function ways(save) {
  return made("div", { class: "urc-ways" }, button(t("Cancel"), "no", () => dialog.close()), button(t("Save"), "save", save, { class: "urc-button-main" }));
}

/** @param {Principal} one */
function revoke({ id, name }) {
  dialog.confirm(t("End all sign-ins of {name}?", { name }), t("Browsers and devices of {name} lose their connection. A robot that they drive stops. Devices must be paired again.", { name }),
    t("End all sign-ins"), () => void act("people/revoke", { id }));
}

/** @param {string} id @param {string} name @param {string} kind */
function remove(id, name, kind) {
  const text = kind === "person"
    ? t("{name} loses all sign-ins and devices at once. A robot that {name} drives stops.", { name })
    : t("{name} loses its connection at once. A robot that it drives stops.", { name });
  dialog.confirm(t("Remove {name}?", { name }), text, t("Remove"), () => void act("people/remove", { id }));
}

/** @param {SignIn} one */
function endSignIn({ id, name, way }) {
  const text = way === "pairing" ? t("This device must be paired again.") : t("This browser must sign in again.");
  dialog.confirm(t("End the sign-in of {name}?", { name }), text, t("End"), () => void act("sign-ins/end", { id }));
}

/** @param {Element} fields @returns {string} */
function grantIn(fields) {
  const [role, scope] = ["role", "scope"].map((name) => /** @type {HTMLSelectElement} */ (part(fields, `[name=${name}]`)).value);
  return role === "administer" ? role : `${role}${scope}`; // the role is for all robots
}

/** @param {string} kind @param {(form: HTMLFormElement, data: FormData) => Promise<any>} send */
function form(kind, send) {
  const el = root.querySelector(`[data-add="${kind}"]`);
  if (!(el instanceof HTMLFormElement)) return;
  const submit = /** @type {HTMLButtonElement} */ (part(el, "[type=submit]"));
  el.addEventListener("submit", (event) => {
    event.preventDefault();
    submit.disabled = true;
    void send(el, new FormData(el)).then((answer) => {
      submit.disabled = false;
      const name = el.elements.namedItem("name");
      if (answer && name instanceof HTMLInputElement) name.value = "";
    });
  });
}

form("person", (el, data) => act("people/add", { name: data.get("name"), roles: [grantIn(el)] }));
form("device", (el, data) => pair({ name: String(data.get("name") ?? ""), owner: owners.value, roles: owners.value ? [] : [grantIn(el)] }));
form("program", async (el, data) => {
  const commands = String(data.get("commands") ?? "").split(",").map((one) => one.trim()).filter(Boolean);
  const days = data.get("days") ? Number(data.get("days")) : null;
  const made = await act("tokens/add", { name: data.get("name"), roles: [grantIn(el)], commands, days });
  if (made) dialog.secret(t("Token of {name}", { name: made.name }), t("Copy the token now: URC never shows it again."), made.token);
  return made;
});
form("guest", async (_, data) => {
  const made = await act("guests/add", { name: data.get("name"), robot: data.get("robot"), hours: Number(data.get("hours")) });
  if (made) dialog.secret(t("Guest link"), t("With this link, guests can watch the robot until {time}. URC never shows it again.", { time: time(made.endsAt) }), made.link, made.qr);
  return made;
});

/** @param {{name: string, owner: string, roles: string[]}} wish */
async function pair(wish) {
  const code = await act("devices/pair", wish);
  if (code) dialog.pairing(code, { again: () => void pair(wish), changed: () => void refresh(), remove: (id, name) => remove(id, name, "device") });
  return code;
}

/** Hide the roles of a device with an owner, because the device has its owner's roles. */
function showRoles() {
  for (const field of owners.form?.querySelectorAll("[data-role-field]") ?? []) {
    if (field instanceof HTMLElement) field.hidden = owners.value !== "";
  }
}

owners.addEventListener("change", showRoles);
setInterval(() => {
  if (!document.hidden) void refresh();
}, LOOK_MS);
showRoles();
ready(root);
void refresh();
