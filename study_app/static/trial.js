// @ts-check
/**
 * The trial page: play two clips, prove that both were seen, choose, confirm, send.
 *
 * Nothing is decided here that the server does not check again; nothing is kept only here. Reports
 * leave as they happen, so that the server's own clock can time each view.
 */

import { Outbox } from "./outbox.js";
import { keepInStep } from "./step.js";
import { ClipWatch } from "./watch.js";

const SLOW_MS = 6000;
const ALIVE_MS = 60_000;
const PRELOADS = 2;

const page = /** @type {HTMLElement} */ (document.getElementById("trial"));
const form = /** @type {HTMLFormElement} */ (document.getElementById("answer"));
const status = byId("status");
const confirmButton = /** @type {HTMLButtonElement} */ (byId("confirm"));
const playBoth = /** @type {HTMLButtonElement} */ (byId("play-both"));
const radios = /** @type {HTMLInputElement[]} */ ([...form.querySelectorAll("input[type=radio]")]);
const text = (name) => page.dataset[`text${name}`] ?? "";

const csrf = /** @type {HTMLMetaElement} */ (document.querySelector("meta[name=csrf-token]")).content;
const outbox = new Outbox({
  events: page.dataset.eventsUrl ?? "",
  answer: page.dataset.answerUrl ?? "",
  csrf,
  trial: page.dataset.trial ?? "",
  onOffline: () => say(text("Offline")),
  onAnswered: (next) => location.replace(next),
});

const failedKey = `failed-${page.dataset.trial}`;
const failedBefore = Number(sessionStorage.getItem(failedKey) ?? 0);
let paintedAt = 0;
let allowedAt = 0;
let failures = 0;
let stallText = false;
let blocked = false;

const watches = Object.fromEntries(
  ["first", "second"].map((position) => {
    const video = /** @type {HTMLVideoElement} */ (byId(`video-${position}`));
    const report = (kind, detail) => outbox.report(kind, position, { ...detail, at_ms: sincePaint() });
    return [position, new ClipWatch(video, report, { changed: update, failed, hidden: () => say(text("Hidden")) })];
  })
);
const both = Object.values(watches);

/** @param {string} id */
function byId(id) {
  return /** @type {HTMLElement} */ (document.getElementById(id));
}

function say(message) {
  if (status.textContent !== message) status.textContent = message;
}

const sincePaint = () => (paintedAt ? Math.round(performance.now() - paintedAt) : 0);

function enhance() {
  for (const element of document.querySelectorAll(".scripted")) /** @type {HTMLElement} */ (element).hidden = false;
  for (const [position, watch] of Object.entries(watches)) {
    watch.video.controls = false;
    watch.video.addEventListener("click", () => start([watch]));
    byId(`play-${position}`).addEventListener("click", () => start([watch]));
  }
  playBoth.addEventListener("click", () => start(both));
  for (const radio of radios) radio.addEventListener("change", update);
  form.addEventListener("submit", submit);
  byId("retry").addEventListener("click", () => location.reload());
  byId("skip").addEventListener("click", skip);
  document.addEventListener("keydown", keys);
  // A mouse click must not leave the focus on a button, or the keys would stay silent.
  document.addEventListener("click", (event) => {
    if (event.detail > 0 && document.activeElement instanceof HTMLElement) document.activeElement.blur();
  });
  rememberKeySwitch();
}

/** Play some clips from their beginning, in step. @param {ClipWatch[]} chosen */
async function start(chosen) {
  for (const watch of both) if (!chosen.includes(watch)) watch.stop();
  endBreak();
  blocked = false;
  try {
    await Promise.all(chosen.map((watch) => watch.ready()));
    await Promise.all(chosen.map((watch) => watch.play()));
    if (chosen.length === 2) keepInStep(chosen);
  } catch (error) {
    blocked = error instanceof DOMException && error.name === "NotAllowedError";
    update();
  }
}

/** Who plays at once has had break enough; the time of the trial counts from here. */
function endBreak() {
  const pause = document.getElementById("pause");
  if (!pause) return;
  pause.remove();
  paintedAt = performance.now();
}

/** Bring the page in line with what was seen and chosen so far. */
function update() {
  for (const [position, watch] of Object.entries(watches)) {
    byId(`play-${position}`).textContent = watch.plays ? text("Replay") : text("Play");
    const seen = byId(`seen-${position}`);
    seen.textContent = watch.seen ? "✓" : watch.playing ? `${Math.round(100 * watch.covered())} %` : "";
    seen.classList.toggle("done", watch.seen);
  }
  const allowed = both.every((watch) => watch.seen);
  if (allowed && !allowedAt) allowedAt = performance.now();
  for (const radio of radios) radio.disabled = !allowed;
  confirmButton.disabled = !allowed || !radios.some((radio) => radio.checked) || outbox.sending;
  if (both.every((watch) => watch.loaded)) preload();
  if (!failures && !outbox.sending) say(statusText(allowed));
}

