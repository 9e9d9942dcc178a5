// @ts-check
/**
 * Diagnosed parts as a tree, by their names. Pure.
 *
 * The aggregator of ROS names parts like files: "/Arm/Motors/Elbow". Without it, the name of the
 * program precedes the name of the part: "lidar: Connection".
 *
 * @typedef {import("./rows.js").Level} Level
 * @typedef {import("./rows.js").Row} Row
 * @typedef {{path: string, name: string, depth: number, level: Level | "", message: string,
 *   isParent: boolean, isOpen: boolean, age?: number}} Line
 * @typedef {{name: string, row: Row | null, children: Map<string, Node>}} Node
 */
import { ORDER } from "./rows.js";

/** Deepest level of a tree; further parts of a name stay together. */
const DEEPEST = 6;

/**
 * Return the names of the branches that lead to a part, and its own.
 *
 * @param {string} name
 */
export function branches(name) {
  const parts = name.includes("/") ? name.split("/").filter(Boolean) : name.split(/: (.*)/s).filter(Boolean);
  const all = parts.length > 0 ? parts : [name];
  return all.length > DEEPEST ? [...all.slice(0, DEEPEST - 1), all.slice(DEEPEST - 1).join("/")] : all;
}

/**
 * Return the visible lines of the tree. Branches that are not OK are open, unless the operator has
 * closed them; while a filter is set, all are open.
 *
 * @param {readonly Row[]} rows
 * @param {ReadonlyMap<string, boolean>} open what the operator has opened or closed, by path
 * @param {{sort: unknown, filter: string}} wanted
 * @returns {Line[]}
 */
export function linesOf(rows, open, { sort, filter }) {
  const needle = filter.trim().toLowerCase();
  /** @type {Node} */
  const root = { name: "", row: null, children: new Map() };
  for (const row of rows) {
    if (!`${row.name} ${row.level} ${row.message}`.toLowerCase().includes(needle)) continue;
    let at = root;
    for (const name of branches(row.name)) {
      const next = at.children.get(name) ?? { name, row: null, children: new Map() };
      at.children.set(name, next);
      at = next;
    }
    at.row = row;
  }
  /** @type {Line[]} */
  const lines = [];
  add(root, "", 0, lines, { open, isSorted: sort !== "given", isFiltered: needle !== "" });
  return lines;
}

/**
 * @param {Node} parent
 * @param {string} above
 * @param {number} depth
 * @param {Line[]} lines
 * @param {{open: ReadonlyMap<string, boolean>, isSorted: boolean, isFiltered: boolean}} wanted
 */
function add(parent, above, depth, lines, wanted) {
  const nodes = [...parent.children.values()].map((node) => ({ node, level: levelOf(node) }));
  if (wanted.isSorted) nodes.sort((one, other) => ORDER.indexOf(one.level) - ORDER.indexOf(other.level));
  for (const { node, level } of nodes) {
    const { name, row, children } = node;
    const path = `${above}/${name}`;
    const values = row?.values ?? [];
    const isParent = children.size > 0 || values.length > 0;
    const isSerious = children.size > 0 && (level === "error" || level === "warn");
    const isOpen = isParent && (wanted.open.get(path) ?? ((wanted.isFiltered && children.size > 0) || isSerious));
    lines.push({ path, name, depth, level, message: row?.message ?? "", isParent, isOpen, age: row?.age ?? 0 });
    if (!isOpen) continue;
    for (const [key, value] of values) {
      lines.push({ path: `${path}=${key}`, name: key, depth: depth + 1, level: "", message: value, isParent: false, isOpen: false });
    }
    add(node, path, depth + 1, lines, wanted);
  }
}

/**
 * Return the most serious level of a part and of all parts below it.
 *
 * @param {Node} node
 * @returns {Level}
 */
function levelOf({ row, children }) {
  const levels = [...children.values()].map(levelOf);
  if (row) levels.push(row.level);
  return levels.reduce((one, other) => (ORDER.indexOf(other) < ORDER.indexOf(one) ? other : one), "ok");
}
