// @ts-check
/** The section “Passkeys” on the account page: the list, and adding a passkey. */
import { reason } from "../core/api_client.js";
import { button, made, put, ready } from "../core/dom.js";
import { t } from "../core/words.js";
import { part } from "../live/badge.js";
import { addPasskey, obstacle, ownPasskeys, removePasskey, renamePasskey } from "./passkey.js";
import { quiet, time } from "./rows.js";

/**
 * @typedef {import("./types.js").Passkey} Passkey
 * @typedef {(text: string, kind?: "" | "bad") => void} Say
 * @typedef {{ confirm(title: string, text: string, verb: string, act: () => void): void }} Questions
 */

/**
 * Fill the section for a signed-in person.
 *
 * @param {HTMLElement} root element of the section
 * @param {Questions} questions
 * @param {Say} say
 */
export function passkeysPart(root, questions, say) {
  const rows = part(root, "[data-passkey-rows]");
  const form = /** @type {HTMLFormElement} */ (part(root, "[data-passkey-add]"));
  const name = /** @type {HTMLInputElement} */ (part(form, "[name=passkey]"));
  const submit = /** @type {HTMLButtonElement} */ (part(form, "[type=submit]"));
  const reasonWhyNot = obstacle();
  const note = part(root, "[data-passkey-obstacle]");
  note.textContent = reasonWhyNot;
  note.hidden = !reasonWhyNot;
  form.hidden = Boolean(reasonWhyNot);
  name.value = thisDevice();

  /** @param {Passkey[]} passkeys */
  function show(passkeys) {
    put(rows, passkeys.length ? passkeys.map(row) : [quiet(t("No passkeys yet."))]);
    root.hidden = false;
  }

  /** @param {() => Promise<Passkey[]>} change @param {string} done */
  async function act(change, done) {
    say("");
    try {
      show(await change());
      if (done) say(`✓ ${done}`);
    } catch (error) {
      say(reason(error), "bad");
    }
  }

  /** @param {Passkey} one */
  function row(one) {
    const title = /** @type {HTMLInputElement} */ (made("input", {
      class: "urc-input", type: "text", maxlength: "64", value: one.name, "aria-label": t("Name of the passkey"),
      "data-key": `name ${one.id}`, onchange: () => void act(() => renamePasskey(one.id, title.value), t("The passkey was renamed.")),
    }));
    const used = one.used_at ? t("last use {time}", { time: time(one.used_at) }) : t("not used yet");
    return made("li", { class: "urc-row" },
      title, made("p", {}, one.host), made("p", { class: "urc-small" }, used),
      made("div", { class: "urc-ways" }, button(t("Remove"), `remove ${one.id}`, () => remove(one), { "aria-label": t("Remove {name}", { name: one.name }) })));
  }

  /** @param {Passkey} one */
  function remove(one) {
    questions.confirm(t("Remove {name}?", { name: one.name }), t("The passkey no longer signs you in. Sign-ins that began with it continue; end them in the list below."),
      t("Remove"), () => void act(() => removePasskey(one.id), t("The passkey was removed.")));
  }

  form.addEventListener("submit", (event) => {
    event.preventDefault();
    if (!name.value.trim()) {
      say(t("Enter a name for the passkey."), "bad");
      name.focus();
      return;
    }
    submit.disabled = true;
    void act(async () => {
      await addPasskey(name.value);
      return ownPasskeys();
    }, t("The passkey was added.")).finally(() => (submit.disabled = false));
  });
  ready(root);
  void act(ownPasskeys, "");
}

/** Return a suggested name for a passkey, such as “Android”. */
function thisDevice() {
  const brands = /** @type {{ userAgentData?: { platform?: string } }} */ (navigator).userAgentData;
  return brands?.platform ?? "";
}
