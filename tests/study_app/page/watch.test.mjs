import assert from "node:assert/strict";
import test, { beforeEach } from "node:test";

import { browser, load, Video } from "./load.mjs";

const { page } = browser();
const { ClipWatch, unionSeconds } = await load("watch.js");
let now = 1;
performance.now = () => now;

let video, watch, reports, told;
beforeEach(() => {
  [video, reports, told] = [new Video(2), [], []];
  document.hidden = false;
  const note = (what) => () => told.push(what);
  const handlers = { changed: () => null, failed: note("failed"), hidden: note("hidden") };
  watch = new ClipWatch(video, (kind, detail) => reports.push({ kind, ...detail }), handlers);
});

/** Play from the beginning to the end in real time. */
async function view(seconds = 2) {
  await watch.play();
  now += 1000 * seconds;
  video.reach(2);
}

test("the union of stretches counts what overlaps once", () => {
  assert.equal(unionSeconds([]), 0);
  assert.equal(unionSeconds([[3, 4], [0, 1], [0.5, 2]]), 3);
  assert.equal(unionSeconds([[0, 4], [1, 2]]), 4);
  assert.equal(unionSeconds([[2, 1]]), 0);
});

test("a clip played to its end in real time is seen, and both moments are reported", async () => {
  await view();
  assert.equal(watch.seen, true);
  const complete = { kind: "complete", view: 1, covered: 1, rate: 1, hidden: false, wall_ms: 2000, dropped: null };
  assert.deepEqual(reports, [{ kind: "play", view: 1 }, complete]);
});

test("seeking to the end covers nothing", async () => {
  await watch.play();
  video.seek(2);
  now += 2000;
  video.finish();
  assert.equal(watch.seen, false);
  assert.equal(reports.at(-1).covered, 0);
});

test("what an earlier, faster view covered does not count for the next one", async () => {
  await watch.play();
  video.playbackRate = 4;
  video.dispatchEvent(new Event("ratechange"));
  now += 500;
  video.reach(2);
  assert.deepEqual([watch.seen, reports.at(-1).rate], [false, 4]);
  await watch.play();
  now += 1000;
  video.reach(1);
  video.seek(0);
  now += 1000;
  video.reach(1);
  video.seek(2);
  video.finish();
  assert.deepEqual([watch.seen, reports.at(-1).covered, reports.at(-1).wall_ms], [false, 0.5, 2000]);
});

test("a clip that ran in less than its own time is not seen", async () => {
  await view(1.7);
  assert.equal(watch.seen, false);
  await view(1.8);
  assert.equal(watch.seen, true);
});

test("hiding the page stops the clip, spoils the view and is told on return", async () => {
  await watch.play();
  document.hidden = true;
  page.dispatchEvent(new Event("visibilitychange"));
  assert.deepEqual([video.paused, watch.spoiled, reports.at(-1).kind], [true, true, "hidden"]);
  document.hidden = false;
  page.dispatchEvent(new Event("visibilitychange"));
  assert.deepEqual(told, ["hidden"]);
  await view();
  assert.equal(watch.seen, true);
});

test("a blocked start is no view", async () => {
  video.blocked = true;
  await assert.rejects(watch.play(), { name: "NotAllowedError" });
  assert.deepEqual([watch.plays, reports], [0, []]);
});

test("a view goes on after it waited for the other clip, and waiting is not counted as playing", async () => {
  await watch.play();
  now += 500;
  video.reach(0.5);
  watch.hold();
  assert.deepEqual([video.paused, watch.playing], [true, true]);
  now += 300;
  await watch.release();
  now += 1500;
  video.reach(2);
  assert.deepEqual([watch.seen, reports.at(-1).wall_ms, reports.at(-1).covered], [true, 2000, 1]);
});

test("a clip that is loading is not asked for again", async () => {
  Object.assign(video, { readyState: 1, networkState: 2 });
  const ready = watch.ready();
  video.dispatchEvent(new Event("canplaythrough"));
  await ready;
  assert.equal(video.loads, 0);
  video.networkState = 1;
  void watch.ready();
  assert.equal(video.loads, 1);
});

test("a clip that cannot be decoded is told with its code", () => {
  video.error = { code: 3 };
  video.dispatchEvent(new Event("error"));
  assert.deepEqual([told, reports], [["failed"], [{ kind: "error", code: 3 }]]);
});
