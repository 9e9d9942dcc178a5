import assert from "node:assert/strict";
import { test } from "node:test";
import { deflateSync } from "node:zlib";
import { colour, palette, pixel } from "../../urc/web/static/widgets/colour_map.js";
import { Rate, ageText, fileName, lookOf, place } from "../../widgets/camera/frame.js";
import { arrayField, paint, pixelAt, probe, rawField, readField } from "../../widgets/depth/field.js";
import {
  Trail, bearingOf, distance, gridStep, headingText, isInside, lengthOf, perMetre, placeOf, placeText, placesOf, readFix, sexagesimal,
} from "../../widgets/map/geo.js";
import { bearing, crop, firstView, poseOf, target, tilted, turned, verticalFov } from "../../widgets/pano360/look.js";
import { Track, at, bearings, besides, kindOf, nearestOf, sector, shareOf, sideOf, zoneOf } from "../../widgets/range/sight.js";
import { Even, NO_RAY, Uneven, faultOf } from "../../widgets/scan/fan.js";
import { arc, band, chart, dots, graph, view } from "../../widgets/scan/paint.js";
import {
  Rim, bearingOfPixels, directions, measured, nearest, rayOfPixels, raysOfColumns, reachOfPixels, rimOf, ringStep, sideOf as scanSide,
} from "../../widgets/scan/rays.js";
import { fileOf } from "../../widgets/scene3d/model.js";
import { angles, cameraAt, cloud, fromAngles, fromOrientation, posture, turned as spun } from "../../widgets/scene3d/pose.js";

/** @param {number} one @param {number} other @param {number} [by] */
function near(one, other, by = 1e-6) {
  assert.ok(Math.abs(one - other) <= by, `${one} is not ${other}`);
}

/** @param {readonly number[]} one @param {readonly number[]} other */
function allNear(one, other) {
  assert.equal(one.length, other.length);
  one.forEach((value, index) => near(value, other[index] ?? NaN));
}

test("cividis rises in brightness from end to end, so that it works in grey", () => {
  const light = Array.from({ length: 256 }, (_, step) => {
    const [red, green, blue] = colour(step / 255);
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue;
  });
  for (let step = 1; step < 256; step += 1) assert.ok((light[step] ?? 0) > (light[step - 1] ?? 0) - 0.2);
  assert.deepEqual(colour(0), [0, 34, 78]);
  assert.deepEqual(colour(1), [254, 232, 56]);
  assert.deepEqual(colour(-3), colour(0));
  assert.equal(palette().length, 256);
  assert.equal(pixel("rgb(1, 2, 3)"), pixel("#010203"));
  assert.equal(new Uint8Array(new Uint32Array([pixel("#010203", 7)]).buffer).join(), "1,2,3,7");
});

test("a distance beyond the range is clear, below it too close, and no number is not known", () => {
  const bounds = { min: 0.2, max: 4, near: 1, stop: 0.5 };
  assert.deepEqual(
    [0.1, 0.2, 0.21, 3.9, 4, Infinity, -Infinity, NaN, null, "1"].map((value) => kindOf(value, bounds)),
    ["close", "close", "in", "in", "clear", "clear", "close", "unknown", "unknown", "unknown"],
  );
  assert.deepEqual([0.1, 0.5, 0.9, 2, 5, null].map((value) => zoneOf(value, bounds)), ["stop", "stop", "near", "", "", ""]);
  assert.deepEqual([2, 4, 0.1, null].map((value) => shareOf(value, bounds)), [0.5, 1, 0, 0]);
});

test("ahead is up and left is left, and a sector lies around its bearing", () => {
  assert.deepEqual([at(0, 10), at(90, 10), at(180, 10)], [[0, -10], [-10, 0], [0, 10]]);
  assert.equal(sector(0, 60, 0, 10), "M-5 -8.66A10 10 0 0 1 5 -8.66L0 0Z");
  assert.match(sector(0, 360, 5, 10), /^M-0\.02 10A10 10 0 1 1 /);
  assert.deepEqual(bearings([10], 4), [10, 90, 180, 270]);
  assert.deepEqual([0, 44, 91, 181, -90, 405].map(sideOf), ["ahead", "ahead left", "left", "behind", "right", "ahead left"]);
});

