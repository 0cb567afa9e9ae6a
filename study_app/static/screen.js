// @ts-check
/** The look at the screen before a study begins: large enough, and able to play the clips? */

const form = /** @type {HTMLFormElement} */ (document.getElementById("screen"));
const message = /** @type {HTMLElement} */ (document.getElementById("screen-message"));
const begin = /** @type {HTMLButtonElement} */ (form.querySelector("button"));

/** @returns {string} why the study cannot begin here, or nothing */
function obstacle() {
  const { minWidth, minHeight, small = "", noVideo = "" } = form.dataset;
  if (!document.createElement("video").canPlayType('video/mp4; codecs="avc1.42E01E"')) return noVideo;
  const tooSmall = innerWidth < Number(minWidth) || innerHeight < Number(minHeight);
  if (!tooSmall) return "";
  const values = { width: innerWidth, height: innerHeight, min_width: minWidth, min_height: minHeight };
  return Object.entries(values).reduce((text, [name, value]) => text.replace(`{${name}}`, String(value)), small);
}

function check() {
  const reason = obstacle();
  message.textContent = reason;
  message.hidden = reason === "";
  begin.disabled = reason !== "";
  form.elements["width"].value = Math.round(innerWidth);
  form.elements["height"].value = Math.round(innerHeight);
}

addEventListener("resize", check);
check();
