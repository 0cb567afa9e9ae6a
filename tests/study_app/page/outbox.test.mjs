import assert from "node:assert/strict";
import test, { beforeEach } from "node:test";

import { browser, load } from "./load.mjs";

const { kept } = browser();
const { Outbox, uuid } = await load("outbox.js");
let clock = 0;
let timers = [];
globalThis.setTimeout = (work, milliseconds) => timers.push({ work, at: clock + milliseconds });

let sent, replies, told, box;
beforeEach(() => {
  kept.clear();
  timers = [];
  [sent, replies, told] = [[], [], []];
  globalThis.location = { reload: () => told.push("reload") };
  globalThis.fetch = async (url, request) => {
    sent.push({ url, body: JSON.parse(request.body), csrf: request.headers["X-CSRFToken"] });
    const status = replies.shift() ?? 200;
    if (status === 0) throw new TypeError("no line");
    const json = async () => (status === 302 ? JSON.parse("<html>") : { next: "/next" });
    return { status, ok: status < 300, text: async () => "", json };
  };
  box = new Outbox({
    events: "/events", answer: "/answer", csrf: "c", trial: "t",
    onOffline: () => told.push("offline"), onAnswered: (next) => told.push(next),
  });
});

/** Let promises run, and timers of so many milliseconds. */
async function pass(milliseconds = 0) {
  for (let i = 0; i < 20; i += 1) await Promise.resolve();
  for (let left = milliseconds; left > 0; left -= 50) {
    clock += 50;
    const due = timers.filter((timer) => timer.at <= clock);
    timers = timers.filter((timer) => timer.at > clock);
    for (const timer of due) timer.work();
    for (let i = 0; i < 20; i += 1) await Promise.resolve();
  }
}

test("a report leaves at once, with its own number and the page's token", async () => {
  box.report("play", "first", { view: 1 });
  await pass();
  assert.equal(sent.length, 1);
  assert.equal(sent[0].csrf, "c");
  assert.match(sent[0].body.events[0].uuid, /^[0-9a-f]{8}-[0-9a-f]{4}-4[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}$/);
});

test("a report that waited for an earlier one to leave says for how long", async () => {
  const real = performance.now;
  let now = 0;
  performance.now = () => now;
  box.report("stall", "first", {});
  box.report("play", "first", { view: 1 });
  now = 130;
  await pass();
  performance.now = real;
  assert.deepEqual(sent.map((post) => post.body.events[0].detail), [{}, { view: 1, waited_ms: 130 }]);
});

for (const status of [0, 429, 503]) {
  test(`reports that met ${status || "no line"} come again as the same ones and say that they waited`, async () => {
    const real = performance.now;
    performance.now = () => 0; // a busy machine must not look like an earlier report in the way
    replies = [status];
    box.report("play", "first", { view: 1 });
    await pass(2000);
    performance.now = real;
    const [one, two] = sent.map((post) => post.body.events[0]);
    assert.equal(two.uuid, one.uuid);
    assert.deepEqual([one.detail, two.detail], [{ view: 1 }, { view: 1, queued: true }]);
    assert.deepEqual(box.waiting, []);
  });
}

test("reports that the server refuses for good are let go", async () => {
  replies = [400];
  box.report("alive", null, {});
  await pass(60_000);
  assert.equal(sent.length, 1);
});

for (const status of [0, 302, 429, 503]) {
  test(`an answer that met ${status || "no line"} is kept and sent again until it is stored`, async () => {
    replies = [status, status];
    box.answer({ answer_id: "a" });
    await pass();
    assert.ok(kept.get("answer-t"));
    await pass(2000 + 4000);
    assert.deepEqual(told, ["offline", "offline", "/next"]);
    assert.deepEqual(new Set(sent.map((post) => post.body.answer_id)), new Set(["a"]));
    assert.equal(kept.has("answer-t"), false);
  });
}

test("an answer that the server refuses brings the page that is due", async () => {
  replies = [400];
  box.answer({ answer_id: "a" });
  await pass(60_000);
  assert.deepEqual([told, sent.length, kept.size], [["reload"], 1, 0]);
});

test("an answer that was under way when the page was reloaded is sent again", async () => {
  kept.set("answer-t", JSON.stringify({ answer_id: "a" }));
  box.resume();
  await pass();
  assert.deepEqual([sent[0].url, sent[0].body, told], ["/answer", { answer_id: "a" }, ["/next"]]);
});

test("numbers are random on pages without a secure origin too", () => {
  const whole = crypto.randomUUID;
  crypto.randomUUID = undefined;
  try {
    const numbers = new Set(Array.from({ length: 100 }, () => uuid()));
    assert.equal(numbers.size, 100);
    for (const one of numbers) assert.match(one, /^[0-9a-f-]{14}4[0-9a-f-]{4}[89ab][0-9a-f-]{16}$/);
  } finally {
    crypto.randomUUID = whole;
  }
});
