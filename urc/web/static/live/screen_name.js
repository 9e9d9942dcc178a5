// @ts-check
/**
 * The name of this screen, which other operators see. theme.js stores it in the field and on the
 * device. The field is missing if the sign-in contains a name.
 */

const LENGTH = 40;

export class ScreenName {
  /** @param {(message: object) => boolean} send */
  constructor(send) {
    this.send = send;
    /** Whether the server has a name of this screen. */
    this.isTold = false;
    this.field = document.querySelector("[data-screen-name]");
    this.field?.addEventListener("change", () => this.tell());
  }

  /** Send the name to the server, also after each reconnect, because the server stores no names. */
  tell() {
    if (!(this.field instanceof HTMLInputElement)) return;
    const name = this.field.value.trim();
    if (name || this.isTold) this.send({ t: "name", name: name.slice(0, LENGTH) });
    this.isTold = name !== "";
  }
}
