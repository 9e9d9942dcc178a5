// The notes about the topics of a ROS robot: at the command, and at a signal without a live value.
import assert from "node:assert/strict";
import { test } from "node:test";

import { Store } from "../../urc/web/static/live/store.js";

test("a command and a signal have their notes until the mismatches change", () => {
  const store = new Store();
  const signals = ["x", "speed"].map((name) => ({ name, type: "number" }));
  const hello = /** @type {any} */ ({ robot: "", title: "", now: 0, signals });
  store.hello(hello, 0);
  store.setUp(true, 0);
  const edition = store.edition;
  store.setTopics([
    { code: "takes-type", topic: "/cmd_vel", found: "a/TwistStamped", wanted: "a/Twist", commands: ["drive"] },
    { code: "no-publisher", topic: "/odom", signals: ["x"] },
  ]);
  assert.notEqual(store.edition, edition);
  assert.equal(store.topics.commands.get("drive"), "/cmd_vel takes TwistStamped, not Twist");
  assert.equal(store.topicNote(["speed", "x"], 0), "Nothing publishes /odom");
  assert.equal(store.topicNote(["speed"], 0), "");
  store.values({ n: 0, i: [0], v: [9], a: 0 }, 0);
  assert.equal(store.topicNote(["x"], 0), "");
  store.setTopics([{ code: "ros-version", topic: "/odom", found: "1", wanted: "2", signals: ["speed"] }]);
  assert.equal(store.topicNote(["speed"], 0), "This is ROS 1, not ROS 2");
  assert.equal(store.topics.commands.size, 0);
  store.setTopics([{ code: "carries-type", topic: "/odom", found: "a/Pose", wanted: "b/Pose", signals: ["speed"] }]);
  assert.equal(store.topicNote(["speed"], 0), "/odom carries a/Pose, not b/Pose");
  store.hello(hello, 0);
  assert.equal(store.topicNote(["speed"], 0), "");
});