test("the track of a distance is bounded in time and number, with gaps where nothing was known", () => {
  const track = new Track(10, 5);
  for (let time = 0; time < 100; time += 1) track.add(time, 0.5);
  assert.ok(track.points.length <= 5);
  track.add(100, null);
  track.add(101, null);
  assert.equal(track.points.filter(([, share]) => share === null).length, 1);
  track.add(50, 0.1);
  assert.equal(track.points.at(-1)?.[0], 100);
});

test("rays go counter-clockwise from their start, either way round", () => {
  const fan = new Even(4, -Math.PI, Math.PI / 2);
  assert.deepEqual([-Math.PI, -Math.PI / 2, 0, Math.PI / 2, 0.2].map((angle) => fan.rayAt(angle)), [0, 1, 2, 3, 2]);
  assert.equal(new Even(3, -0.1, 0.1).rayAt(2), NO_RAY);
  assert.equal(new Even(3, -0.1, 0.1).rayAt(-0.14), 0);
  assert.equal(new Even(4, 0, -Math.PI / 2).rayAt(-Math.PI / 2), 1);
  const { right, down } = directions(fan);
  allNear([right[2] ?? 9, down[2] ?? 9, right[3] ?? 9, down[1] ?? 9], [0, -1, -1, 0].map((value) => Math.fround(value)));
  assert.deepEqual([...raysOfColumns(new Even(3, 0, 1), 3)], [2, 1, 0]);
  assert.deepEqual([...raysOfColumns(new Even(3, 0, -1), 3)], [0, 1, 2]);
});

test("the nearest thing of a sweep is told with its side; what is clear or not known is none", () => {
  const fan = new Even(4, -Math.PI, Math.PI / 2);
  const seen = measured([9, 2.5, NaN, null], 0.1, 8, new Float32Array(4));
  assert.deepEqual([...seen.slice(0, 2)], [8, 2.5]);
  assert.ok(Number.isNaN(seen[2]) && Number.isNaN(seen[3]));
  const found = nearest(seen, fan, 8);
  assert.equal(found?.distance, 2.5);
  assert.equal(scanSide(found?.angle ?? 0), "right");
  assert.equal(nearest(measured([9, NaN, 8, null], 0, 8, new Float32Array(4)), fan, 8), null);
  assert.equal(nearest(measured([0.05], 0.1, 8, new Float32Array(1)), fan, 8)?.distance, 0);
  assert.deepEqual([10, 4, 0.9, 250].map((most) => ringStep(most)), [2, 1, 0.2, 50]);
});

test("the picture of a scan is as large as nine of ten obstacles need", () => {
  const room = new Float32Array([...new Array(9).fill(2.2), 9]);
  assert.equal(rimOf(room, 12), 2.5);
  assert.equal(rimOf(room, 2), 2, "never beyond the sensor");
  assert.equal(rimOf(new Float32Array([12, NaN]), 12), 12, "nothing in sight");
  const rim = new Rim();
  assert.deepEqual([[10, 0], [2, 1], [2, 2.9], [2, 3]].map(([far = 0, time = 0]) => rim.follow(far, time)), [10, 10, 10, 2]);
  assert.equal(rim.follow(5, 3.1), 5, "it grows at once");
  assert.deepEqual([[2, 4], [5, 5], [2, 6], [2, 7.9]].map(([far = 0, time = 0]) => rim.follow(far, time)), [5, 5, 5, 5]);
});

const INK = { wall: 1, near: 2, stop: 3, free: 4, unknown: 5 };

