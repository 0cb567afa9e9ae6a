import assert from "node:assert/strict";
import test from "node:test";

import { load } from "./load.mjs";

const { ahead, keepInStep, TOLERANCE_S } = await load("step.js");

/** Two clips at given positions, and a hand to turn the painted frames. */
function pair(first, second) {
  const watches = [first, second].map((currentTime) => ({
    plays: 1, playing: true, held: false, video: { currentTime },
    hold() { this.held = true; },
    release() { this.held = false; },
  }));
  let look = null;
  keepInStep(watches, (next) => (look = next));
  const frame = () => {
    const present = look;
    look = null;
    present();
    return watches.map((watch) => watch.held);
  };
  return { watches, frame, running: () => look !== null };
}

test("clips within one frame of each other are left alone", () => {
  assert.equal(ahead([1, 1 + TOLERANCE_S * 0.99], -1), -1);
  assert.equal(ahead([1 + TOLERANCE_S * 0.99, 1], -1), -1);
});

test("the clip that is ahead waits until the other one has come up", () => {
  const { watches, frame } = pair(1.2, 1.0);
  assert.deepEqual(frame(), [true, false]);
  watches[1].video.currentTime = 1.16;
  assert.deepEqual(frame(), [true, false]);
  watches[1].video.currentTime = 1.19;
  assert.deepEqual(frame(), [false, false]);
  watches[1].video.currentTime = 1.4;
  assert.deepEqual(frame(), [false, true]);
});

test("when one clip has ended the other one goes on alone", () => {
  const { watches, frame, running } = pair(0.5, 1.0);
  assert.deepEqual(frame(), [false, true]);
  watches[0].playing = false;
  assert.deepEqual(frame(), [false, false]);
  assert.equal(running(), false);
});

test("a new view of one clip ends the keeping in step of the old one", () => {
  const { watches, frame, running } = pair(1.0, 1.0);
  watches[0].plays = 2;
  watches[0].video.currentTime = 0;
  assert.deepEqual(frame(), [false, false]);
  assert.equal(running(), false);
});
