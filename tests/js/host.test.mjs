// @ts-check
/** A dead-man control of a third-party widget counts before its code has loaded. */
import assert from "node:assert/strict";
import test from "node:test";

class Observer {
  observe() {}
  unobserve() {}
}
Object.assign(globalThis, { IntersectionObserver: Observer, ResizeObserver: Observer, window: globalThis });
const { Host } = await import("../../urc/web/static/widgets/host.js");

/** @param {Set<Element>} gated */
function open(gated) {
  const host = new Host(/** @type {any} */ ({}), /** @type {any} */ ({ input: { gated } }));
  host.painted.port1.close(); // else it keeps this program running
  return host;
}

/** @param {object} config */
function frame(config) {
  return /** @type {any} */ ({ dataset: { frame: "x", config: JSON.stringify(config) }, isConnected: false });
}

test("nothing can be driven while a dead-man control of a third-party widget loads", () => {
  const gated = new Set();
  const host = open(gated);
  const [deadMan, other] = [frame({ deadMan: true }), frame({})];
  host.mountForeign(deadMan).catch(() => {});
  host.mountForeign(other).catch(() => {});
  assert.deepEqual([...gated], [deadMan]);
});

test("a dead-man control that is removed while it loads gates nothing any more", () => {
  const gated = new Set();
  const host = open(gated);
  const deadMan = frame({ deadMan: true });
  host.mountForeign(deadMan).catch(() => {});
  host.unmountAll(/** @type {any} */ ({ contains: (/** @type {unknown} */ el) => el === deadMan }));
  assert.equal(gated.size, 0);
});
