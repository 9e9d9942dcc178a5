// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { Setpoint, SetpointView, keyed } from "urc/command_kit";
import { attribute, part } from "urc/kit";
import { numberOf } from "./typed.js";

const KEYS = new Set(["ArrowUp", "ArrowDown", "PageUp", "PageDown"]);

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ ...ctx }) {
    const { el, signal, t } = ctx;
    const face = new SetpointView(el, "number");
    const field = el.querySelector(".number-field");
    const argument = Object.values(ctx.command("change")?.arguments ?? {})[0];
    const setpoint = new Setpoint(ctx, show);
    setpoint.isLive = true; // a step is sent immediately
    // Without bounds, any number is allowed.
    const bounds = {
      ...setpoint.bounds,
      min: bound(ctx.options["min"], argument?.min, -Infinity, Math.max),
      max: bound(ctx.options["max"], argument?.max, Infinity, Math.min),
      isWhole: argument?.type === "integer",
    };
    setpoint.bounds = { ...bounds };
    let fault = "";
    /** Whether the field has unsent text. */
    let isDraft = false;

    function show() {
      face.show(setpoint, fault);
      if (field) attribute(field, "aria-invalid", fault ? "true" : null);
    }

    /** @param {Exclude<ReturnType<typeof numberOf>, {value: number}>} found */
    function words(found) {
      if ("either" in found) {
        const [less, more] = found.either;
        return t("◆ {less} or {more}? Type the number without a comma", { less, more });
      }
      const { fault: why } = found;
      if (why === "low") return t("◆ not below {limit}", { limit: setpoint.text(bounds.min) });
      if (why === "high") return t("◆ not above {limit}", { limit: setpoint.text(bounds.max) });
      if (why === "whole") return t("◆ a whole number is expected");
      return why === "empty" ? t("◆ type a number") : t("◆ this is not a number");
    }

    /**
     * @param {string} key
     * @param {number} from
     */
    function next(key, from) {
      if (Number.isFinite(bounds.min) && Number.isFinite(bounds.max)) return keyed(key, from, bounds) ?? from;
      const way = { ArrowUp: 1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[key] ?? 0;
      return Number(Math.min(bounds.max, Math.max(bounds.min, from + way * bounds.step)).toFixed(10));
    }

    if (field instanceof HTMLInputElement) {
      /** Step from the typed number. @param {string} key @param {boolean} [isTyping] */
      const step = (key, isTyping = false) => {
        const typed = isDraft ? numberOf(field.value, bounds) : { value: setpoint.from };
        fault = "fault" in typed ? words(typed) : "";
        if ("value" in typed && setpoint.giver.isReady) {
          const value = next(key, typed.value);
          setpoint.set(value);
          isDraft = false;
          if (isTyping || field.value) field.value = String(value);
        }
        show();
      };
      part(el, ".number-row").addEventListener("submit", (event) => {
        event.preventDefault();
        const typed = numberOf(field.value, bounds);
        fault = "fault" in typed ? words(typed) : "";
        if ("value" in typed && setpoint.giver.isReady) {
          setpoint.set(typed.value);
          isDraft = false;
          field.select();
        }
        show();
      }, { signal });
      field.addEventListener("input", () => {
        fault = "";
        isDraft = field.value.trim() !== "";
        show();
      }, { signal });
      field.addEventListener("keydown", (event) => {
        if (!KEYS.has(event.key)) return;
        event.preventDefault();
        step(event.key, true);
      }, { signal });
      part(el, ".number-less").addEventListener("click", () => step("ArrowDown"), { signal });
      part(el, ".number-more").addEventListener("click", () => step("ArrowUp"), { signal });
    }
    return {
      update({ state }, { change }) {
        setpoint.take(state, change);
      },
    };
  },
};

/**
 * @param {unknown} own
 * @param {number | null | undefined} theirs
 * @param {number} none
 * @param {(...values: number[]) => number} narrower
 */
function bound(own, theirs, none, narrower) {
  return narrower(typeof own === "number" ? own : none, theirs ?? none);
}
