// @ts-check
/**
 * Keeps two clips that play together in step. The one ahead waits: a change of speed would spoil the
 * proof of viewing, and a jump would leave a stretch unseen.
 */

export const TOLERANCE_S = 0.05; // about one frame at 20 to 30 frames a second

/**
 * Which clip must wait: its index, or -1.
 * @param {number[]} times present positions in seconds
 * @param {number} waiting index of the clip that waits already, or -1
 */
export function ahead(times, waiting) {
  const lead = times[0] - times[1];
  if (waiting >= 0) return (waiting === 0 ? lead : -lead) > TOLERANCE_S / 2 ? waiting : -1;
  return Math.abs(lead) > TOLERANCE_S ? Number(lead < 0) : -1;
}

/**
 * Look once a painted frame, until one of the clips has ended or was stopped.
 * @param {import("./watch.js").ClipWatch[]} watches two clips that were just started
 * @param {(look: () => void) => void} later
 */
export function keepInStep(watches, later = (look) => void requestAnimationFrame(look)) {
  const views = watches.map((watch) => watch.plays);
  let waiting = -1;
  const look = () => {
    const alive = watches.every((watch, i) => watch.playing && watch.plays === views[i]);
    const next = alive ? ahead(watches.map((watch) => watch.video.currentTime), waiting) : -1;
    if (next !== waiting) {
      if (waiting >= 0) void watches[waiting].release();
      if (next >= 0) watches[next].hold();
      waiting = next;
    }
    if (alive) later(look);
  };
  later(look);
}
