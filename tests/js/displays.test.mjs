// The arithmetic of the display widgets: angles, bearings, scales, traces, rows.
import assert from "node:assert/strict";
import { test } from "node:test";

import { bands, digitsOf, ends, share, spanOf, ticks, wholes } from "../../urc/web/static/widgets/axis_ticks.js";
import { offset, covers, tape, HIGH } from "../../urc/web/static/widgets/height_tape.js";
import { leanOf, ofQuaternion, solid, wrapped } from "../../widgets/attitude/angles.js";
import { Mean, cellScale, clock, spread, timeLeft } from "../../widgets/battery/charge.js";
import { angleOf, bearing, bearingAt, bearingOf, figures, point, turn } from "../../widgets/compass/bearing.js";
import { angle, arc, dashes } from "../../widgets/gauge/arc.js";
import { pictureOf } from "../../widgets/image/source.js";
import { Ring, csv, extent, seconds, spanFor, table } from "../../widgets/plot/traces.js";
import { Minute, bars } from "../../widgets/signal/strength.js";
import { lengthOf, shownIn } from "../../widgets/speed/pace.js";
import { levelOf, rowsOf, rowsOfLists, shown } from "../../widgets/table/rows.js";
import { Trend } from "../../widgets/value/trend.js";

/** @param {number | null} value @param {number} wanted */
function near(value, wanted, within = 1e-6) {
  assert.ok(value !== null && Math.abs(value - wanted) <= within, `${value} is not ${wanted}`);
}

const RAD = Math.PI / 180;

test("a scale has round ticks, its limits as bands, and clamps what is outside", () => {
  assert.deepEqual(ticks(0, 30, 6), [0, 5, 10, 15, 20, 25, 30]);
  assert.deepEqual(ticks(-0.25, 0.25, 5), [-0.2, -0.1, 0, 0.1, 0.2]);
  assert.deepEqual(ticks(1, 1, 5), []);
  assert.equal(ticks(0, 1e-9, 5).length, 6);
  assert.equal(digitsOf([0, 0.25]), 2);
  assert.deepEqual([share(5, 0, 10), share(-1, 0, 10), share(11, 0, 10), share(1, 2, 2)], [0.5, 0, 1, 0]);
  assert.deepEqual(ends({ unit: "%" }, {}), [0, 100]);
  assert.deepEqual(ends({ min: 5 }, {}), [5, 6]);
  assert.deepEqual(ends({ min: 0, max: 30 }, { max: 10 }), [0, 10]);
  assert.deepEqual(bands({ low: 2, lolo: 1, hihi: 9 }, 0, 10), [
    { from: 0, to: 1, alarm: "lolo" },
    { from: 1, to: 2, alarm: "low" },
    { from: 9, to: 10, alarm: "hihi" },
  ]);
  assert.deepEqual(spanOf(12, 12.5, [11, 13, 40]), [11, 13]);
  assert.deepEqual(spanOf(Infinity, -Infinity, []), [0, 1]);
});

test("numbers that are too far from zero to count end a scale, not the page", () => {
  const [low, high] = [1e17, 1e17 + 16];
  assert.deepEqual(ticks(low, high, 5), []);
  assert.deepEqual(tape(1e17, 20).rungs, []);
  assert.deepEqual(wholes(2 ** 53 - 1, 2 ** 53 + 1), []);
  assert.deepEqual(wholes(-1, 2), [-1, 0, 1, 2]);
  assert.deepEqual(wholes(3, 2), []);
  const [bottom, top] = spanOf(low, high, []);
  assert.ok(top - bottom > 1e15, "as good as one value");
  assert.ok(ticks(bottom, top, 5).length > 2);
});

