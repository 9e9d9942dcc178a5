// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").GateState} GateState */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { attribute, noteOf, part, write } from "urc/kit";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, t, send } = ctx;
    const root = part(el, ".deadman");
    const main = part(el, ".deadman-main");
    const word = part(el, ".deadman-word");
    const armed = part(el, ".deadman-armed");
    const note = part(el, ".deadman-note");
    const isHeld = options["mode"] !== "toggle";
    const resting = isHeld ? t("hold to drive") : t("press to drive");
    /** @type {GateState} */
    let state = { isOpen: false, leftS: 0, reason: "" };
    let fault = "";
    let wasOpen = false;
    /** @type {Readonly<Record<string, Outlet>>} */
    let bound = Object.create(null);

    /** Send a command to the robot if it is bound. @param {"arm" | "disarm"} output */
    async function tell(output) {
      if (!bound[output]) return;
      try {
        await send(output);
        fault = "";
      } catch (error) {
        fault = `▲ ${error instanceof Error ? error.message : error}`;
      }
      draw();
    }

    function draw() {
      const { isOpen, leftS, reason } = state;
      attribute(root, "data-open", isOpen ? "yes" : "no");
      attribute(main, "aria-pressed", String(isOpen));
      const left = leftS > 0 ? ` · ${leftS} s` : "";
      write(word, isOpen ? t("● may drive") + left : resting);
      attribute(note, "data-why", fault || (!isOpen && reason) ? "yes" : null);
      write(note, fault || (!isOpen && reason ? `◆ ${reason}` : isOpen ? "" : t("nothing moves without this control")));
    }

    ctx.gate({
      el: main,
      isHeld,
      timeoutMs: Number(options["timeout"] ?? 10) * 1000,
      key: String(options["key"] ?? ""),
      pad: options["pad"] === "left" || options["pad"] === "right" ? options["pad"] : "",
      show(now) {
        state = now;
        if (now.isOpen !== wasOpen) {
          wasOpen = now.isOpen;
          void tell(now.isOpen ? "arm" : "disarm");
        }
        draw();
      },
    });
    return {
      update(readings, outputs) {
        bound = outputs;
        const reading = readings["armed"];
        if (reading) write(armed, said(reading, ctx));
      },
    };
  },
};

/**
 * @param {Reading} reading
 * @param {Context} ctx
 */
function said(reading, { t }) {
  const old = noteOf(reading, t);
  if (reading.value === null) return `— ${old}`;
  const text = typeof reading.value === "boolean" ? (reading.value ? t("● armed") : t("○ not armed")) : reading.text;
  return old ? `${text} · ${old}` : text;
}
