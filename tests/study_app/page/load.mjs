// The page's modules as node can load them, and stand-ins for the parts of a browser that they touch.
import { webcrypto } from "node:crypto";
import { readFileSync } from "node:fs";

globalThis.crypto ??= webcrypto; // node 18

/** Import a module of the page by its source: its folder need not say that it holds modules. */
export function load(name) {
  const url = new URL(`../../../study_app/static/${name}`, import.meta.url);
  return import(`data:text/javascript;base64,${readFileSync(url).toString("base64")}`);
}

/** A browser's clock, storage and document, wound by hand. */
export function browser() {
  const kept = new Map();
  const page = new EventTarget();
  Object.assign(globalThis, {
    document: Object.assign(page, { hidden: false }),
    addEventListener: () => null,
    sessionStorage: {
      getItem: (key) => kept.get(key) ?? null,
      setItem: (key, value) => kept.set(key, value),
      removeItem: (key) => kept.delete(key),
    },
  });
  return { kept, page };
}

/** A video element without pictures: time moves when the test says so. */
export class Video extends EventTarget {
  constructor(duration = 2) {
    super();
    Object.assign(this, { duration, currentTime: 0, playbackRate: 1, readyState: 4, networkState: 1 });
    Object.assign(this, { paused: true, ended: false, seeking: false, error: null, dataset: {} });
    this.loads = 0;
  }

  async play() {
    if (this.blocked) throw new DOMException("blocked", "NotAllowedError");
    [this.paused, this.ended] = [false, false];
  }

  pause() {
    this.paused = true;
    this.dispatchEvent(new Event("pause"));
  }

  load() {
    this.loads += 1;
  }

  /** Play on up to a position. */
  reach(seconds) {
    this.currentTime = seconds;
    this.dispatchEvent(new Event("timeupdate"));
    if (seconds >= this.duration) this.finish();
  }

  seek(seconds) {
    this.currentTime = seconds;
    this.dispatchEvent(new Event("seeking"));
  }

  finish() {
    [this.paused, this.ended] = [true, true];
    this.dispatchEvent(new Event("ended"));
  }
}