test("a gauge turns 270 degrees, open below", () => {
  assert.deepEqual([angle(0), angle(0.5), angle(1)], [-135, 0, 135]);
  assert.equal(arc(0, 0.5, 80), "M-56.57 56.57A80 80 0 0 1 0.00 -80.00");
  assert.match(arc(0, 1, 80), / 0 1 1 /);
  assert.equal(dashes([0.5], 70, 80), "M0.00 -70.00L0.00 -80.00");
});

test("pitch and yaw change their sign between FLU and FRD, roll does not", () => {
  const angles = { roll: 10 * RAD, pitch: 20 * RAD, yaw: 30 * RAD };
  const [flu, frd] = [leanOf(angles, "FLU"), leanOf(angles, "FRD")];
  near(flu.bank, 10), near(flu.nose, -20), near(flu.turn, -30);
  near(frd.bank, 10), near(frd.nose, 20), near(frd.turn, 30);
  assert.deepEqual(leanOf({ roll: null, pitch: null, yaw: null }, "FLU"), { bank: null, nose: null, turn: null });
  assert.deepEqual([wrapped(190), wrapped(-190), wrapped(180), wrapped(360)], [-170, 170, 180, 0]);
});

test("a quaternion becomes the angles it was made of, whatever its length and order", () => {
  for (const [roll, pitch, yaw] of [[0.3, -0.7, 2.5], [-2.9, 1.2, -0.4], [0, 0, 0]]) {
    const [cr, sr, cp, sp, cy, sy] = [roll, pitch, yaw].flatMap((each) => [Math.cos(each / 2), Math.sin(each / 2)]);
    const w = cr * cp * cy + sr * sp * sy;
    const x = sr * cp * cy - cr * sp * sy;
    const y = cr * sp * cy + sr * cp * sy;
    const z = cr * cp * sy - sr * sp * cy;
    for (const found of [ofQuaternion([x, y, z, w], "xyzw"), ofQuaternion([2 * w, 2 * x, 2 * y, 2 * z], "wxyz")]) {
      near(found.roll, roll), near(found.pitch, pitch), near(found.yaw, yaw);
    }
  }
  const up = ofQuaternion([0, Math.SQRT1_2, 0, Math.SQRT1_2], "xyzw");
  near(up.pitch, Math.PI / 2);
  for (const none of [[0, 0, 0, 0], [0, 0, null, 1], [0, 0, 1], [NaN, 0, 0, 1]]) {
    assert.equal(ofQuaternion(none, "xyzw"), null);
  }
});

test("a solid shows its back and its top, and its belly once it lies on its roof", () => {
  const nearest = (lean) => solid(lean).slice(-3).map(({ name }) => name);
  assert.ok(nearest({ bank: 0, nose: 0, turn: 0 }).includes("back"));
  assert.ok(nearest({ bank: 0, nose: 0, turn: 0 }).includes("top"));
  assert.ok(nearest({ bank: 180, nose: 0, turn: 0 }).includes("bottom"));
  const height = (lean, name) => {
    const { points } = solid(lean).find((face) => face.name === name);
    return points.reduce((sum, [, y]) => sum + y, 0) / points.length;
  };
  const level = { bank: 0, nose: 0, turn: 0 };
  assert.ok(height({ ...level, nose: 20 }, "front") < height(level, "front"), "nose up is up");
  assert.ok(height({ ...level, bank: 20 }, "right") > height(level, "right"), "right side down is down");
});

test("bearings count clockwise from north, yaw counter-clockwise from east", () => {
  assert.deepEqual([bearing(-10), bearing(720), bearing(-360)], [350, 0, 0]);
  near(bearingOf(Math.PI / 2, "rad", "yaw"), 0);
  near(bearingOf(0, "rad", "yaw"), 90);
  near(bearingOf(47, "deg", "bearing"), 47);
  for (const degrees of [0, 45, 200, 359]) {
    near(bearingOf(angleOf(degrees, "rad", "yaw"), "rad", "yaw"), degrees);
    near(bearingOf(angleOf(degrees, "deg", "bearing"), "deg", "bearing"), degrees);
  }
  assert.deepEqual([turn(350, 10), turn(10, 350), turn(0, 180)], [20, -20, 180]);
  assert.deepEqual([point(0), point(22), point(23), point(359), point(225)], ["N", "N", "NE", "N", "SW"]);
  assert.deepEqual([figures(7.4), figures(359.7), figures(null)], ["007", "000", "—"]);
  near(bearingAt(10, 0, 0), 90), near(bearingAt(0, 10, 30), 210);
});

