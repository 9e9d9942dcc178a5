// @ts-check
/** Frames that do not answer: who is blamed, and who comes back. */
import assert from "node:assert/strict";
import { test } from "node:test";
import { TICK_MS, FrameWatchdog } from "../../urc/web/static/frame/frame_watchdog.js";

/** Plays a page with frames. */
class Page {
  constructor() {
    this.watch = new FrameWatchdog();
    this.nowMs = 0;
    /** @type {string[]} */
    this.told = [];
    this.tick();
  }

  /** @param {string} name */
  frame(name) {
    const { watch, told } = this;
    const one = {
      name, isUp: true, isBusy: false, isMounted: true, isAnswering: true, strikes: 0,
      ping() {
        if (one.isAnswering) watch.answered(one);
      },
      accuse() {
        told.push(`${name} is blamed`);
        watch.remove(one);
      },
      leave() {
        told.push(`${name} leaves`);
        watch.remove(one);
      },
      enter() {
        told.push(`${name} enters`);
        one.isAnswering = true;
        one.isBusy = false;
        watch.add(one);
      },
    };
    watch.add(one);
    return one;
  }

  tick(afterMs = TICK_MS) {
    this.nowMs += afterMs;
    this.watch.tick(this.nowMs);
  }

  ticks(count = 1) {
    for (let tick = 0; tick < count; tick += 1) this.tick();
  }
}

test("a frame that answers is left alone", () => {
  const page = new Page();
  page.frame("good");
  page.ticks(100);
  assert.deepEqual(page.told, []);
});

test("one that alone is silent for two seconds is blamed, and nobody else is touched", () => {
  const page = new Page();
  page.frame("good");
  page.frame("bad").isAnswering = false;
  page.ticks(8);
  assert.deepEqual(page.told, []);
  page.ticks(2);
  assert.deepEqual(page.told, ["bad is blamed"]);
  page.ticks(100);
  assert.deepEqual(page.told, ["bad is blamed"]);
});

test("a page that was late itself blames nobody for it", () => {
  const page = new Page();
  page.frame("slow").isAnswering = false;
  for (let time = 0; time < 20; time += 1) page.tick(5000);
  assert.deepEqual(page.told, []);
});

test("of those who are silent together, the one at work is blamed; the others come back in turn", () => {
  const page = new Page();
  const all = ["one", "bad", "two"].map((name) => page.frame(name));
  for (const frame of all) frame.isAnswering = false;
  if (all[1]) all[1].isBusy = true;
  page.ticks(10);
  assert.deepEqual(page.told, ["bad is blamed", "one leaves", "two leaves"]);
  page.ticks(10);
  assert.equal(page.told.length, 3, "a browser ends the process first");
  page.ticks(3);
  assert.deepEqual(page.told.slice(3), ["one enters", "two enters"]);
  page.ticks(100);
  assert.equal(page.told.length, 5);
});

test("one that was only coming up is blamed when nobody was at work", () => {
  const page = new Page();
  const [good, bad] = [page.frame("good"), page.frame("bad")];
  bad.isMounted = false;
  good.isAnswering = bad.isAnswering = false;
  page.ticks(10);
  assert.deepEqual(page.told, ["bad is blamed", "good leaves"]);
});

test("a frame that still loads is taken out with a silent one: it may wait behind it", () => {
  const page = new Page();
  const [bad, late] = [page.frame("bad"), page.frame("late")];
  late.isUp = late.isMounted = false;
  bad.isAnswering = false;
  page.ticks(10);
  assert.deepEqual(page.told, ["bad is blamed", "late leaves"]);
});

test("when nobody knows who it was, all come back, and the third time all are blamed", () => {
  const page = new Page();
  const [one, other] = [page.frame("one"), page.frame("other")];
  for (let time = 0; time < 3; time += 1) {
    one.isAnswering = other.isAnswering = false;
    page.ticks(60);
  }
  const count = (/** @type {string} */ text) => page.told.filter((each) => each === text).length;
  assert.deepEqual([count("one enters"), count("one is blamed"), count("other is blamed")], [2, 1, 1]);
});

test("one that comes back to where nothing answers is taken out again, for longer each time", () => {
  const page = new Page();
  const all = ["one", "bad"].map((name) => page.frame(name));
  const [one, bad] = all;
  assert(one && bad);
  one.isAnswering = bad.isAnswering = false;
  bad.isBusy = true;
  page.ticks(10);
  one.isUp = one.isMounted = false; // it finds the old process
  page.ticks(13 + 41 + 24);
  assert.deepEqual(page.told.slice(2), ["one enters", "one leaves", "one enters"]);
});
