// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { attribute, format, noteOf, number, part, write } from "urc/kit";
import { Minute, bars } from "./strength.js";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, t }) {
    const root = part(el, ".signal");
    const text = part(el, ".signal-text");
    const unit = part(el, ".signal-unit");
    const note = part(el, ".signal-note");
    const path = el.querySelector(".signal-path");
    const lit = [...el.querySelectorAll(".signal-bar")];
    const minute = new Minute();
    let serial = 0;

    return {
      update({ rssi, noise, rate, name }) {
        if (!rssi) return;
        const value = number(rssi);
        const symbol = rssi.signal.unit || "dBm";
        const count = value === null ? 0 : bars(value, symbol);
        attribute(root, "data-state", rssi.state);
        attribute(root, "data-alarm", rssi.alarm);
        attribute(root, "data-bars", value === null ? "" : String(count));
        lit.forEach((bar, place) => attribute(bar, "data-lit", place < count ? "yes" : "no"));
        write(text, value === null ? "—" : rssi.text);
        write(unit, value === null ? "" : symbol);
        write(note, noteOf(rssi, t));
        if (path && value !== null && rssi.state === "live" && rssi.serial !== serial) {
          serial = rssi.serial;
          if (minute.add(rssi.time, value)) attribute(path, "d", minute.path(rssi.time, symbol));
        }
        const floor = number(noise);
        const apart = value === null || floor === null ? "—" : `${format(value - floor)} dB`;
        fact(el, "noise", noise, t("{value} above noise", { value: apart }));
        fact(el, "rate", rate, number(rate) === null ? "—" : `${rate?.text} ${rate?.unit}`.trim());
        fact(el, "name", name, name?.text ?? "—");
      },
    };
  },
};

/**
 * @param {HTMLElement} el
 * @param {string} name
 * @param {Reading | undefined} reading
 * @param {string} text
 */
function fact(el, name, reading, text) {
  const place = el.querySelector(`.signal-${name}`);
  if (!place || !reading) return;
  write(place, text);
  attribute(place, "data-state", reading.state);
}
