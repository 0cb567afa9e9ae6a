// Camera, light and canvas. World frame: z up, metres. Draws only when something has changed.
import {
  Color, DirectionalLight, HemisphereLight, PCFShadowMap, PerspectiveCamera, Scene, SRGBColorSpace,
  Vector3, WebGLRenderer,
} from "three";
import { OrbitControls } from "./OrbitControls.js";

const FIELD_OF_VIEW = 32;

export class Stage {
  constructor(canvas, manifest) {
    this.manifest = manifest;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, 0.05, 200);
    this.camera.up.set(0, 0, 1);
    this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { enableDamping: true, dampingFactor: 0.12, minDistance: 0.4, maxDistance: 30 });
    this.controls.maxPolarAngle = 0.62 * Math.PI;
    this.dirty = true;
    this.controls.addEventListener("change", () => (this.dirty = true));
    this.#light();
  }

  #light() {
    const { light, room_size: size } = this.manifest;
    const centre = new Vector3(size[0] / 2, size[1] / 2, 0.8);
    const key = new DirectionalLight(new Color().setRGB(...light.key_colour), light.key_intensity);
    key.target.position.copy(centre);
    key.position.copy(centre).addScaledVector(new Vector3(...light.key_travels), -12);
    key.castShadow = true;
    key.shadow.mapSize.set(2048, 2048);
    const reach = Math.hypot(...size) / 2 + 0.5;
    Object.assign(key.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 1, far: 26 });
    Object.assign(key.shadow, { bias: -0.0004, normalBias: 0.015, radius: 3 });
    const sky = new HemisphereLight(new Color().setRGB(...light.sky), new Color().setRGB(...light.ground), Math.PI);
    sky.position.set(0, 0, 1);
    const fill = new DirectionalLight(new Color().setRGB(...light.fill_colour), Math.PI);
    fill.target.position.copy(centre);
    fill.position.copy(centre).addScaledVector(new Vector3(...light.fill_travels), -12);
    this.scene.add(key, key.target, sky, fill, fill.target);
  }

  setBackground(colour) {
    this.scene.background = new Color(colour);
    this.dirty = true;
  }

  /** Fit the canvas to its box on the page. */
  resize(width, height) {
    if (width < 1 || height < 1) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio || 1, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  /** Look at a box from a corner of the room so that it fills the picture. */
  frame(box, azimuthDegrees = -52, elevationDegrees = 30) {
    this.#stopTurning();
    const centre = box.getCenter(new Vector3());
    const radius = 0.5 * box.getSize(new Vector3()).length();
    const half = (FIELD_OF_VIEW * Math.PI) / 360;
    const narrow = Math.min(half, Math.atan(Math.tan(half) * this.camera.aspect));
    const [azimuth, elevation] = [azimuthDegrees, elevationDegrees].map((angle) => (angle * Math.PI) / 180);
    const back = new Vector3(
      Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation));
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(back, radius / Math.sin(narrow));
    this.controls.update();
    this.dirty = true;
  }

  /** Stand at an eye that was made for a picture of 16:9; a narrower picture stands further back. */
  look(eye, target) {
    this.#stopTurning();
    const back = Math.min(1.6, Math.max(1, 16 / 9 / this.camera.aspect));
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(eye.clone().sub(target), back);
    this.controls.update();
    this.dirty = true;
  }

  /** A turn that is still running out would carry the new view along. */
  #stopTurning() {
    this.controls.enableDamping = false;
    this.controls.update();
    this.controls.enableDamping = true;
  }

  /** Move eye and target together. */
  shift(by) {
    this.camera.position.add(by);
    this.controls.target.add(by);
    this.dirty = true;
  }

  draw() {
    this.renderer.render(this.scene, this.camera);
    this.dirty = false;
  }
}
