// @ts-check
/** May the study begin on this screen, browser and line? If not, why. */

const LONGEST_MS = 5000;

/**
 * @typedef {{width: number, height: number, kbit: number | null, plays: boolean}} Found
 * @typedef {{min_width: number, min_height: number, min_kbit: number}} Wanted
 */

/**
 * The name of what stands in the way, or nothing. A line that could not be measured never does.
 * @param {Found} found
 * @param {Wanted} wanted
 * @returns {"noVideo" | "small" | "slow" | ""}
 */
export function obstacle(found, wanted) {
  if (!found.plays) return "noVideo";
  if (found.width < wanted.min_width || found.height < wanted.min_height) return "small";
  if (found.kbit !== null && found.kbit < wanted.min_kbit) return "slow";
  return "";
}

/** A text with its `{names}` replaced. @param {string} text @param {object} values */
export function fill(text, values) {
  return Object.entries(values).reduce((filled, [name, value]) => filled.replaceAll(`{${name}}`, String(value)), text);
}

/**
 * Kilobits a second over one download, delay included; null when it could not be measured.
 * @param {string} url
 * @returns {Promise<number | null>}
 */
export async function lineSpeed(url) {
  const began = performance.now();
  let [bytes, spent] = [0, 0];
  try {
    const reader = (await fetch(url, { cache: "no-store" })).body?.getReader();
    for (let part = await reader?.read(); part && !part.done; part = await reader?.read()) {
      bytes += part.value.length;
      spent = performance.now() - began;
      if (spent > LONGEST_MS) {
        void reader?.cancel();
        break;
      }
    }
  } catch {
    return null;
  }
  return bytes && spent ? Math.round((8 * bytes) / spent) : null;
}
