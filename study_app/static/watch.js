// @ts-check
/**
 * Watches one clip being watched. `ended` proves nothing, as seeking to the end fires it; what counts
 * is the union of played stretches, at normal speed, in a visible page, in about real time.
 */

const COVERED = 0.95;
const WALL = 0.9;
const LOADING = 2; // HTMLMediaElement.NETWORK_LOADING

/** Length of the union of stretches. @param {[number, number][]} stretches begin and end in seconds */
export function unionSeconds(stretches) {
  let total = 0;
  let reached = 0;
  for (const [begin, end] of [...stretches].sort((a, b) => a[0] - b[0])) {
    total += Math.max(0, end - Math.max(begin, reached));
    reached = Math.max(reached, end);
  }
  return total;
}

export class ClipWatch {
  /**
   * @param {HTMLVideoElement} video
   * @param {(kind: string, detail: object) => void} report
   * @param {{changed: () => void, failed: () => void, hidden: () => void}} page
   */
  constructor(video, report, page) {
    this.video = video;
    this.report = report;
    this.page = page;
    this.plays = 0;
    this.seen = false;
    this.spoiled = false;
    this.held = false;
    this.stalls = 0;
    this.wallMs = 0;
    this.startedAt = 0;
    this.fastest = 1;
    this.stretches = /** @type {[number, number][]} */ ([]); // of this view, closed by seeking
    this.begin = 0;
    this.position = 0;
    this.listen();
  }

  get playing() {
    return this.held || (!this.video.paused && !this.video.ended);
  }

  get loaded() {
    return this.video.readyState >= 4 || this.plays > 0;
  }

  get duration() {
    return this.video.duration || Number(this.video.dataset.duration);
  }

  covered() {
    return Math.min(1, unionSeconds([...this.stretches, [this.begin, this.position]]) / this.duration);
  }

  dropped() {
    return this.video.getVideoPlaybackQuality?.().droppedVideoFrames ?? null;
  }

  listen() {
    const on = (name, handler) => this.video.addEventListener(name, handler);
    on("canplaythrough", () => this.page.changed());
    on("timeupdate", () => this.moved());
    on("seeking", () => this.jumped());
    on("ratechange", () => this.fast());
    on("waiting", () => this.stalled());
    on("pause", () => this.addWall());
    on("ended", () => this.complete());
    on("error", () => this.error());
    document.addEventListener("visibilitychange", () => this.visibility());
    if (this.video.error) queueMicrotask(() => this.error()); // it failed before this script ran
  }

  /** Resolves when the clip can run to its end, so that two clips start in step. */
  ready() {
    if (this.video.readyState >= 4) return Promise.resolve();
    if (this.video.networkState !== LOADING) this.video.load(); // some browsers wait for a gesture
    return new Promise((resolve, reject) => {
      this.video.addEventListener("canplaythrough", resolve, { once: true });
      this.video.addEventListener("error", reject, { once: true });
    });
  }

  async play() {
    this.stop();
    this.video.playbackRate = 1;
    this.video.currentTime = 0;
    this.fastest = 1;
    this.wallMs = 0;
    this.spoiled = document.hidden;
    this.stretches = [];
    this.begin = this.position = 0;
    await this.video.play(); // fails where the browser blocks it: that was no view
    this.plays += 1;
    this.startedAt = performance.now();
    this.report("play", { view: this.plays });
    this.page.changed();
  }

  stop() {
    this.held = false;
    if (this.playing) this.video.pause();
  }

  /** Wait for the other clip; this view goes on afterwards. */
  hold() {
    this.held = true;
    this.video.pause();
  }

  async release() {
    if (!this.held) return;
    this.held = false;
    await this.video.play().then(
      () => (this.startedAt = performance.now()),
      () => null // stopped meanwhile
    );
  }

  moved() {
    if (!this.video.seeking) this.position = this.video.currentTime;
    this.page.changed();
  }

  /** What lay between the last known position and the new one was not seen. */
  jumped() {
    this.stretches.push([this.begin, this.position]);
    this.begin = this.position = this.video.currentTime;
  }

  addWall() {
    if (this.startedAt) this.wallMs += performance.now() - this.startedAt;
    this.startedAt = 0;
  }

  complete() {
    this.addWall();
    this.position = this.video.currentTime;
    const proof = {
      view: this.plays,
      covered: Math.round(1000 * this.covered()) / 1000,
      rate: this.fastest,
      hidden: this.spoiled,
      wall_ms: Math.round(this.wallMs),
    };
    const sound = proof.covered >= COVERED && proof.rate === 1 && !proof.hidden;
    this.seen ||= sound && proof.wall_ms >= 1000 * WALL * this.duration;
    this.report("complete", { ...proof, dropped: this.dropped() });
    this.page.changed();
  }

  fast() {
    this.fastest = Math.max(this.fastest, this.video.playbackRate);
  }

  stalled() {
    if (!this.playing) return;
    this.stalls += 1;
    this.report("stall", { view: this.plays, clip_ms: Math.round(1000 * this.video.currentTime) });
  }

  visibility() {
    if (document.hidden && this.playing) {
      this.spoiled = true;
      this.stop();
      this.report("hidden", { view: this.plays });
    } else if (!document.hidden && this.spoiled) {
      this.page.hidden();
    }
  }

  error() {
    this.report("error", { code: this.video.error?.code ?? null });
    this.page.failed();
  }
}