test("each picture of a scan puts things where they are", () => {
  const fan = new Even(4, -Math.PI, Math.PI / 2); // behind, right, ahead, left
  const limits = { most: 10, reach: 10, near: 6, stop: 3 };
  const seen = measured([10, 5, 2, NaN], 0, 10, new Float32Array(4));
  const size = 101;
  const pixels = new Uint32Array(size * size);
  const look = (/** @type {number} */ x, /** @type {number} */ y) => pixels[y * size + x];
  dots(pixels, size, seen, directions(fan), limits, INK);
  assert.deepEqual([look(75, 50), look(50, 40), look(50, 100), look(10, 50)], [2, 3, 0, 0]);
  dots(pixels, size, seen, directions(fan), { ...limits, most: 4 }, INK);
  assert.deepEqual([look(100, 50), look(50, 25), look(50, 100)], [5, 3, 0], "what is beyond the rim is faint on it");
  const [rays, reach] = [rayOfPixels(fan, bearingOfPixels(size)), reachOfPixels(size)];
  chart(pixels, rays, reach, size, seen, limits, INK);
  assert.deepEqual([look(60, 50), look(75, 50), look(90, 50), look(50, 45), look(50, 40), look(30, 50)], [4, 2, 0, 4, 3, 5]);
  assert.equal(look(50, 90), INK.free, "behind is clear to the rim");
  const shades = palette();
  arc(pixels, band(reach, size), rays, seen, limits, shades, INK.unknown);
  assert.equal(look(50, 50), 0);
  assert.equal(look(50, 12), shades[204]); // ahead, at 2 of 10: bright
  assert.equal(look(9, 50), INK.unknown);
  const wide = new Uint32Array(9 * 100);
  view(wide, 9, 100, raysOfColumns(fan, 9), seen, limits, shades, INK.unknown);
  // From left to right: left is not known, ahead is near, right further, behind clear.
  assert.deepEqual([wide[450], wide[453], wide[456], wide[458]], [INK.unknown, shades[204], shades[127], 0]);
  assert.equal(wide[9 * 5 + 3], 0, "a wall is higher the nearer it is");
  graph(wide, 4, 100, seen, limits, INK);
  assert.equal(wide[4 * 49 + 1], INK.near);
  assert.equal(wide[4 * 78 + 2], INK.stop);
});

const degrees = (/** @type {readonly number[]} */ given) => given.map((each) => (each * Math.PI) / 180);

test("uneven beams reach half-way to their neighbours, and not into the sector without beams", () => {
  const fan = new Uneven(degrees([90, 50, 30, 10, -10, -30, -50, -90])); // a ring of sonars on the front
  const seen = degrees([0, 12, 45, 65, 75, 95, 120, 180, -45, -75, -120, 365]).map((angle) => fan.rayAt(angle));
  assert.deepEqual(seen, [seen[0], 3, 1, 1, 0, 0, NO_RAY, NO_RAY, 6, 7, NO_RAY, 3]);
  assert.ok(seen[0] === 3 || seen[0] === 4, "straight ahead lies between two");
  const { right, down } = directions(fan);
  allNear([right[0] ?? 9, down[3] ?? 9].map((each) => Math.round(each * 1000)), [-1000, -985]);
});

test("uneven beams may come in any order and over several turns, and a single one covers no full turn", () => {
  const fan = new Uneven(degrees([350, 730, 180, 95]));
  assert.deepEqual(degrees([-9, 12, 181, 90]).map((angle) => fan.rayAt(angle)), [0, 1, 2, 3]);
  const single = new Uneven([0]);
  assert.deepEqual(degrees([0, 40, 50, 180]).map((angle) => single.rayAt(angle)), [0, 0, NO_RAY, NO_RAY]);
  assert.equal(new Uneven([]).rayAt(0), NO_RAY);
  const same = new Uneven([1, 1, 1]);
  assert.ok(same.rayAt(1) < 3);
  const found = nearest(measured([5, 4, 2, 9], 0, 8, new Float32Array(4)), fan, 8);
  assert.equal(scanSide(found?.angle ?? 0), "behind");
});

test("as the robot sees it, uneven beams go from left to right, and the cut is where none looks", () => {
  assert.deepEqual([...raysOfColumns(new Uneven(degrees([-60, -20, 30, 60])), 5)], [3, 2, 1, 1, 0]);
  assert.deepEqual([...raysOfColumns(new Uneven(degrees([150, 180, 210])), 3)], [2, 1, 0]);
  assert.equal(raysOfColumns(new Uneven(degrees([0, 90, 180, 270])), 5)[2], 0, "a full turn has ahead in the middle");
  assert.deepEqual([...raysOfColumns(new Uneven([]), 2)], [NO_RAY, NO_RAY]);
});

