// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */

/** The server has rendered all of it: nothing changes here. */
export default {
  /** @returns {Instance} */
  mount() {
    return {};
  },
};
