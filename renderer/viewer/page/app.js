// The page: puts clock, room, bodies and camera together and listens to buttons and keys.
import { Box3, Vector3 } from "three";
import { readGlb } from "./glb.js";
import { Skin } from "./skin.js";
import { Marks } from "./marks.js";
import { Clock } from "./clock.js";
import { Room, WALL_MODES } from "./room.js";
import { Body } from "./body.js";
import { Stage } from "./stage.js";
import { drawGraph } from "./graph.js";

const byId = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];

export async function startViewer(manifest, data) {
  const viewer = new Viewer(manifest, data);
  await viewer.start();
  Object.assign(window.paceViewer, viewer.hook());
}

class Viewer {
  constructor(manifest, data) {
    Object.assign(this, { manifest, data });
    this.clock = new Clock(manifest.n_frames, manifest.fps);
    this.bodies = manifest.bodies.map((about) => this.#readBody(about));
    [this.shown, this.view] = [0, 0];
    Object.assign(this, { overlay: false, ghosts: false, follow: false });
  }

  #readBody(about) {
    const skin = new Skin(readGlb(this.data.get(about.key)));
    if (skin.frames !== this.manifest.n_frames) throw new Error(`data/${about.key}.js belongs to another page.`);
    return new Body(skin, new Marks(skin.marks, skin.frames, this.manifest.tolerance_mm), about);
  }

  async start() {
    this.stage = makeStage(this.manifest);
    this.room = await Room.read(readGlb(this.data.get("room")), this.manifest);
    this.data.clear();
    this.stage.scene.add(this.room.group, ...this.bodies.map((body) => body.group));
    byId("no-bodies").hidden = this.bodies.length > 0;
    this.#listen();
    this.#readAddress();
    this.#setTheme();
    this.show(this.shown);
    this.stage.resize(byId("view").clientWidth, byId("view").clientHeight);
    this.look(this.view);
    this.#draw();
    const loop = () => {
      this.clock.tick();
      this.stage.controls.update();
      if (this.stage.dirty) this.#draw();
      requestAnimationFrame(loop);
    };
    requestAnimationFrame(loop);
  }

  // What can be done -------------------------------------------------------------------------

  show(index) {
    if (!this.bodies[index]) return;
    this.shown = index;
    this.bodies.forEach((body, i) => body.setRole(i === index ? "shown" : this.ghosts ? "ghost" : "hidden"));
    all("#methods input").forEach((input, i) => (input.checked = i === index));
    const body = this.bodies[index];
    const deepest = Math.max(...this.bodies.map((each) => Math.max(...each.marks.depths)));
    const most = Math.max(...this.bodies.map((each) => Math.max(...each.marks.contacts)));
    drawGraph(byId("graph"), body.marks, deepest, most);
    this.#tellClip(body);
    this.refresh();
  }

  setGhosts(on) {
    this.ghosts = on;
    byId("ghosts").setAttribute("aria-pressed", on);
    this.show(this.shown);
  }

  setOverlay(on) {
    this.overlay = on;
    byId("overlay").setAttribute("aria-pressed", on);
    byId("legend").hidden = !on;
    this.refresh();
  }

  setWalls(mode) {
    this.room.mode = mode;
    all("#walls input").forEach((input) => (input.checked = input.value === mode));
    this.stage.dirty = true;
  }

  setFollow(on) {
    this.follow = on;
    this.lastCentre = null;
    byId("follow").setAttribute("aria-pressed", on);
    if (on) this.#keepBodyCentred(true);
    this.refresh();
  }

  /** The first view of the clips; a page without any frames the whole room. */
  resetView() {
    this.look(0);
  }

  look(index) {
    const { views, room_size: [width, depth, height] } = this.manifest;
    this.view = index;
    if (this.follow) this.setFollow(false);
    if (views[index]) {
      this.stage.look(new Vector3(...views[index].eye), new Vector3(...views[index].target));
    } else {
      this.stage.frame(new Box3(new Vector3(0, 0, 0), new Vector3(width, depth, Math.min(height, 1.8))));
    }
  }

  /** Pose, paint and draw again at the next chance. */
  refresh() {
    this.stage.dirty = true;
    this.stale = true;
  }

  // Drawing ------------------------------------------------------------------------------------

