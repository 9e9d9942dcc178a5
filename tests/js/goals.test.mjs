// @ts-check
/** Goals and routes of all pages on the map: adopted, ended, lost, and never confused with another. */
import assert from "node:assert/strict";
import test from "node:test";
import { goalsOf } from "../../urc/web/static/widgets/output.js";
import { placeArguments, routeArguments, routeOf, tripOf } from "../../widgets/map/goal_arguments.js";
import { shareGoals } from "../../widgets/map/shared_goals.js";

const GOAL = { number: 3, output: "waypoints", args: { xs: [1, 2, 3], ys: [4, 5, 6] }, by: "screen 1", isOurs: false, since: 10, isLost: false };
const TRIP = { ...GOAL, output: "goto", args: { x: 1, y: 2, yaw: 0.5 } };

/** @param {object} [more] */
function choice(more = {}) {
  /** @type {any} */
  const made = {
    isLocal: true,
    sent: 0,
    active: null,
    trip: null,
    feedback: { told: null },
    left: /** @type {any[]} */ ([]),
    edited() {},
    advance: (/** @type {any} */ told) => {
      if (told.serial > made.active.serial) made.active.at = told.value;
    },
    leftOver: (/** @type {any} */ active) => {
      made.left.push(active.end);
      made.active = null;
    },
    ...more,
  };
  return made;
}

/** @param {any} made @param {...any} goals */
function share(made, ...goals) {
  shareGoals(made, { isKnown: true, goals });
}

test("arguments of a route and of a place are read as they were sent", () => {
  const places = /** @type {[number, number][]} */ ([[1.00049, 2], [-3, 4]]);
  for (const isLocal of [true, false]) {
    const route = routeOf({ ...GOAL, args: routeArguments(places, [0.1, 0.2], isLocal) }, isLocal);
    assert.deepEqual(route?.places, isLocal ? [[1, 2], [-3, 4]] : places);
    assert.deepEqual(route?.yaws, isLocal ? [0.1, 0.2] : [null, null]);
    const trip = tripOf({ ...TRIP, args: placeArguments([5, 6], 0.5, isLocal) }, isLocal);
    assert.deepEqual(trip, { place: [5, 6], yaw: 0.5, by: "screen 1", isLost: false });
  }
});

test("arguments that are no route or no place are not drawn", () => {
  for (const args of [{}, { xs: [1], ys: [1, 2] }, { xs: [], ys: [] }, { xs: 1, ys: 2 }]) {
    assert.equal(routeOf({ ...GOAL, args }, true), null);
  }
  assert.equal(tripOf({ ...TRIP, args: { x: 1 } }, true), null);
  assert.equal(tripOf(undefined, true), null);
});

test("a widget gets the goals of its own outputs, with the names of its manifest", () => {
  /** @type {any} */
  const bound = { command: "navigate", names: { to_x: "x" }, fixed: { speed: 1 } };
  const sent = { number: 1, places: { to_x: 5, y: 6, speed: 1 }, by: "a", isOurs: true, since: 2, isLost: false };
  const found = goalsOf([["goto", bound]], [{ ...sent, command: "navigate" }, { ...sent, command: "dance" }]);
  assert.deepEqual(found, [{ number: 1, by: "a", isOurs: true, since: 2, isLost: false, output: "goto", args: { x: 5, y: 6 } }]);
});

test("a route of another page is shown, and only newer feedback counts for it", () => {
  const old = choice({ feedback: { told: { value: 2, serial: 9, time: 9.5 } } });
  share(old, GOAL);
  assert.deepEqual([old.active.at, old.active.by, old.active.route.size], [0, "screen 1", 3]);
  const newer = choice({ feedback: { told: { value: 2, serial: 9, time: 10.5 } } });
  share(newer, GOAL);
  assert.equal(newer.active.at, 2);
});

test("a route of another page disappears with its end, and keeps its points only for a pause of this page", () => {
  const watching = choice();
  share(watching, GOAL);
  share(watching);
  assert.deepEqual([watching.active, watching.left], [null, []]);
  for (const end of ["pause", "clear"]) {
    const ending = choice();
    share(ending, GOAL);
    ending.active.end = end;
    share(ending);
    assert.deepEqual([ending.active, ending.left], [null, [end]]);
  }
});

test("a newer route of another page takes the place of the older one", () => {
  const made = choice();
  share(made, GOAL);
  share(made, { ...GOAL, number: 4, args: { xs: [9], ys: [9] } });
  assert.deepEqual([made.active.goal, made.active.route.places], [4, [[9, 9]]]);
});

test("the page's own route ends by its reply, or by the server if its reply is lost", () => {
  const own = { number: 1, goal: 0, route: null, at: 0, end: "", isLost: false };
  const made = choice({ sent: 1, active: own });
  share(made, { ...GOAL, isOurs: true });
  assert.equal(made.active.goal, 3);
  share(made);
  assert.equal(made.active, own, "its reply is under way");
  const lost = choice({ sent: 1, active: { ...own, goal: 3, isLost: true } });
  share(lost, { ...GOAL, isOurs: true, isLost: true });
  share(lost);
  assert.deepEqual([lost.active, lost.left], [null, [""]]);
});

test("the page's own route stays lost if the server knows no more than the page", () => {
  const made = choice({ sent: 1, active: { number: 1, goal: 0, route: null, at: 0, end: "", isLost: false, isHeld: false } });
  share(made, { ...GOAL, isOurs: true });
  made.active.isLost = true;
  share(made);
  assert.deepEqual([made.active?.isLost, made.left], [true, []]);
});

test("a route that this page has sent, and whose reply has arrived, is not adopted for a moment", () => {
  const made = choice({ sent: 1 });
  share(made, { ...GOAL, isOurs: true });
  assert.equal(made.active, null);
});

test("after a loss of the server, nothing counts as ended", () => {
  const made = choice();
  share(made, GOAL, TRIP);
  shareGoals(made, { isKnown: false, goals: [] });
  assert.deepEqual([made.active.isLost, made.trip.isLost], [true, true]);
  share(made, { ...GOAL, number: 1 });
  assert.deepEqual([made.active.isLost, made.active.goal, made.trip], [false, 1, null], "numbers begin anew");
  const own = choice({ sent: 1, active: { number: 1, goal: 3, route: null, at: 0, end: "", isLost: true } });
  shareGoals(own, { isKnown: false, goals: [] });
  assert.equal(own.active.isLost, true);
  assert.deepEqual(own.left, []);
});

test("a lost route of another page says so, and may be found again", () => {
  const made = choice();
  share(made, { ...GOAL, isLost: true });
  assert.equal(made.active.isLost, true);
  share(made, GOAL);
  assert.equal(made.active.isLost, false);
});

test("a lost goal hides no running one, and is shown again after it", () => {
  const made = choice();
  const running = { ...TRIP, number: 1, args: { x: 7, y: 8 } };
  share(made, running, { ...TRIP, number: 2, isLost: true });
  assert.deepEqual([made.trip.place, made.trip.isLost], [[8, 7], false]);
  share(made, { ...TRIP, number: 2, isLost: true });
  assert.deepEqual([made.trip.place, made.trip.isLost], [[2, 1], true]);
});
