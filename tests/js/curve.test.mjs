import assert from "node:assert/strict";
import { test } from "node:test";
import {
  Pipeline, arrow, bounded, deadZone, expo, gate, settingsOf, slew, snapped, speedsOf, tilted,
} from "../../urc/web/static/widgets/response_curve.js";

/** Shares from -1 to 1, the ends and the middle among them. */
const SHARES = Array.from({ length: 41 }, (_, step) => (step - 20) / 20);
const PLAIN = settingsOf({});

/** @param {number} one @param {number} other */
function near(one, other) {
  assert.ok(Math.abs(one - other) < 1e-9, `${one} is not ${other}`);
}

test("a dead zone begins at nothing and still reaches the end", () => {
  for (const zone of [0, 0.05, 0.3, 0.5]) {
    assert.equal(deadZone(zone, zone), 0);
    near(deadZone(1, zone), 1);
    assert.ok(Math.abs(deadZone(zone + 1e-6, zone)) < 1e-5, "no jump at its edge");
    for (const share of SHARES) near(deadZone(-share, zone), -deadZone(share, zone));
  }
});

test("dead zone and expo never turn a push around, and never lessen a larger one", () => {
  for (const zone of [0, 0.1, 0.5]) {
    for (const amount of [0, 0.3, 1]) {
      let last = -Infinity;
      for (const share of SHARES) {
        const out = expo(deadZone(share, zone), amount);
        assert.ok(out >= last - 1e-12);
        assert.ok(out * share >= 0 && Math.abs(out) <= Math.abs(share) + 1e-12);
        last = out;
      }
    }
  }
  near(expo(0.5, 0.3), 0.7 * 0.5 + 0.3 * 0.125);
});

test("slew holds up speeding up only", () => {
  for (const before of SHARES) {
    for (const target of SHARES) {
      const next = slew(before, target, 2, 0.1);
      assert.ok(Math.abs(next) <= Math.abs(target) + 1e-12, "never beyond the target");
      assert.ok(next * target >= 0, "never the wrong way");
      if (target === 0) assert.equal(next + 0, 0, "stopping is at once");
      if (before * target > 0 && Math.abs(target) <= Math.abs(before)) near(next, target);
      const grown = Math.abs(next) - (before * target > 0 ? Math.abs(before) : 0);
      assert.ok(grown <= 0.2 + 1e-12, "at most the rate");
      assert.equal(slew(before, target, 0, 0), target, "none is none");
    }
  }
});

test("slew gets there, in the time that it takes", () => {
  let share = 0;
  for (let step = 0; step < 10; step += 1) share = slew(share, 1, 1, 0.05);
  near(share, 0.5);
  for (let step = 0; step < 11; step += 1) share = slew(share, 1, 1, 0.05);
  assert.equal(share, 1);
});

test("a gate lets nothing out, and what is inside alone", () => {
  for (const x of SHARES.map((share) => share * 2)) {
    for (const y of SHARES.map((share) => share * 2)) {
      const round = gate(x, y, "circle");
      assert.ok(Math.hypot(...round) <= 1 + 1e-12);
      if (Math.hypot(x, y) <= 1) assert.deepEqual(round, [x, y]);
      near(round[0] * y, round[1] * x); // the direction stays
      assert.deepEqual(gate(x, y, "square"), [bounded(x), bounded(y)]);
      const [crossX, crossY] = gate(x, y, "cross");
      assert.equal(crossX * crossY + 0, 0, "one axis at a time");
    }
  }
});

test("the whole pipeline: order, sign and range", () => {
  const settings = settingsOf({
    gate: "circle", dead_zone: 0.1, expo: 0.4, scale: 0.5, invert_y: true, invert_x: false,
  });
  for (const x of SHARES) {
    for (const y of SHARES) {
      const sent = new Pipeline(settings).step({ x, y }, { dtS: 0, speed: 0.6 });
      assert.ok(Math.hypot(sent.x, sent.y) <= 0.3 + 1e-3);
      assert.ok(sent.x * x >= 0 && sent.y * y <= 0);
      if (Math.hypot(x, y) <= 0.1) assert.deepEqual(sent, { x: 0, y: 0 });
      for (const value of Object.values(sent)) assert.ok(!Object.is(value, -0));
    }
  }
  assert.deepEqual(new Pipeline(settings).step({ x: 1, y: 0 }, { dtS: 0, speed: 0.6 }), { x: 0.3, y: 0 });
});