test("angles that cannot be those of the distances are a fault; a beam without both is left out", () => {
  assert.equal(faultOf([0, 1], [5, 6]), null);
  assert.deepEqual(faultOf([0, 1], [5]), { text: "▲ {angles} angles for {distances} distances", names: { angles: 2, distances: 1 } });
  assert.deepEqual(faultOf([0, null, 2], [5, 6, 7]), { text: "▲ angle {place} of {count} is not a number", names: { place: 2, count: 3 } });
  assert.deepEqual(faultOf([0, "1"], [5, 6])?.names, { place: 2, count: 2 });
  assert.deepEqual(faultOf([Infinity], [5])?.names, { place: 1, count: 1 });
  assert.equal(faultOf([0, null, NaN], [5, null, NaN]), null);
  const fan = new Uneven([0, null, Math.PI]);
  assert.equal(fan.rayAt(0), 0);
  assert.equal(nearest(measured([5, null, 7], 0, 8, new Float32Array(3)), fan, 8)?.distance, 5);
});

test("uneven beams are drawn where they look", () => {
  const fan = new Uneven(degrees([0, 90, 120]));
  const limits = { most: 10, reach: 10, near: 6, stop: 3 };
  const seen = measured([2, 5, 8], 0, 10, new Float32Array(3));
  const size = 101;
  const pixels = new Uint32Array(size * size);
  const look = (/** @type {number} */ x, /** @type {number} */ y) => pixels[y * size + x];
  dots(pixels, size, seen, directions(fan), limits, INK);
  assert.deepEqual([look(50, 40), look(25, 50), look(15, 70), look(75, 50), look(50, 90)], [3, 2, 1, 0, 0]);
  chart(pixels, rayOfPixels(fan, bearingOfPixels(size)), reachOfPixels(size), size, seen, limits, INK);
  assert.deepEqual([look(50, 45), look(25, 50), look(15, 70), look(75, 50), look(50, 90)], [4, 2, 1, 0, 0]);
  const [shades, reach] = [palette(), reachOfPixels(size)];
  arc(pixels, band(reach, size), rayOfPixels(fan, bearingOfPixels(size)), seen, limits, shades, INK.unknown);
  assert.deepEqual([look(50, 12), look(88, 50), look(50, 88)], [shades[204], 0, 0]);
});

test("a sweep of 1080 rays is drawn without a new object for each", () => {
  const fan = new Even(1080, -Math.PI, (2 * Math.PI) / 1080);
  const values = Array.from({ length: 1080 }, (_, index) => 2 + Math.sin(index / 40));
  const [seen, pixels] = [new Float32Array(1080), new Uint32Array(420 * 420)];
  measured(values, 0, 5, seen);
  dots(pixels, 420, seen, directions(fan), { most: 5, reach: 5, near: 0, stop: 0 }, INK);
  assert.ok(pixels.filter((each) => each === INK.wall).length > 1080);
});

test("places on the earth: distance, sexagesimal, bearing, fence", () => {
  near(distance([46.5197, 6.5667], [46.5207, 6.5667], false), 111.19, 0.1);
  assert.equal(distance([0, 0], [3, 4], true), 5);
  assert.equal(lengthOf([[0, 0], [3, 4], [3, 5]], true), 6);
  assert.equal(sexagesimal(46.519653, "NS"), "46°31′10.8″ N");
  assert.equal(sexagesimal(-0.99999999, "EW"), "1°00′00.0″ W");
  assert.equal(placeText([46.5, -6.25], "decimal", false), "46.500000° N, 6.250000° W");
  assert.equal(placeText([2, 1], "dms", true), "x 1.00 m, y 2.00 m");
  assert.deepEqual([0, Math.PI / 2, Math.PI, -Math.PI / 2].map((yaw) => Math.round(bearingOf(yaw))), [90, 0, 270, 180]);
  const fence = placesOf([[0, 0], [0, 2], [2, 2], [2, 0], "no", [NaN, 1]], false);
  assert.equal(fence.length, 4);
  assert.deepEqual([isInside([1, 1], fence), isInside([3, 1], fence), isInside([1, 3], [])], [true, false, true]);
  assert.deepEqual(placesOf([[1, 2]], true), [[2, 1]]);
  assert.deepEqual([placeOf(91, 0, false), placeOf(null, 0, false), placeOf(91, 0, true)], [null, null, [91, 0]]);
  assert.deepEqual([placeOf(-1e300, 5, true), placeOf(5, 1e17, true)], [null, null]);
  near(perMetre([60, 0], false)[1] / perMetre([60, 0], false)[0], 2, 1e-3);
  assert.deepEqual([0.1, 1, 3].map((metres) => gridStep(metres)), [10, 100, 200]);
});

