// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").LogLine} LogLine */

const RANKS = { info: 0, warning: 1, error: 2 };

/**
 * Return the selected lines, oldest first. Pure: no DOM.
 *
 * @param {readonly LogLine[]} lines
 * @param {{level: string, words: string, most: number}} wanted a line must have all words
 * @returns {LogLine[]}
 */
export function chosen(lines, { level, words, most }) {
  const least = RANKS[/** @type {keyof typeof RANKS} */ (level)] ?? 0;
  const parts = words.toLowerCase().split(/\s+/).filter(Boolean);
  const fitting = lines.filter(({ level: own, source, text }) => {
    if ((RANKS[own] ?? 0) < least) return false;
    const all = `${source}: ${text}`.toLowerCase();
    return parts.every((part) => all.includes(part));
  });
  return fitting.slice(-most);
}

/**
 * Return the lines as a file: time (UTC), level, source and text, one line each.
 *
 * @param {readonly LogLine[]} lines
 */
export function fileOf(lines) {
  const rows = lines.map(({ time, level, source, text }) => {
    const plain = text.replace(/[\r\n\t]+/g, " ");
    return [new Date(time).toISOString(), level, source, plain].join("\t");
  });
  return `${rows.join("\n")}\n`;
}
