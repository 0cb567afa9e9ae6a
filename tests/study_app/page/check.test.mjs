import assert from "node:assert/strict";
import test from "node:test";

import { load } from "./load.mjs";

const { fill, lineSpeed, obstacle } = await load("check.js");
const wanted = { min_width: 800, min_height: 600, min_kbit: 500 };
const found = { width: 800, height: 600, kbit: 500, plays: true };
let now = 0;
performance.now = () => now;

/** A line that delivers parts of so many bytes, each after so many milliseconds. */
function line(parts, bytes, milliseconds) {
  let left = parts;
  const cancelled = [];
  const read = async () => {
    if (left === 0) return { done: true };
    left -= 1;
    now += milliseconds;
    return { done: false, value: new Uint8Array(bytes) };
  };
  globalThis.fetch = async () => ({ body: { getReader: () => ({ read, cancel: () => cancelled.push(left) }) } });
  return cancelled;
}

test("what is just enough is enough", () => assert.equal(obstacle(found, wanted), ""));

for (const [change, reason] of [
  [{ plays: false, width: 1 }, "noVideo"],
  [{ width: 799 }, "small"],
  [{ height: 599 }, "small"],
  [{ kbit: 499 }, "slow"],
  [{ kbit: null }, ""],
]) {
  test(`${JSON.stringify(change)} is told as "${reason}"`, () => {
    assert.equal(obstacle({ ...found, ...change }, wanted), reason);
  });
}

test("every place of a text is filled", () => {
  assert.equal(fill("{width} x {height}, {width}!", found), "800 x 600, 800!");
});

test("speed is bits over milliseconds", async () => {
  line(4, 1000, 10);
  assert.equal(await lineSpeed("/line"), 800);
});

test("a very slow line is measured for five seconds only", async () => {
  const cancelled = line(100, 125, 1000);
  assert.equal(await lineSpeed("/line"), 1);
  assert.deepEqual(cancelled, [94]);
});

test("a line that breaks, or clocks too coarse to tell, give no figure", async () => {
  line(1, 1000, 0);
  assert.equal(await lineSpeed("/line"), null);
  globalThis.fetch = async () => { throw new TypeError("no line"); };
  assert.equal(await lineSpeed("/line"), null);
});
