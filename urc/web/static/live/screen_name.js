// @ts-check
/**
 * The name of this screen, which other operators see. theme.js keeps it in the field and on the device; a
 * screen whose sign-in has a name has no field.
 */

const LENGTH = 40;

export class ScreenName {
  /** @param {(message: object) => boolean} send */
  constructor(send) {
    this.send = send;
    /** Whether the server knows a name of this screen. */
    this.isTold = false;
    this.field = document.querySelector("[data-screen-name]");
    this.field?.addEventListener("change", () => this.tell());
  }

  /** Tell the server; also after each reconnect, as it keeps no names. */
  tell() {
    if (!(this.field instanceof HTMLInputElement)) return;
    const name = this.field.value.trim();
    if (name || this.isTold) this.send({ t: "name", name: name.slice(0, LENGTH) });
    this.isTold = name !== "";
  }
}
