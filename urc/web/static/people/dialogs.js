// @ts-check
/** Dialogs of the pages about people: a question, a secret shown once, and a pairing. */
import { ask, reason } from "../core/api_client.js";
import { button, made } from "../core/dom.js";
import { t } from "../core/words.js";

/** Polling interval for the pairing of the device. */
const LOOK_MS = 700;

export class PeopleDialog {
  /** @param {HTMLDialogElement} el */
  constructor(el) {
    this.el = el;
    /** @type {number | undefined} */
    this.timer = undefined;
    el.addEventListener("close", () => clearTimeout(this.timer));
  }

  /** @param {string} title @param {(Node | string | false)[]} inside */
  show(title, ...inside) {
    clearTimeout(this.timer);
    const heading = made("h2", { class: "urc-part-title", id: "dialog-title" }, title);
    this.el.replaceChildren(heading, ...inside.filter((one) => one !== false));
    if (!this.el.open) this.el.showModal();
  }

  close() {
    this.el.close();
  }

  /**
   * Ask for confirmation of an action that cannot be undone.
   *
   * @param {string} title
   * @param {string} text
   * @param {string} verb
   * @param {() => void} act
   */
  confirm(title, text, verb, act) {
    const no = button(t("Cancel"), "no", () => this.close(), { autofocus: true });
    const yes = button(verb, "yes", () => {
      this.close();
      act();
    });
    this.show(title, made("p", {}, text), made("div", { class: "urc-ways" }, no, yes));
  }

  /**
   * Show a secret once.
   *
   * @param {string} title
   * @param {string} text
   * @param {string} secret
   * @param {string} [qr] image of a QR code
   */
  secret(title, text, secret, qr = "") {
    const value = made("code", { class: "urc-secret", "data-secret": true }, secret);
    const said = made("span", { role: "status" });
    const copy = button(t("Copy"), "copy", () => {
      navigator.clipboard?.writeText(secret).then(
        () => (said.textContent = t("copied")),
        () => select(value),
      );
      if (!navigator.clipboard) select(value); // browsers offer the clipboard only over HTTPS
    });
    this.show(title, made("p", {}, text), qr && picture(qr), value,
      made("div", { class: "urc-ways" }, copy, button(t("Done"), "done", () => this.close()), said));
  }

  /**
   * Show a pairing code until a device has paired or the code has expired.
   *
   * @param {{id: string, link: string, qr: string, code: string, fingerprint: string, isReachable: boolean, lastsS: number}} code
   * @param {{again: () => void, changed: () => void, remove: (device: string, name: string) => void}} acts
   */
  pairing(code, { again, changed, remove }) {
    const left = made("p", { class: "urc-quiet", "data-left": true });
    this.show(
      t("Pair a device"),
      made("p", {}, t("Scan this code with the camera of the device, or open the address on the device.")),
      picture(code.qr),
      !code.isReachable && made("p", { class: "urc-caution" }, t("◆ Only this computer can open this address. To allow other devices, start URC with --host.")),
      made("code", { class: "urc-secret", "data-secret": true }, code.link),
      code.fingerprint !== "" && made("p", { class: "urc-small" }, t("Fingerprint of this server's certificate authority, to compare with the device:"), " ", made("code", { "data-fingerprint": true }, code.fingerprint)),
      left,
      made("div", { class: "urc-ways" }, button(t("Cancel"), "no", () => this.close())),
    );
    const endMs = performance.now() + code.lastsS * 1000;
    const look = async () => {
      const seconds = Math.max(0, Math.ceil((endMs - performance.now()) / 1000));
      left.textContent = t("Single use; expires in {seconds} s", { seconds });
      let now;
      try {
        now = await ask(`/api/v1/pairings/${code.id}`);
      } catch (error) {
        left.textContent = reason(error);
        now = { state: "waiting" };
      }
      if (!this.el.open || !left.isConnected) return;
      if (now.state === "paired") {
        changed();
        this.paired(now, remove);
      } else if (now.state === "over") {
        this.show(
          t("Pair a device"),
          made("p", {}, t("The code has expired; no device used it.")),
          made("div", { class: "urc-ways" }, button(t("Close"), "no", () => this.close()), button(t("New code"), "again", again, { class: "urc-button-main" })),
        );
      } else {
        this.timer = window.setTimeout(() => void look(), LOOK_MS);
      }
    };
    void look();
  }

  /**
   * @param {{name: string, device: string, check: string}} now
   * @param {(device: string, name: string) => void} remove
   */
  paired({ name, device, check }, remove) {
    this.show(
      t("{name} is paired", { name }),
      made("p", { role: "status" }, t("The device must show this number. If it shows a different number, remove the device:")),
      made("p", { class: "urc-check-number", "data-check": true }, check),
      made("div", { class: "urc-ways" },
        button(t("Remove"), "remove", () => remove(device, name)),
        button(t("The numbers are equal"), "done", () => this.close(), { class: "urc-button-main" })),
    );
  }
}

/** @param {string} qr */
function picture(qr) {
  return made("img", { class: "urc-qr", src: qr, alt: t("QR code for the link") });
}

/** @param {HTMLElement} el */
function select(el) {
  getSelection()?.selectAllChildren(el);
}
