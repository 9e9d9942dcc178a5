// @ts-check
/** The visitor's own account: sign-out, passphrase, devices and sign-ins. */
import { ask, reason } from "../core/api_client.js";
import { button, put, ready } from "../core/dom.js";
import { t } from "../core/words.js";
import { part } from "../live/badge.js";
import { rolesText, sayer } from "./code.js";
import { PeopleDialog } from "./dialogs.js";
import { passkeysPart } from "./passkeys.js";
import { principalRow, quiet, signInRow } from "./rows.js";

const root = part(document, "[data-account]");
const say = sayer(root);
const dialog = new PeopleDialog(/** @type {HTMLDialogElement} */ (part(root, "[data-dialog]")));
const change = /** @type {HTMLFormElement} */ (part(root, "[data-change]"));
const passkeys = part(root, "[data-passkeys]");
const out = /** @type {HTMLButtonElement} */ (part(root, "[data-out]"));

async function refresh() {
  let account;
  try {
    account = await ask("/api/v1/account");
  } catch (error) {
    say(reason(error), "bad");
    return;
  }
  const isPerson = account.mayPair;
  part(root, "[data-roles]").textContent = rolesText(account.roles);
  out.hidden = account.kind === "device" || account.kind === "";
  part(root, "[data-shift]").hidden = !isPerson && account.kind !== "device";
  part(root, "[data-passphrase]").hidden = !isPerson;
  part(root, "[data-current]").hidden = !account.hasPassphrase;
  if (isPerson && passkeys.hidden) passkeysPart(passkeys, dialog, say);
  part(root, "[data-devices]").hidden = !isPerson;
  /** @type {import("./rows.js").Principal[]} */
  const devices = account.devices;
  put(part(root, "[data-device-rows]"), devices.length ? devices.map((one) => principalRow(one, [
    button(t("Remove"), `remove ${one.id}`, () => remove(one.id, one.name), { "aria-label": t("Remove {name}", { name: one.name }) }),
  ])) : [quiet(t("No paired devices yet."))]);
  /** @type {import("./rows.js").SignIn[]} */
  const signIns = account.signIns;
  put(part(root, "[data-sign-in-rows]"), signIns.map((one) => signInRow(one, one.isOwn ? [] : [
    button(t("End"), `end ${one.id}`, () => dialog.confirm(t("End this sign-in?"), about(one), t("End"), () => void act("account/sign-ins/end", { id: one.id }))),
  ], one.kind === "device" && isPerson)));
}

/** @param {import("./rows.js").SignIn} one */
function about({ way }) {
  return way === "pairing" ? t("This device must be paired again.") : t("This browser must sign in again.");
}

/** @param {string} path @param {object} body @returns {Promise<any>} */
async function act(path, body) {
  say("");
  let answer;
  try {
    answer = await ask(`/api/v1/${path}`, body);
    if (answer.line) say(`✓ ${answer.line}`);
  } catch (error) {
    say(reason(error), "bad");
  }
  await refresh();
  return answer;
}

/** @param {string} id @param {string} name */
function remove(id, name) {
  dialog.confirm(t("Remove {name}?", { name }), t("{name} loses its connection at once. A robot that it drives stops.", { name }),
    t("Remove"), () => void act("account/devices/remove", { id }));
}

async function pair() {
  const code = await act("account/devices/pair", {});
  if (code) dialog.pairing(code, { again: () => void pair(), changed: () => void refresh(), remove });
}

out.addEventListener("click", () => {
  out.disabled = true;
  ask("/api/v1/sign-out", {}).then(
    () => location.replace("/"),
    (error) => {
      say(reason(error), "bad");
      out.disabled = false;
    },
  );
});
part(root, "[data-pair-device]").addEventListener("click", () => void pair());
change.addEventListener("submit", (event) => {
  event.preventDefault();
  const data = new FormData(change);
  if (data.get("passphrase") !== data.get("again")) {
    say(t("The two passphrases differ."), "bad");
    return;
  }
  void act("account/passphrase", { current: data.get("current") ?? "", passphrase: data.get("passphrase") }).then((answer) => {
    if (!answer) return;
    change.reset();
    say(t("✓ The passphrase was changed; all other sign-ins have ended."));
  });
});
ready(root);
void refresh();
