import assert from "node:assert/strict";
import { test } from "node:test";
import { fits } from "../../urc/web/static/manage/search.js";

const ROBOT = "generic-ros2 Any base with ROS 2 A mobile base through rosbridge. Café, hall B.";

test("each word is found, in any order and wherever it stands", () => {
  assert.ok(fits(ROBOT, "ros any"));
  assert.ok(fits(ROBOT, "bridge"));
  assert.ok(!fits(ROBOT, "ros snake"));
});

test("capitals and accents are no difference", () => {
  assert.ok(fits(ROBOT, "ANY BASE"));
  assert.ok(fits(ROBOT, "cafe"));
  assert.ok(fits(ROBOT, "CAFÉ"));
});

test("nothing typed, or only blanks, leaves everything", () => {
  assert.ok(fits(ROBOT, ""));
  assert.ok(fits(ROBOT, "  "));
  assert.ok(fits("", ""));
});
