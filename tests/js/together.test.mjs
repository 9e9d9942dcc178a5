// @ts-check
/** What several hands on one command give together. */
import assert from "node:assert/strict";
import test from "node:test";
import { MergedAxes } from "../../urc/web/static/control/merge_axes.js";

/** A hand on a control of a command: what it gives, and what that is at rest. */
class Hand {
  /**
   * @param {Record<string, number>} push
   * @param {Record<string, number>} [neutral]
   */
  constructor(push, neutral = { x: 0, y: 0 }) {
    this.push = push;
    this.output = { neutral, ranges: { level: { min: 0, max: 10, rest: 5, isWhole: false } } };
  }

  given() {
    return this.push;
  }
}

/** @param {Hand[]} hands */
function shared(...hands) {
  const together = new MergedAxes();
  const grips = new Set(hands);
  return {
    grips,
    values: () => together.values(grips),
    lost: (/** @type {Hand} */ hand) => [...together.lost(hand)],
  };
}

test("hands that push different arguments do not know each other", () => {
  const { values } = shared(new Hand({ x: 1 }), new Hand({ y: -1 }));
  assert.deepEqual(values(), { x: 1, y: -1 });
});

test("what is pushed stays as it is when another hand only touches", () => {
  for (const order of [[1, 0], [0, 1]]) {
    const { values } = shared(...order.map((x) => new Hand({ x, y: 0 })));
    assert.deepEqual(values(), { x: 1, y: 0 });
  }
});

test("an argument is of the hand that pushed it first", () => {
  const [first, second] = [new Hand({ x: 0.2 }), new Hand({ x: 0 })];
  const { values, lost } = shared(second, first);
  values();
  second.push = { x: 1, y: 1 };
  assert.deepEqual(values(), { x: 0.2, y: 1 });
  assert.deepEqual([lost(first), lost(second)], [[], ["x"]]);
  first.push = { x: -0.5 };
  assert.deepEqual(values(), { x: -0.5, y: 1 });
});

test("nothing jumps to the second hand when the first one goes, or is at rest", () => {
  const [first, second] = [new Hand({ x: 0.2 }), new Hand({ x: 0 })];
  const { grips, values, lost } = shared(first, second);
  values();
  second.push = { x: 1 };
  values();
  first.push = { x: 0 };
  assert.deepEqual(values(), { x: 0, y: 0 });
  grips.delete(first);
  assert.deepEqual(values(), { x: 0, y: 0 });
  second.push = { x: 0 };
  values();
  assert.deepEqual(lost(second), []);
  second.push = { x: 0.3 };
  assert.deepEqual(values(), { x: 0.3, y: 0 });
});

test("a hand that comes anew begins anew", () => {
  const [first, second] = [new Hand({ x: 0.2 }), new Hand({ x: 1 })];
  const { grips, values, lost } = shared(first, second);
  values();
  grips.delete(second);
  values();
  grips.delete(first);
  grips.add(second);
  assert.deepEqual(values(), { x: 1, y: 0 });
  assert.deepEqual(lost(second), []);
});

test("rest is what stops it, wherever that lies", () => {
  const [first, second] = [new Hand({ level: 5 }, {}), new Hand({ level: 7 }, {})];
  const { values } = shared(second, first);
  assert.deepEqual(values(), { level: 7 });
});