  #draw() {
    const { exact, frame } = this.clock;
    if (this.stale) {
      for (const body of this.bodies) body.update(exact, frame, this.overlay);
      this.#tellFrame(frame);
      this.stale = false;
    }
    if (this.follow) this.#keepBodyCentred(false);
    const shown = this.bodies[this.shown];
    this.room.update(this.stage.camera.position, shown ? shown.box : new Box3());
    this.stage.draw();
  }

  #keepBodyCentred(jump) {
    const body = this.bodies[this.shown];
    if (!body || body.box.isEmpty()) return;
    const centre = body.box.getCenter(new Vector3());
    const from = jump || !this.lastCentre ? this.stage.controls.target : this.lastCentre;
    this.stage.shift(centre.clone().sub(from));
    this.lastCentre = centre;
  }

  #tellFrame(frame) {
    const { fps, n_frames: frames } = this.manifest;
    const seconds = (value) => `${(value / fps).toFixed(2)} s`;
    byId("time").textContent = `${seconds(frame)} of ${seconds(frames)}`;
    byId("frame").textContent = `Frame ${frame + 1} / ${frames}`;
    if (document.activeElement !== byId("scrub") || this.clock.playing) byId("scrub").value = frame;
    byId("scrub").setAttribute("aria-valuetext", `frame ${frame + 1} of ${frames}`);
    byId("cursor").setAttribute("x", ((1000 * (frame + 0.5)) / frames - 1).toFixed(1));
    const body = this.bodies[this.shown];
    const now = body?.marks.at(frame) ?? { contacts: 0, penetrations: 0, depthMm: 0 };
    byId("now-contacts").textContent = now.contacts.toLocaleString("en");
    byId("now-penetrations").textContent = now.penetrations.toLocaleString("en");
    byId("now-depth").textContent = now.penetrations ? `${Math.round(now.depthMm)} mm` : "none";
  }

  #tellClip(body) {
    const clip = body.marks.clip();
    const percent = (share) => `${Math.round(100 * share)} %`;
    byId("clip-contact").textContent = percent(clip.contact);
    byId("clip-penetration").textContent = percent(clip.penetration);
    byId("clip-depth").textContent = clip.depthMm > 0 ? `${Math.round(clip.depthMm)} mm` : "none";
    byId("skin-error").textContent =
      `Drawn skin within ${body.about.error_p99_mm.toFixed(2)} mm of the body model at 99 % of its vertices, `
      + `${body.about.error_max_mm.toFixed(2)} mm at all.`;
    byId("model-link").href = `models/${body.key}.glb`;
  }

  // Input --------------------------------------------------------------------------------------

  #listen() {
    const { clock } = this;
    clock.onChange(() => {
      byId("play").setAttribute("aria-pressed", clock.playing);
      byId("play-label").textContent = clock.playing ? "Pause" : "Play";
      byId("play").dataset.playing = clock.playing;
      this.refresh();
    });
    const press = (id, act) => byId(id).addEventListener("click", act);
    press("play", () => clock.toggle());
    press("back", () => clock.step(-1));
    press("forward", () => clock.step(1));
    press("overlay", () => this.setOverlay(!this.overlay));
    press("ghosts", () => this.setGhosts(!this.ghosts));
    press("follow", () => this.setFollow(!this.follow));
    press("reset", () => this.resetView());
    all("#views button").forEach((button, i) => button.addEventListener("click", () => this.look(i)));
    press("picture", () => this.#savePicture());
    byId("scrub").addEventListener("input", (event) => clock.seek(Number(event.target.value)));
    byId("speed").addEventListener("change", (event) => (clock.speed = Number(event.target.value)));
    all("#methods input").forEach((input, i) => input.addEventListener("change", () => this.show(i)));
    all("#walls input").forEach((input) => input.addEventListener("change", () => this.setWalls(input.value)));
    document.addEventListener("keydown", (event) => this.#onKey(event));
    new ResizeObserver(([entry]) => this.stage.resize(entry.contentRect.width, entry.contentRect.height)).observe(byId("view"));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#setTheme());
    byId("canvas").addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      window.paceViewerFail("The picture was lost", "The browser gave up the 3D canvas. Load the page again.");
    });
  }

  #onKey(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select")) return;
    const onInput = event.target.matches("input");
    const stride = event.shiftKey ? 10 : 1;
    const keys = {
      " ": () => this.clock.toggle(),
      ArrowLeft: () => this.clock.step(-stride),
      ArrowRight: () => this.clock.step(stride),
      Home: () => this.clock.seek(0),
      End: () => this.clock.seek(this.clock.frames - 1),
      c: () => this.setOverlay(!this.overlay),
      g: () => this.setGhosts(!this.ghosts),
      f: () => this.setFollow(!this.follow),
      r: () => this.resetView(),
      v: () => this.look((this.view + 1) % Math.max(1, this.manifest.views.length)),
      x: () => this.setWalls(WALL_MODES[(WALL_MODES.indexOf(this.room.mode) + 1) % WALL_MODES.length]),
    };
    const digit = /^[1-9]$/.test(event.key) ? () => this.show(Number(event.key) - 1) : null;
    const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key] ?? digit;
    // Arrows on a radio group choose, the space bar on a button presses: the browser's own work.
    const browserKeys = event.target.matches("button, summary, a") ? [" "] : onInput && event.target.type === "radio"
      ? ["ArrowLeft", "ArrowRight"] : [];
    if (!act || browserKeys.includes(event.key)) return;
    event.preventDefault();
    act();
  }

  /** `index.html#method=pace&frame=30&walls=xray&overlay=1` opens the page at one place. */
  #readAddress() {
    const wanted = new URLSearchParams(location.hash.slice(1));
    const index = this.bodies.findIndex((body) => body.key === wanted.get("method"));
    if (index >= 0) this.shown = index;
    if (/^\d+$/.test(wanted.get("frame") ?? "")) this.clock.seek(Number(wanted.get("frame")));
    if (WALL_MODES.includes(wanted.get("walls"))) this.setWalls(wanted.get("walls"));
    if (/^\d$/.test(wanted.get("view") ?? "")) this.view = Number(wanted.get("view"));
    if (wanted.get("overlay") === "1") this.setOverlay(true);
    if (wanted.get("ghosts") === "1") this.setGhosts(true);
  }

  #setTheme() {
    this.stage.setBackground(getComputedStyle(document.documentElement).getPropertyValue("--view").trim());
  }

  #savePicture() {
    this.#draw();
    byId("canvas").toBlob((blob) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(blob);
      const name = [this.manifest.scene, this.bodies[this.shown]?.key ?? "room", this.clock.frame + 1].join("_");
      link.download = `${name}.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
    });
  }

  // For tests and scripts ------------------------------------------------------------------------

  /** The documented programming interface, `window.paceViewer`. World frame: z up, metres. */
  hook() {
    const named = (key) => {
      const body = this.bodies.find((each) => each.key === key);
      if (!body) throw new Error(`no body "${key}" on this page`);
      return body;
    };
    return {
      vertex: (key, frame, vertex) => named(key).skin.vertex(frame, vertex),
      drawnVertex: (key, vertex) => [...named(key).skin.positions.subarray(3 * vertex, 3 * vertex + 3)],
      colour: (key, vertex) => named(key).colour(vertex),
      marks: (key, frame) => {
        const found = [];
        named(key).marks.visit(frame, (vertex, depthMm) => found.push([vertex, depthMm]));
        return found;
      },
      seek: (frame) => {
        this.clock.seek(frame);
        this.#draw();
      },
      state: () => ({
        method: this.bodies[this.shown]?.key ?? null,
        frame: this.clock.frame,
        playing: this.clock.playing,
        overlay: this.overlay,
        ghosts: this.ghosts,
        follow: this.follow,
        view: this.view,
        walls: this.room.mode,
        visible: this.room.groups.filter((group) => group.visible).map((group) => group.name),
        faded: this.room.groups
          .filter((group) => group.visible && group.children.some((mesh) => mesh.material === mesh.userData.xray))
          .map((group) => group.name),
        eye: this.stage.camera.position.toArray(),
        target: this.stage.controls.target.toArray(),
      }),
    };
  }
}

function makeStage(manifest) {
  try {
    return new Stage(byId("canvas"), manifest);
  } catch (error) {
    throw new Error(`This browser offers no WebGL 2, which 3D pictures need (${error.message}).`);
  }
}