test("a tape covers more than is seen, and moves by its offset", () => {
  const { base, rungs } = tape(431.27, 20);
  assert.equal(base, 440);
  assert.ok(rungs.length < 60);
  assert.ok(rungs.every(({ value, y }) => Math.abs(y + ((value - base) / 20) * HIGH) < 1e-6));
  assert.ok(covers(431.27, base, 20) && !covers(470, base, 20));
  assert.equal(offset(base + 10, base, 20), HIGH / 2);
});

test("a battery lasts while it is discharged; what is not known is no number", () => {
  assert.equal(timeLeft(50, -5, 10), 3600);
  assert.equal(timeLeft(50, 5, 10), null);
  assert.equal(timeLeft(50, -0.0001, 10), null);
  assert.equal(timeLeft(null, -5, 10), null);
  assert.equal(timeLeft(50, -5, undefined), null);
  assert.deepEqual(clock(7530), { hours: 2, minutes: 5 });
  near(spread([3.9, null, 3.2]), 0.7);
  assert.equal(spread([3.9, null]), null);
  assert.deepEqual(cellScale({ unit: "V" }, {}), [3, 4.2]);
  assert.deepEqual(cellScale({ unit: "%", min: 0, max: 90 }, { cell_min: 10 }), [10, 90]);
  const mean = new Mean(30);
  assert.equal(mean.add(-4, 0), -4);
  near(mean.add(-8, 30), -4 - 4 * (1 - Math.exp(-1)));
  assert.equal(mean.add(null, 31), null);
});

test("a ring keeps the newest, cuts where readings are missing, and finds a time", () => {
  const ring = new Ring(4);
  for (const [time, value] of [[1, 10], [2, 20], [2, 99], [3, 30], [9, 90]]) ring.add(time, value, 5);
  // 1 is dropped: 2, 3, a gap, 9 are kept.
  assert.deepEqual([ring.first, ring.count], [1, 5]);
  assert.deepEqual([1, 2, 3, 4].map((place) => ring.value(place)), [20, 30, NaN, 90]);
  assert.equal(ring.since(2.5), 1);
  assert.equal(ring.since(100), 4);
  ring.cut(), ring.cut();
  assert.equal(ring.count, 6);
  assert.deepEqual(extent([ring], 0), [30, 90]);
  assert.deepEqual(extent([], 0), [Infinity, -Infinity]);
});

test("what is saved has a row for each time, and no formula", () => {
  const [one, other] = [new Ring(9), new Ring(9)];
  one.add(1, 1.5, 0), one.add(2, 2.5, 0), one.cut(), other.add(2, 7, 0);
  const rows = table([one, other], 0, 10);
  assert.deepEqual(rows.times.slice(0, 2), [1, 2]);
  assert.deepEqual(rows.columns[1]?.slice(0, 2), [undefined, 7]);
  assert.equal(
    csv(['=cmd, "x"', "b"], rows, 0),
    'time,"\'=cmd, ""x""",b\r\n1970-01-01T00:00:01.000Z,1.5,\r\n1970-01-01T00:00:02.000Z,2.5,7\r\n',
  );
  assert.deepEqual([seconds("10s"), seconds("5min"), seconds(null)], [10, 300, 60]);
});