test("a fix says place and accuracy, and nothing while it has none", () => {
  const fix = { latitude: 1, longitude: 2, status: { status: 0 }, position_covariance: [4, 0, 0, 0, 4, 0, 0, 0, 9] };
  assert.deepEqual(readFix(fix), { place: [1, 2], accuracy: 2 });
  assert.equal(readFix({ ...fix, status: { status: -1 } }).place, null);
  assert.deepEqual([readFix(null).place, readFix([1]).place, readFix({ latitude: "1" }).place], [null, null, null]);
});

test("a trail keeps so many places, and none close to the one before", () => {
  const trail = new Trail(3, 1, true);
  const added = [[0, 0], [0, 0.5], [0, 1], [0, 2], [0, 3]].map(([y, x], second) => trail.add([y ?? 0, x ?? 0], 1000 * second));
  assert.deepEqual(added, [true, false, true, true, true]);
  assert.deepEqual(trail.places, [[0, 1], [0, 2], [0, 3]]);
  trail.clear();
  assert.deepEqual(trail.places, [[0, 3]]);
});

test("a jump of the robot's position starts a new trail, a fast robot does not", () => {
  const trail = new Trail(1000, 0.2, true);
  for (const [x, ms] of [[0, 0], [1, 100], [2, 200], [2.1, 300]]) trail.add([0, x ?? 0], ms ?? 0);
  assert.equal(trail.places.length, 3);
  trail.add([5, 2.1], 400); // 50 m/s: its localisation was reset
  assert.deepEqual(trail.places, [[5, 2.1]]);
  trail.add([5, 30], 60_000); // a minute without a value
  assert.equal(trail.places.length, 2);
  const flown = new Trail(1000, 0.2, false);
  for (const [north, ms] of [[0, 0], [0.001, 1000], [0.01, 2000]]) flown.add([46 + (north ?? 0), 6], ms ?? 0);
  assert.deepEqual(flown.places, [[46.01, 6]]); // 111 m/s, and then 1 km/s
});

test("a bearing has three figures", () => {
  assert.deepEqual([7.4, 359.6, -90, 113].map(headingText), ["007°", "000°", "270°", "113°"]);
});

test("a picture fits its box whichever way it is turned", () => {
  const [picture, box] = [{ width: 200, height: 100 }, { width: 100, height: 100 }];
  const look = { fit: /** @type {const} */ ("contain"), rotate: 0, mirror: false };
  assert.deepEqual(place(picture, box, look), { x: 50, y: 50, angle: 0, width: 100, height: 50, flip: 1 });
  assert.equal(place(picture, box, { ...look, fit: "cover" }).width, 200);
  const lying = place(picture, box, { ...look, rotate: 90, mirror: true });
  assert.deepEqual([lying.width, lying.height, lying.flip], [100, 50, -1]);
  const filled = place(picture, { width: 100, height: 400 }, { ...look, fit: "fill", rotate: 270 });
  assert.deepEqual([filled.width, filled.height], [400, 100]);
});

test("a picture in the background is whole, unless it would take less than 73 % of it", () => {
  const look = { fit: /** @type {const} */ ("ground"), rotate: 0, mirror: false };
  const camera = { width: 400, height: 300 };
  // A desktop of 16:10: whole, with bars at the sides.
  const desktop = place(camera, { width: 1440, height: 852 }, look);
  allNear([desktop.width, desktop.height, desktop.x, desktop.y], [1136, 852, 720, 426]);
  // A low phone: whole, the image would take 54 %, so it loses a quarter at its upper edge.
  const low = place(camera, { width: 844, height: 342 }, look);
  allNear([low.width, low.height, low.x, low.y + low.height / 2], [608, 456, 422, 342]);
  // A tablet in portrait: enlarged, the image loses its sides, in equal parts.
  const tall = place(camera, { width: 820, height: 1132 }, look);
  allNear([tall.x, tall.y, tall.width, tall.height], [410, 566, (4 / 3) * 820, 820]);
  // A very low page: a quarter of the image is lost at most.
  const flat = place(camera, { width: 2000, height: 300 }, look);
  allNear([flat.width, flat.height, flat.y + flat.height / 2], [400 * (4 / 3), 400, 300]);
  // On its side, its lower edge on the screen is a side of the image.
  const lying = place(camera, { width: 300, height: 900 }, { ...look, rotate: 90 });
  allNear([lying.width, lying.height, lying.y], [400 * (4 / 3), 400, 450]);
  // As large as its box, the image is where it was.
  assert.equal(place(camera, { width: 800, height: 600 }, look).y, 300);
});