function statusText(allowed) {
  if (blocked) return text("Blocked");
  if (allowed) return text("Choose");
  if (both.some((watch) => watch.spoiled && !watch.seen && !watch.playing)) return text("Hidden");
  if (!both.every((watch) => watch.loaded)) return stallText ? text("Slow") : text("Loading");
  return text("Watch");
}

/** @param {SubmitEvent} event */
function submit(event) {
  event.preventDefault();
  const chosen = radios.find((radio) => radio.checked);
  if (!chosen || confirmButton.disabled) return;
  const now = performance.now();
  for (const watch of both) watch.stop();
  outbox.answer({
    answer_id: form.elements["answer_id"].value,
    chosen: chosen.value,
    response_time_ms: Math.round(now - paintedAt),
    decision_time_ms: Math.round(now - allowedAt),
    plays_first: watches.first.plays,
    plays_second: watches.second.plays,
    layout: presentLayout(),
    screen: measurements(),
  });
  confirmButton.disabled = true;
  for (const radio of radios) radio.disabled = true;
}

/** How the two clips lie now; a narrow window stacks what a wide one puts side by side. */
function presentLayout() {
  const [one, two] = both.map((watch) => watch.video.getBoundingClientRect());
  return two.top >= one.bottom - 1 ? "stacked" : "side_by_side";
}

function measurements() {
  const sizes = both.map((watch) => watch.video.getBoundingClientRect());
  return {
    window_width: innerWidth,
    window_height: innerHeight,
    pixel_ratio: devicePixelRatio,
    first_width: Math.round(sizes[0].width),
    first_height: Math.round(sizes[0].height),
    second_width: Math.round(sizes[1].width),
    second_height: Math.round(sizes[1].height),
    first_dropped: watches.first.dropped(),
    second_dropped: watches.second.dropped(),
    first_stalls: watches.first.stalls,
    second_stalls: watches.second.stalls,
  };
}

/** A clip that cannot be had: say so, offer to try again, and after a second try to go on. */
function failed() {
  failures += 1;
  sessionStorage.setItem(failedKey, String(failedBefore + 1));
  say(text("Failed"));
  byId("trouble").hidden = false;
  byId("skip").hidden = failedBefore === 0;
}

async function skip() {
  try {
    const reply = await fetch(page.dataset.skipUrl ?? "", { method: "POST", headers: { "X-CSRFToken": csrf } });
    if (reply.ok) location.replace((await reply.json()).next);
    else location.reload();
  } catch {
    say(text("Offline"));
  }
}

/** Keys act on the page only, never while a control has the focus, and can be switched off. */
function keys(event) {
  const onControl = document.activeElement && document.activeElement !== document.body;
  const enabled = /** @type {HTMLInputElement} */ (byId("keys")).checked;
  if (!enabled || onControl || event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
  const action = keyAction(event.key);
  if (action) {
    event.preventDefault();
    action();
  }
}

/** @param {string} key */
function keyAction(key) {
  if (key === " " || key === "r" || key === "R") return () => start(both);
  if (key === "Enter") return () => form.requestSubmit(confirmButton.disabled ? null : confirmButton);
  const index = { 1: 0, 2: 1, ArrowUp: 0, ArrowDown: 1, ArrowLeft: 0, ArrowRight: 1 }[key];
  if (index === undefined || radios[index].disabled) return null;
  return () => {
    radios[index].checked = true;
    update();
  };
}

function rememberKeySwitch() {
  const keySwitch = /** @type {HTMLInputElement} */ (byId("keys"));
  keySwitch.checked = localStorage.getItem("study-keys") !== "off";
  keySwitch.addEventListener("change", () => localStorage.setItem("study-keys", keySwitch.checked ? "on" : "off"));
}

let preloading = false;

/** Fetch the clips of the next trials, two at a time, once this trial's own have arrived. */
function preload() {
  if (preloading) return;
  preloading = true;
  const waiting = (page.dataset.preload ?? "").split(" ").filter(Boolean);
  const next = async () => {
    for (let url = waiting.shift(); url; url = waiting.shift()) {
      await fetch(url, { priority: "low" }).then((reply) => reply.blob()).catch(() => null);
    }
  };
  for (let i = 0; i < PRELOADS; i += 1) void next();
}

enhance();
update();
requestAnimationFrame(() =>
  requestAnimationFrame(() => {
    paintedAt = performance.now();
    outbox.report("painted", null, { layout: presentLayout() });
  })
);
setTimeout(() => {
  stallText = !both.every((watch) => watch.loaded);
  update();
}, SLOW_MS);
setInterval(() => outbox.report("alive", null, { at_ms: sincePaint() }), ALIVE_MS);
addEventListener("pageshow", (event) => {
  if (event.persisted) location.reload();
});
outbox.resume();
