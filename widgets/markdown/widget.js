// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */

/** The server has rendered all content; it never changes. */
export default {
  /** @returns {Instance} */
  mount() {
    return {};
  },
};