test("a picture that fills the page loses its upper edge, never the ground next to the robot", () => {
  const look = { fit: /** @type {const} */ ("filled"), rotate: 0, mirror: false };
  const desktop = place({ width: 400, height: 300 }, { width: 1440, height: 852 }, look);
  allNear([desktop.width, desktop.height, desktop.y + desktop.height / 2], [1440, 1080, 852]);
  const tall = place({ width: 400, height: 300 }, { width: 380, height: 300 }, look);
  assert.deepEqual([tall.x, tall.y, tall.width, tall.height], [190, 150, 400, 300]);
});

test("a camera turns against the finger, never further than all the way", () => {
  const box = { width: 200, height: 100 };
  assert.deepEqual(lookOf({ x: 25, y: 0, startX: 0, startY: 0 }, box), { pan: 0.5, tilt: 0 });
  assert.deepEqual(lookOf({ x: -500, y: 500, startX: 0, startY: 0 }, box), { pan: -1, tilt: 1 });
  assert.deepEqual([2.44, 9.96, 12.9, 61, 7300].map(ageText), ["2.4 s", "10.0 s", "12 s", "1 min", "2 h"]);
  assert.equal(fileName("Front/../<b>", new Date(0)), "front-b-1970-01-01T00-00-00.png");
  const rate = new Rate();
  for (let frame = 0; frame <= 20; frame += 1) rate.add(frame / 10);
  near(rate.perSecond(2), 10);
  assert.equal(rate.perSecond(60), 0);
});

test("one looks to the left with positive yaw, up with positive pitch", () => {
  allNear(target({ yaw: 0, pitch: 0, fov: 75 }), [0, 0, -1]);
  allNear(target({ yaw: 90, pitch: 0, fov: 75 }), [-1, 0, 0]);
  near(target({ yaw: 0, pitch: 90, fov: 75 })[1], 1);
  assert.deepEqual(turned({ yaw: 170, pitch: 80, fov: 75 }, { yaw: 20, pitch: 30, zoom: 9 }), { yaw: -170, pitch: 89, fov: 110 });
  const { left, top, width, height } = crop({ yaw: 90, pitch: 0, fov: 90 }, 2);
  allNear([left, top, width, height], [0, 0.25, 0.5, 0.5]);
  const narrow = crop({ yaw: 0, pitch: 0, fov: 90 }, 0.75);
  allNear([narrow.width, narrow.height], [0.25, 2 / 3]);
  near(verticalFov({ yaw: 0, pitch: 0, fov: 90 }, 2), 90);
  near(verticalFov({ yaw: 0, pitch: 0, fov: 90 }, 0.5), (Math.atan(2) * 360) / Math.PI);
  assert.deepEqual(tilted({ alpha: 10, beta: 5 }, { alpha: 350, beta: 0 }), { yaw: 20, pitch: 5 });
});

test("the pose of a photo sphere is read from its XMP, in either spelling", () => {
  const bytes = (/** @type {string} */ text) => new TextEncoder().encode(`\xff\xd8http://ns.adobe.com/xap/1.0/\0${text}`);
  const pose = poseOf(bytes('<rdf GPano:PoseHeadingDegrees="120.5" GPano:InitialViewHeadingDegrees="90" GPano:PosePitchDegrees="-3"/>'));
  assert.deepEqual([pose?.heading, pose?.startHeading, pose?.pitch, pose?.roll], [120.5, 90, -3, 0]);
  const home = { yaw: 5, pitch: 0, fov: 75 };
  assert.equal(firstView(pose, home).yaw, 30.5);
  near(bearing(pose, { ...home, yaw: 30.5 }), 90);
  assert.equal(poseOf(bytes("<GPano:PoseHeadingDegrees>7</GPano:PoseHeadingDegrees>"))?.heading, 7);
  assert.equal(poseOf(bytes("nothing of the kind")), null);
  assert.equal(firstView(null, home), home);
  assert.ok(Number.isNaN(bearing(null, home)));
});

