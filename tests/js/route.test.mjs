// The waypoints of a route: their order, their directions, and what is left of them.
import assert from "node:assert/strict";
import { test } from "node:test";

import { MOST, Route } from "../../widgets/map/route.js";

/** A place at x and y in metres. @param {number} x @param {number} y @returns {[number, number]} */
const at = (x, y) => [y, x];

/** @param {Route} route */
const xs = (route) => route.places.map(([, x]) => x);

/** @param {...number} found */
function routeOf(...found) {
  const route = new Route();
  for (const x of found) route.add(at(x, 0));
  return route;
}

test("a waypoint is moved in the order with its direction, and stays chosen", () => {
  const route = routeOf(1, 2, 3);
  route.aim(0.5);
  assert.equal(route.move(2, -1), true);
  assert.deepEqual(xs(route), [1, 3, 2]);
  assert.deepEqual(route.yaws, [null, 0.5, null]);
  assert.equal(route.chosen, 1);
  assert.equal(route.move(0, -1), false);
  assert.equal(route.move(2, 1), false);
  assert.deepEqual(xs(route), [1, 3, 2]);
});

test("after a deletion, the next waypoint is chosen, or the last", () => {
  const route = routeOf(1, 2, 3);
  route.remove(1);
  assert.deepEqual([xs(route), route.chosen], [[1, 3], 1]);
  route.remove(1);
  assert.deepEqual([xs(route), route.chosen], [[1], 0]);
  route.remove(0);
  route.remove(0);
  assert.deepEqual([xs(route), route.chosen], [[], -1]);
  route.aim(1);
  assert.deepEqual(route.yaws, []);
});

test("a waypoint without its own direction has the direction of travel", () => {
  const route = new Route([at(1, 0), at(1, 1), at(1, 1), at(0, 1)], [null, null, null, 0.25]);
  assert.deepEqual(route.directions(at(0, 0)), [0, Math.PI / 2, Math.PI / 2, 0.25]);
  assert.equal(route.directions(null, 3)[0], 3);
  assert.deepEqual(route.directions(at(1, 5)).slice(0, 1), [-Math.PI / 2]);
});

test("what is left of a route begins with the waypoint that was not reached", () => {
  const route = new Route([at(1, 0), at(2, 0), at(3, 0)], [1, 2, 3]);
  const rest = route.rest(1);
  assert.deepEqual([xs(rest), rest.yaws, rest.chosen], [[2, 3], [2, 3], 1]);
  rest.remove(0);
  assert.deepEqual(xs(route), [1, 2, 3], "the sent route is another one");
  assert.deepEqual(xs(route.rest(3)), []);
});

test("a route is limited", () => {
  const route = new Route();
  for (let x = 0; x <= MOST; x += 1) route.add(at(x, 0));
  assert.equal(route.size, MOST);
});
