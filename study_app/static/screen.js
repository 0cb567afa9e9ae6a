// @ts-check
/** The look at window, browser and line before a study begins, with reasons where it cannot. */

import { fill, lineSpeed, obstacle } from "./check.js";

const form = /** @type {HTMLFormElement} */ (document.getElementById("screen"));
const message = /** @type {HTMLElement} */ (document.getElementById("screen-message"));
const begin = /** @type {HTMLButtonElement} */ (form.querySelector("button"));
const wanted = {
  min_width: Number(form.dataset.minWidth),
  min_height: Number(form.dataset.minHeight),
  min_kbit: Number(form.dataset.minKbit),
};
const plays = document.createElement("video").canPlayType('video/mp4; codecs="avc1.42E01E"') !== "";
let measuring = true;
let kbit = /** @type {number | null} */ (null);

function check() {
  const found = { width: Math.round(innerWidth), height: Math.round(innerHeight), kbit, plays };
  const reason = obstacle(found, wanted) || (measuring && wanted.min_kbit ? "measuring" : "");
  const text = fill(form.dataset[reason] ?? "", { ...found, ...wanted });
  if (message.textContent !== text) message.textContent = text;
  message.hidden = reason === "";
  begin.disabled = reason !== "";
  for (const name of ["width", "height", "kbit"]) form.elements[name].value = found[name] ?? "";
}

addEventListener("resize", check);
check();
void lineSpeed(form.dataset.lineUrl ?? "").then((speed) => {
  [kbit, measuring] = [speed, false];
  check();
});