const CRC = Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let bit = 0; bit < 8; bit += 1) value = value & 1 ? 0xedb88320 ^ (value >>> 1) : value >>> 1;
  return value >>> 0;
});

/** @param {string} kind @param {Uint8Array} body */
function chunk(kind, body) {
  const data = Buffer.concat([Buffer.from(kind, "latin1"), body]);
  let crc = 0xffffffff;
  for (const byte of data) crc = (CRC[(crc ^ byte) & 255] ?? 0) ^ (crc >>> 8);
  const ends = Buffer.alloc(8);
  ends.writeUInt32BE(body.length, 0);
  ends.writeUInt32BE((crc ^ 0xffffffff) >>> 0, 4);
  return Buffer.concat([ends.subarray(0, 4), data, ends.subarray(4)]);
}

/** @param {number[][]} rows each with the kind of its filter first @param {number} bits @param {number} [colours] */
function png(rows, bits, colours = 0) {
  const width = ((rows[0]?.length ?? 1) - 1) / (bits / 8);
  const head = Buffer.alloc(13);
  head.writeUInt32BE(width, 0);
  head.writeUInt32BE(rows.length, 4);
  head.set([bits, colours, 0, 0, 0], 8);
  const mark = Buffer.from([137, 80, 78, 71, 13, 10, 26, 10]);
  return new Uint8Array(
    Buffer.concat([mark, chunk("IHDR", head), chunk("IDAT", deflateSync(Buffer.from(rows.flat()))), chunk("IEND", Buffer.alloc(0))]),
  );
}

const RAW = { encoding: /** @type {const} */ ("16UC1"), width: 2, height: 2, bigEndian: false, scale: 0.001 };

test("a depth image of 16 bits keeps them all, whatever its rows are filtered by", async () => {
  // 1000, 2000 / 1000, 0 / 1256, 0: none, above, left and the mean of both.
  const rows = [[0, 3, 232, 7, 208], [2, 0, 0, 249, 48], [1, 4, 232, 252, 24], [3, 2, 116, 254, 140]];
  const field = await readField(png(rows, 16), RAW);
  assert.deepEqual([field.width, field.height], [2, 4]);
  allNear([field.metres[0] ?? 0, field.metres[1] ?? 0, field.metres[2] ?? 0].map((each) => Math.round(each * 1000)), [1000, 2000, 1000]);
  assert.ok(Number.isNaN(field.metres[3]), "0 is not known");
  assert.equal(Math.round((field.metres[4] ?? 0) * 1000), 1256);
  await assert.rejects(readField(png(rows, 16, 2), RAW), /one grey channel/);
  await assert.rejects(readField(png(rows, 16).subarray(0, 60), RAW), /ends too early/);
});

test("what ROS puts before a compressed depth image is heeded", async () => {
  const head = Buffer.alloc(12);
  head.writeFloatLE(100, 4);
  head.writeFloatLE(-1, 8);
  const field = await readField(new Uint8Array(Buffer.concat([head, png([[0, 0, 49]], 16)])), { ...RAW, encoding: "32FC1" });
  near(field.metres[0] ?? 0, 2);
  const whole = await readField(new Uint8Array(Buffer.concat([Buffer.alloc(12), png([[0, 3, 232]], 16)])), RAW);
  near(whole.metres[0] ?? 0, 1);
});

test("raw bytes and lists must have the size that was said", () => {
  const bytes = new Uint8Array([232, 3, 0, 0, 208, 7, 1, 0]);
  const { metres } = rawField(bytes, RAW);
  allNear([metres[0] ?? 0, metres[2] ?? 0, metres[3] ?? 0].map((each) => Math.round(each * 1000)), [1000, 2000, 1]);
  assert.ok(Number.isNaN(metres[1]));
  near(rawField(bytes, { ...RAW, bigEndian: true }).metres[3] ?? 0, 0.256);
  const floats = new Uint8Array(new Float32Array([1.5, NaN]).buffer);
  assert.deepEqual([...rawField(floats, { ...RAW, encoding: "32FC1", height: 1, scale: 1 }).metres], [1.5, NaN]);
  assert.throws(() => rawField(bytes, { ...RAW, width: 3 }), /8 bytes came; 3 × 2 of 16UC1 are 12/);
  assert.throws(() => rawField(bytes, { ...RAW, width: 0 }), /set the options width and height/);
  assert.throws(() => arrayField([1, 2, 3], { ...RAW, scale: 1 }), /3 numbers came; 2 × 2 are 4/);
});