test("keys pass by the dead zone and the curve", () => {
  const settings = settingsOf({ dead_zone: 0.3, expo: 1 });
  const sent = new Pipeline(settings).step({ x: 0.5, y: 0, turn: -0.25 }, { dtS: 0, isFine: false });
  assert.deepEqual(sent, { x: 0.5, y: 0, turn: -0.25 });
});

test("a gesture begins at nothing, however fast the last one was", () => {
  const pipeline = new Pipeline({ ...PLAIN, slew: 2 });
  assert.deepEqual(pipeline.step({ value: 1 }, { dtS: 0 }), { value: 0 });
  assert.deepEqual(pipeline.step({ value: 1 }, { dtS: 0.25 }), { value: 0.5 });
  assert.deepEqual(pipeline.step({ value: 0 }, { dtS: 0.001 }), { value: 0 });
  pipeline.step({ value: 1 }, { dtS: 10 });
  assert.deepEqual(pipeline.step({ value: 1 }, { dtS: 0 }), { value: 0 });
});

test("what is no number moves nothing", () => {
  for (const bad of [NaN, Infinity, -Infinity]) {
    const sent = new Pipeline(PLAIN).step({ x: bad, y: 0.5, turn: bad }, { dtS: 0 });
    assert.deepEqual(sent, { x: 0, y: 0.5, turn: 0 });
  }
});

test("speed steps are in order, and there is always one", () => {
  assert.deepEqual(speedsOf({ speeds: [1, 0.3, "fast", 0, -1, 2, NaN, 0.6] }), [0.3, 0.6, 1]);
  assert.deepEqual(speedsOf({ speeds: [] }), [1]);
  assert.deepEqual(speedsOf({}), [1]);
});

test("a cross of arrows knows four directions, or eight", () => {
  assert.deepEqual(arrow(0.9, 0.2, false, 1 / 3), { x: 1, y: 0 });
  assert.deepEqual(arrow(-0.5, 0.9, false, 1 / 3), { x: 0, y: 1 });
  assert.deepEqual(arrow(-0.5, 0.9, true, 1 / 3), { x: -1, y: 1 });
  assert.deepEqual(arrow(0.9, 0.2, true, 1 / 3), { x: 1, y: 0 });
  assert.deepEqual(arrow(0.2, -0.3, true, 1 / 3), { x: 0, y: 0 });
  assert.deepEqual(arrow(-9, -8, true, 1 / 3), { x: -1, y: -1 }); // beyond the edge is held on
});

test("a lever snaps to the nearest detent within reach", () => {
  assert.equal(snapped(0.04, [0, 0.5], 0.05), 0);
  assert.equal(snapped(0.2, [0, 0.5], 0.05), 0.2);
  assert.equal(snapped(0.26, [0, 0.5], 0.3), 0.5);
  assert.equal(snapped(0.26, [], 0.3), 0.26);
});

test("tilt goes where the screen is tipped, whichever way it is turned", () => {
  const rest = { beta: 40, gamma: 5 };
  assert.deepEqual(tilted(rest, rest, 90, 30), { x: 0, y: 0 });
  const away = tilted({ beta: 25, gamma: 5 }, rest, 0, 30);
  near(away.x, 0.5);
  near(away.y, 0);
  near(tilted({ beta: 40, gamma: 20 }, rest, 0, 30).y, -0.5); // the right side down: to the right
  const wide = tilted({ beta: 55, gamma: 20 }, rest, 90, 30);
  near(wide.y, -0.5);
  near(wide.x, 0.5);
  near(tilted({ beta: -175, gamma: 0 }, { beta: 175, gamma: 0 }, 0, 10).x, -1); // across the seam
});
