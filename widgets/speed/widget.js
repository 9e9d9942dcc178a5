// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { attribute, clamp, format, noteOf, number, numbers, part, style, write } from "urc/kit";
import { ends, share } from "urc/axis_ticks";
import { lengthOf, shownIn } from "./pace.js";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, t } = ctx;
    const root = part(el, ".speed");
    const meter = part(el, ".speed-meter");
    const wanted = part(el, ".speed-wanted");
    const text = part(el, ".speed-text");
    const unit = part(el, ".speed-unit");
    const note = part(el, ".speed-note");
    const commandedText = el.querySelector(".speed-commanded");

    return {
      update({ measured, velocity, commanded }) {
        const reading = measured ?? velocity ?? commanded;
        if (!reading) return;
        const speed = measured ? number(measured) : lengthOf(numbers(velocity));
        const goal = number(commanded);
        const { symbol, factor } = shownIn(options["unit"]) ?? ctx.unit(measured ? "measured" : velocity ? "velocity" : "commanded");
        const wantedDigits = options["precision"];
        const digits = typeof wantedDigits === "number" ? wantedDigits : symbol === "m/s" ? 2 : 1;
        const figure = format(speed === null ? null : factor(speed), digits);

        const [, most] = ends(reading.signal, { max: options["max"] });
        const goesBack = (reading.signal.min ?? 0) < 0 || (speed ?? 0) < 0 || (goal ?? 0) < 0;
        const least = goesBack && !velocity ? -most : 0;
        const zero = share(0, least, most);
        const place = speed === null ? zero : share(speed, least, most);
        style(root, "--speed-zero", zero.toFixed(4));
        style(root, "--speed-from", Math.min(zero, place).toFixed(4));
        style(root, "--speed-long", Math.abs(place - zero).toFixed(4));
        attribute(wanted, "hidden", goal === null ? "" : null);
        if (goal !== null) style(root, "--speed-wanted", share(goal, least, most).toFixed(4));

        attribute(root, "data-state", reading.state);
        attribute(root, "data-alarm", reading.alarm);
        style(root, "--speed-characters", String(clamp(2 * Math.ceil((figure.length + symbol.length / 2) / 2), 4, 20)));
        write(text, figure);
        write(unit, speed === null ? "" : symbol);
        const said = noteOf(reading, t);
        write(note, said);
        if (commandedText && commanded) {
          const value = goal === null ? "—" : `${format(factor(goal), digits)} ${symbol}`;
          write(commandedText, t("commanded {value}", { value }));
          attribute(commandedText, "data-state", commanded.state);
        }
        attribute(meter, "aria-valuemin", format(factor(least)));
        attribute(meter, "aria-valuemax", format(factor(most)));
        attribute(meter, "aria-valuenow", format(factor(speed ?? least)));
        const spoken = [`${figure} ${symbol}`, said.replace(/[▲◆] /g, "")].filter(Boolean).join(", ");
        attribute(meter, "aria-valuetext", speed === null ? t("unknown") : spoken);
      },
    };
  },
};