test("near is bright, far is dark, and a probe takes the middle of what is known around it", () => {
  const field = arrayField([1, 1, 1, 1, 0, 9, 5, 5, 5], { ...RAW, width: 3, height: 3, scale: 1 });
  assert.equal(probe(field, 0.5, 0.5), 5);
  assert.equal(probe(field, 0, 0), 1);
  assert.ok(Number.isNaN(probe(arrayField([0], { ...RAW, width: 1, height: 1, scale: 1 }), 0.5, 0.5)));
  assert.deepEqual(pixelAt(field, 1, 0), [2, 0]);
  const [shades, into] = [palette(), new Uint32Array(9)];
  paint(field, { near: 1, far: 5 }, shades, 77, into);
  assert.deepEqual([into[0], into[4], into[5], into[6]], [shades[255], 77, shades[0], shades[0]]);
});

test("roll, pitch and yaw turn the model by REP 103, and FRD has pitch and yaw the other way", () => {
  allNear(spun([1, 0, 0], fromAngles(0, 0, Math.PI / 2, "FLU")), [0, 1, 0]);
  allNear(spun([1, 0, 0], fromAngles(0, Math.PI / 2, 0, "FLU")), [0, 0, -1]);
  allNear(spun([1, 0, 0], fromAngles(0, Math.PI / 2, 0, "FRD")), [0, 0, 1]);
  allNear(spun([0, 1, 0], fromAngles(Math.PI / 2, 0, 0, "FRD")), [0, 0, 1]);
  const all = angles(fromAngles(0.1, -0.2, 0.3, "FLU"));
  allNear([all.roll, all.pitch, all.yaw], [0.1, -0.2, 0.3]);
  assert.deepEqual(fromOrientation({ x: 0, y: 0, z: 0, w: 2 }, "FLU"), [0, 0, 0, 1]);
  assert.deepEqual([fromOrientation([0, 0, 0, 0], "FLU"), fromOrientation([1, null, 0, 0], "FLU"), fromOrientation(3, "FLU")], [null, null, null]);
  const words = posture(fromAngles(0.1745, 0.0873, -0.5236, "FLU")).map(({ text, degrees }) => text.replace("{n}", String(degrees)));
  assert.deepEqual(words, ["right side down 10°", "nose down 5°", "turned right 30°"]);
});

test("points are thinned to the budget, and what is no number is left out", () => {
  const many = Array.from({ length: 300 }, (_, index) => index);
  assert.equal(cloud(many, 10, "FLU").length, 30);
  assert.deepEqual([...cloud([1, 2, 3, null, 5, 6, 7, 8], 10, "FRD")], [1, -2, -3]);
  assert.deepEqual(cameraAt("top", 1, 1).slice(0, 2), [0, 0]);
  assert.ok(cameraAt("follow", 0, 1)[0] < 0);
});

test("a model's shape is the file whose path ends most alike", () => {
  const files = ["/robots/a/files/0f/meshes/base.stl", "/robots/a/files/1f/other/base.stl", "/robots/a/files/2f/arm%201.stl"];
  assert.equal(fileOf("package://bot/meshes/base.stl", files), files[0]);
  assert.equal(fileOf("other/base.stl", files), files[1]);
  assert.equal(fileOf("arm 1.stl", files), files[2]);
  assert.equal(fileOf("gone.stl", files), "");
});

test("the nearest that is known counts, and where nobody looks is said once for each reason", () => {
  const bounds = { min: 0, max: 5, near: null, stop: null };
  assert.deepEqual([[null, 3, 2], [null, null], [5, 4], [4, 0]].map((each) => nearestOf(each, bounds)), [2, 0, 1, 1]);
  const sides = ["ahead", "left", "behind", "right"];
  assert.deepEqual(besides(sides, ["", "gone", "7 s old", "gone"], 0), ["left, right: gone", "behind: 7 s old"]);
  assert.deepEqual(besides(sides, ["gone", "", "gone", ""], 1), ["ahead, behind: gone"]);
  assert.deepEqual(besides(sides, ["gone", "gone", "gone", "gone"], 0), []);
  assert.deepEqual(besides([], [], 0), []);
});
