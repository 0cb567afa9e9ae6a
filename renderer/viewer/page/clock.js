// The one clock of all bodies: a position in frames that plays, stops, steps and loops.

export class Clock {
  /** @param {number} frames @param {number} fps @param {() => number} now seconds */
  constructor(frames, fps, now = () => performance.now() / 1000) {
    Object.assign(this, { frames, fps, now, speed: 1, playing: false });
    this.position = 0;
    this.listeners = new Set();
  }

  /** The whole frame that is shown. */
  get frame() {
    return Math.min(this.frames - 1, Math.floor(this.position + 1e-6));
  }

  /** Where the bodies stand: between frames while playing, never beyond the last. */
  get exact() {
    return Math.min(this.position, this.frames - 1);
  }

  play() {
    if (this.playing) return;
    this.playing = true;
    this.last = this.now();
    this.#tell();
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.position = this.frame;
    this.#tell();
  }

  toggle() {
    if (this.playing) this.pause();
    else this.play();
  }

  /** Stop and go to a whole frame; beyond the ends is at the ends. */
  seek(frame) {
    this.playing = false;
    this.position = Math.max(0, Math.min(this.frames - 1, Math.round(frame)));
    this.#tell();
  }

  step(frames) {
    this.seek(this.frame + frames);
  }

  /** Let time pass; returns whether the position moved. The last frame lasts as long as any other. */
  tick() {
    if (!this.playing) return false;
    const now = this.now();
    this.position = (this.position + (now - this.last) * this.fps * this.speed) % this.frames;
    this.last = now;
    this.#tell();
    return true;
  }

  onChange(listener) {
    this.listeners.add(listener);
  }

  #tell() {
    for (const listener of this.listeners) listener(this);
  }
}
