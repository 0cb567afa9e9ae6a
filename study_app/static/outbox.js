// @ts-check
/**
 * Sends reports and the answer; keeps trying while the line is down. Every item carries its own
 * UUID and the server stores each once, so that sending twice is harmless.
 */

const RETRY_MS = 2000;
const LONGEST_RETRY_MS = 15_000;
const BATCH = 50;
const NOTABLE_WAIT_MS = 20;

export class Outbox {
  /** @param {{events: string, answer: string, csrf: string, trial: string, onOffline: () => void, onAnswered: (next: string) => void}} options */
  constructor(options) {
    this.options = options;
    this.waiting = /** @type {{uuid: string, kind: string, position: string | null, detail: object, since: number}[]} */ ([]);
    this.sending = false;
    this.posting = false;
    this.delay = RETRY_MS;
    this.key = `answer-${options.trial}`;
    addEventListener("online", () => void this.flush());
  }

  /** Queue a report and send it at once: the server's clock is part of the proof. */
  report(kind, position, detail) {
    this.waiting.push({ uuid: uuid(), kind, position, detail, since: performance.now() });
    void this.flush();
  }

  /** Send the answer until it is stored. It survives a reload in the tab's own storage. */
  answer(body) {
    sessionStorage.setItem(this.key, JSON.stringify(body));
    this.sending = true;
    void this.send(body);
  }

  /** Send an answer that was on its way when the page was reloaded. */
  resume() {
    const kept = sessionStorage.getItem(this.key);
    if (kept) {
      this.sending = true;
      void this.send(JSON.parse(kept));
    }
  }

  async flush() {
    if (this.posting || this.waiting.length === 0) return;
    this.posting = true;
    const batch = this.waiting.slice(0, BATCH);
    // A report that waited for an earlier one to leave reaches the server's clock late by that much.
    const events = batch.map(({ since, ...event }) => {
      const waited = Math.round(performance.now() - since);
      return waited < NOTABLE_WAIT_MS ? event : { ...event, detail: { ...event.detail, waited_ms: waited } };
    });
    try {
      const reply = await this.post(this.options.events, { events });
      await reply.text(); // an unread reply would be cut off when the page is left
      if (reply.status >= 500 || reply.status === 429) throw new Error("server is away");
      this.waiting.splice(0, batch.length);
    } catch {
      // Sent late, these reports cannot be timed by the server: they say so themselves.
      for (const event of this.waiting) event["detail"] = { ...event["detail"], queued: true };
      setTimeout(() => void this.flush(), RETRY_MS);
      return;
    } finally {
      this.posting = false;
    }
    if (this.waiting.length) void this.flush();
  }

  async send(body) {
    await this.drain();
    try {
      const reply = await this.post(this.options.answer, body);
      if (reply.status >= 500 || reply.status === 429) throw new Error("server is away");
      const { next } = await reply.json(); // a reply that is not ours (a hotel's login page) is no reply
      sessionStorage.removeItem(this.key);
      if (reply.ok) this.options.onAnswered(next);
      else location.reload();
    } catch {
      this.options.onOffline();
      setTimeout(() => void this.send(body), this.delay);
      this.delay = Math.min(LONGEST_RETRY_MS, this.delay * 2);
    }
  }

  /** Give the reports a moment to leave before the answer, which the server judges by them. */
  async drain() {
    for (let i = 0; i < 20 && (this.waiting.length || this.posting); i += 1) {
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
  }

  post(url, body) {
    return fetch(url, {
      method: "POST",
      headers: { "Content-Type": "application/json", "X-CSRFToken": this.options.csrf },
      body: JSON.stringify(body),
    });
  }
}

/** A random UUID; `crypto.randomUUID` exists on secure origins only. */
export function uuid() {
  if (crypto.randomUUID) return crypto.randomUUID();
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  bytes[6] = (bytes[6] & 0x0f) | 0x40;
  bytes[8] = (bytes[8] & 0x3f) | 0x80;
  const hex = [...bytes].map((byte) => byte.toString(16).padStart(2, "0")).join("");
  return [hex.slice(0, 8), hex.slice(8, 12), hex.slice(12, 16), hex.slice(16, 20), hex.slice(20)].join("-");
}
