// Diagnostics of ROS: the newest status of each part, its age, and the tree of names.
import assert from "node:assert/strict";
import { test } from "node:test";

import { Report } from "../../widgets/table/report.js";
import { MOST_ROWS, rowsOf } from "../../widgets/table/rows.js";
import { branches, linesOf } from "../../widgets/table/tree.js";

/** @param {readonly [number, string, string][]} parts */
const statusOf = (parts) => ({ status: parts.map(([level, name, message]) => ({ level, name, message })) });
/** @param {import("../../widgets/table/rows.js").Row[]} rows */
const shortly = (rows) => rows.map(({ name, level, age }) => [name, level, age ?? 0]);
const ALL = { sort: "severity", filter: "" };

test("two programs on one topic add up, and the newest status counts", () => {
  const report = new Report();
  report.take(statusOf([[0, "motors", "ok"], [1, "radio", "weak"]]), 100);
  report.take(statusOf([[2, "camera", "no picture"]]), 101);
  report.take(statusOf([[0, "radio", "strong"]]), 102);
  assert.deepEqual(shortly(report.rows(102, 5)), [["motors", "ok", 0], ["camera", "error", 0], ["radio", "ok", 0]]);
});

test("a part that is no longer reported becomes old, then it is removed", () => {
  const report = new Report();
  report.take(statusOf([[0, "motors", "ok"]]), 100);
  report.take(statusOf([[0, "radio", "ok"]]), 108);
  assert.deepEqual(shortly(report.rows(108, 5)), [["motors", "stale", 8], ["radio", "ok", 0]]);
  assert.deepEqual(shortly(report.rows(151, 5)), [["radio", "stale", 43]]);
  assert.deepEqual(shortly(report.rows(9999, 0)), [["radio", "ok", 0]]);
});

test("other forms replace the report, and no value removes all", () => {
  const report = new Report();
  report.take({ motors: "ok", radio: "warn" }, 1);
  report.take({ motors: "error" }, 2);
  assert.deepEqual(shortly(report.rows(2, 5)), [["motors", "error", 0]]);
  report.take(statusOf([[0, "radio", ""]]), 3);
  assert.deepEqual(shortly(report.rows(3, 5)), [["radio", "ok", 0]]);
  report.take(null, 4);
  assert.deepEqual(report.rows(4, 5), []);
});

test("a robot with ever new names keeps the newest", () => {
  const report = new Report();
  for (let count = 0; count < 3 * MOST_ROWS; count += 1) report.take(statusOf([[0, `part ${count}`, ""]]), count / 1000);
  const rows = report.rows(2, 5);
  assert.equal(rows.length, MOST_ROWS);
  assert.equal(rows.at(-1)?.name, `part ${3 * MOST_ROWS - 1}`);
});

test("the values of a status are pairs of text", () => {
  const status = [{ level: 0, name: "a", values: [{ key: "heat", value: 92 }, null, { key: {} }] }, { level: 0, name: "b", values: 7 }];
  assert.deepEqual(rowsOf({ status }).map(({ values }) => values), [[["heat", "92"], ["", ""], ["", ""]], undefined]);
});

test("names are paths, or a program and its part", () => {
  assert.deepEqual(branches("/Arm/Motors/Elbow"), ["Arm", "Motors", "Elbow"]);
  assert.deepEqual(branches("lidar: link: rate"), ["lidar", "link: rate"]);
  assert.deepEqual(branches("motors"), ["motors"]);
  assert.deepEqual(branches("///"), ["///"]);
  assert.deepEqual(branches(""), [""]);
  assert.deepEqual(branches("/a/b/c/d/e/f/g/h"), ["a", "b", "c", "d", "e", "f/g/h"]);
});

test("a branch has the most serious level below it, and is open if it is not OK", () => {
  const rows = rowsOf(statusOf([[0, "/base/left", ""], [0, "/base/right", ""], [0, "/arm", "all"], [2, "/arm/wrist", "hot"], [0, "/arm/elbow", ""]]));
  const lines = linesOf(rows, new Map(), ALL);
  assert.deepEqual(lines.map(({ name, depth, level, isOpen }) => [name, depth, level, isOpen]), [
    ["arm", 0, "error", true], ["wrist", 1, "error", false], ["elbow", 1, "ok", false], ["base", 0, "ok", false],
  ]);
  assert.equal(lines[0]?.message, "all");
  const closed = linesOf(rows, new Map([["/arm", false], ["/base", true]]), { ...ALL, sort: "given" });
  assert.deepEqual(closed.map(({ path }) => path), ["/base", "/base/left", "/base/right", "/arm"]);
});

test("a filter opens all branches to the parts that it finds", () => {
  const rows = rowsOf(statusOf([[0, "/base/left", "fine"], [0, "/base/right", ""], [0, "/arm/elbow", ""]]));
  assert.deepEqual(linesOf(rows, new Map(), { ...ALL, filter: "Fine" }).map(({ path }) => path), ["/base", "/base/left"]);
});

test("a status opens to its values", () => {
  const rows = rowsOf({ status: [{ level: 0, name: "lidar", values: [{ key: "rate", value: "10" }] }] });
  assert.deepEqual(linesOf(rows, new Map(), ALL).map(({ isParent, isOpen }) => [isParent, isOpen]), [[true, false]]);
  const [, value] = linesOf(rows, new Map([["/lidar", true]]), ALL);
  assert.deepEqual([value?.name, value?.message, value?.depth, value?.level], ["rate", "10", 1, ""]);
});

test("names that are keys of objects are only names", () => {
  const rows = rowsOf(statusOf([[1, "__proto__/constructor", "odd"]]));
  assert.deepEqual(linesOf(rows, new Map(), ALL).map(({ name }) => name), ["__proto__", "constructor"]);
});