test("a radio has no more bars than four", () => {
  assert.deepEqual([-40, -55, -60, -70, -80, -90].map((each) => bars(each, "dBm")), [4, 4, 3, 2, 1, 0]);
  assert.deepEqual([0, 1, 50, 100, 120].map((each) => bars(each, "%")), [0, 1, 2, 4, 4]);
  const minute = new Minute();
  assert.ok(minute.add(0.1, -50) && minute.add(0.5, -70) && !minute.add(0.9, -60));
  minute.add(10, -60), minute.add(11, -60), minute.add(70.5, -60);
  assert.equal(minute.points[0]?.second, 10);
  assert.match(minute.path(70, "dBm"), /^M0 [\d.]+L1 [\d.]+M60 /);
});

test("speeds have their units, and a velocity without a part has no length", () => {
  near(shownIn("kn")?.factor(1852 / 3600) ?? null, 1);
  near(shownIn("km/h")?.factor(1) ?? null, 3.6);
  assert.equal(shownIn("auto"), null);
  assert.equal(shownIn("toString"), null);
  assert.equal(lengthOf([3, 4]), 5);
  assert.equal(lengthOf([3, null]), null);
  assert.equal(lengthOf([]), null);
});

test("rows come from every form of report, the gravest first", () => {
  assert.deepEqual([0, 1, 2, 3, 7, "WARN", "2", "toString", null].map(levelOf), [
    "ok", "warn", "error", "stale", "unknown", "warn", "error", "unknown", "unknown",
  ]);
  const rows = [
    ...rowsOf({ status: [{ level: 0, name: "a", message: "fine" }, { level: 2, name: "b" }] }),
    ...rowsOf({ c: "warn", d: { level: 1, message: "hot" }, e: "47" }),
    ...rowsOfLists([2], ["f", "g"], []),
  ];
  const order = (wanted) => shown(rows, { sort: "severity", least: "ok", filter: "", ...wanted }).map(({ name }) => name).join("");
  assert.equal(order({}), "bfcdega");
  assert.equal(order({ sort: "given" }), "abcdefg");
  assert.equal(order({ least: "error" }), "bf");
  assert.equal(order({ least: "warn" }), "bfcdeg");
  assert.equal(order({ filter: "HOT" }), "d");
  assert.deepEqual(rowsOf(null), []);
  assert.equal(rowsOf({ status: Array(9999).fill({}) }).length, 500);
});

test("a trend is told apart from noise", () => {
  const trend = new Trend(10);
  for (let time = 0; time < 3; time += 1) trend.add(time, time);
  assert.equal(trend.direction(), null);
  for (let time = 3; time < 30; time += 0.1) trend.add(time, time);
  assert.equal(trend.direction(), 1);
  assert.ok(trend.points.length <= 130);
  assert.equal(trend.direction(20), 0);
  trend.clear();
  for (let time = 0; time < 10; time += 0.5) trend.add(time, time % 1 ? 5 : -5);
  assert.equal(trend.direction(), 0);
  trend.clear();
  for (let time = 0; time < 10; time += 0.5) trend.add(time, -time);
  assert.equal(trend.direction(), -1);
});

test("a profile's picture is a picture and nothing else", () => {
  assert.equal(pictureOf({ source: "data:image/png;base64,AA" }), "data:image/png;base64,AA");
  assert.equal(pictureOf({ file: "/robots/a/files/x.png", source: "x" }), "/robots/a/files/x.png");
  assert.equal(pictureOf({ file: "//elsewhere/x.png" }), "");
  for (const source of ["javascript:alert(1)", "https://x/y.png", "data:text/html,x", "", null]) {
    assert.equal(pictureOf({ source }), "");
  }
});

test("the time span of a plot doubles with its readings, up to the window", () => {
  assert.equal(spanFor(0, 60), 10);
  assert.equal(spanFor(10, 60), 10);
  assert.equal(spanFor(10.5, 60), 20);
  assert.equal(spanFor(59, 60), 60);
  assert.equal(spanFor(9999, 300), 300);
  assert.equal(spanFor(9999, 10), 10, "a window of 10 s never grows");
});
