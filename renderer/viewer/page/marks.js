// Contact and penetration of one body: which vertices touch or lie inside something, frame by frame.
//
// Distances are tenths of a millimetre to the nearest surface, negative inside, computed before the page
// was written. Within the tolerance on both sides counts as contact, deeper inside as penetration.

export class Marks {
  constructor(stored, frames, toleranceMm) {
    this.starts = stored?.starts ?? new Uint32Array(frames + 1);
    this.vertices = stored?.vertices ?? new Uint16Array(0);
    this.distances = stored?.distances ?? new Int16Array(0);
    this.limit = 10 * toleranceMm;
    this.contacts = new Uint32Array(frames);
    this.penetrations = new Uint32Array(frames);
    this.depths = new Float64Array(frames); // deepest penetration, millimetres
    for (let frame = 0; frame < frames; frame++) this.#count(frame);
  }

  #count(frame) {
    for (let i = this.starts[frame]; i < this.starts[frame + 1]; i++) {
      const distance = this.distances[i];
      if (distance < -this.limit) {
        this.penetrations[frame] += 1;
        this.depths[frame] = Math.max(this.depths[frame], -distance / 10);
      } else {
        this.contacts[frame] += 1;
      }
    }
  }

  /** Call `visit(vertex, depthMm)` for every marked vertex; the depth of a contact is 0. */
  visit(frame, visit) {
    for (let i = this.starts[frame]; i < this.starts[frame + 1]; i++) {
      const distance = this.distances[i];
      visit(this.vertices[i], distance < -this.limit ? -distance / 10 : 0);
    }
  }

  /** Numbers of a frame. */
  at(frame) {
    return { contacts: this.contacts[frame], penetrations: this.penetrations[frame], depthMm: this.depths[frame] };
  }

  /** Numbers of the clip: share of frames with contact, with penetration, and the deepest of all. */
  clip() {
    const share = (counts) => counts.reduce((sum, count) => sum + (count > 0 ? 1 : 0), 0) / counts.length;
    return { contact: share(this.contacts), penetration: share(this.penetrations), depthMm: Math.max(...this.depths) };
  }
}
