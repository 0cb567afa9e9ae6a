// A body as a mesh: posed by its skin, painted with contact and penetration.
import {
  Box3, BufferAttribute, BufferGeometry, Color, DynamicDrawUsage, Group, Mesh,
  MeshStandardMaterial, Points, PointsMaterial, Vector3,
} from "three";

export const CONTACT = new Color("#00a878");
export const SHALLOW = new Color("#ff9d2e");
export const DEEP = new Color("#d40032");
export const DEEP_MM = 60; // the ramp of penetration ends here
const PALE = new Color(0.5, 0.51, 0.53); // the body under the overlay, so that marks stand out

export class Body {
  constructor(skin, marks, about) {
    Object.assign(this, { skin, marks, key: about.key, label: about.label, about });
    this.base = new Color().setRGB(...skin.colour);
    this.geometry = new BufferGeometry();
    this.geometry.setIndex(new BufferAttribute(skin.indices, 1));
    this.geometry.setAttribute("position", dynamic(skin.positions));
    this.geometry.setAttribute("normal", dynamic(skin.normals));
    this.geometry.setAttribute("color", dynamic(new Float32Array(3 * skin.count)));
    this.solid = new MeshStandardMaterial({ vertexColors: true, roughness: 0.85, metalness: 0 });
    this.ghost = new MeshStandardMaterial({
      color: "#8a93a0", roughness: 1, transparent: true, opacity: 0.3, depthWrite: false,
      polygonOffset: true, polygonOffsetFactor: 6, polygonOffsetUnits: 40, // gives way where bodies coincide
    });
    this.mesh = new Mesh(this.geometry, this.solid);
    this.mesh.frustumCulled = false;
    this.mesh.castShadow = this.mesh.receiveShadow = true;
    this.dots = makeDots();
    this.group = new Group();
    this.group.add(this.mesh, this.dots);
    this.box = new Box3();
    this.role = "hidden";
  }

  /** "shown", "ghost" or "hidden". */
  setRole(role) {
    this.role = role;
    this.group.visible = role !== "hidden";
    this.mesh.material = role === "ghost" ? this.ghost : this.solid;
    this.mesh.castShadow = role === "shown";
  }

  /** Pose for a position in frames and paint for its whole frame. */
  update(exact, frame, overlay) {
    if (this.role === "hidden") return;
    const { skin, geometry } = this;
    skin.pose(exact);
    geometry.attributes.position.needsUpdate = true;
    geometry.attributes.normal.needsUpdate = true;
    const [x0, y0, z0, x1, y1, z1] = skin.bounds;
    this.box.set(new Vector3(x0, y0, z0), new Vector3(x1, y1, z1));
    if (this.role === "shown") this.#paint(frame, overlay);
    this.dots.visible = this.role === "shown" && overlay;
  }

  #paint(frame, overlay) {
    const colours = this.geometry.attributes.color;
    const plain = overlay ? PALE : this.base;
    for (let i = 0; i < colours.array.length; i += 3) plain.toArray(colours.array, i);
    let count = 0;
    if (overlay) {
      const [points, shades] = [this.dots.geometry.attributes.position, this.dots.geometry.attributes.color];
      const limit = points.count;
      this.marks.visit(frame, (vertex, depth) => {
        const colour = markColour(depth);
        colour.toArray(colours.array, 3 * vertex);
        if (count < limit) {
          for (let axis = 0; axis < 3; axis++) points.array[3 * count + axis] = this.skin.positions[3 * vertex + axis];
          colour.toArray(shades.array, 3 * count);
          count += 1;
        }
      });
      points.needsUpdate = shades.needsUpdate = true;
    }
    this.dots.geometry.setDrawRange(0, count);
    colours.needsUpdate = true;
  }

  /** Colour of a vertex as drawn, for tests: [r, g, b] linear. */
  colour(vertex) {
    return [...this.geometry.attributes.color.array.subarray(3 * vertex, 3 * vertex + 3)];
  }
}

/** Green for contact; from orange to red with the depth of penetration in millimetres. */
export function markColour(depthMm) {
  if (depthMm <= 0) return CONTACT;
  return SHALLOW.clone().lerp(DEEP, Math.min(1, depthMm / DEEP_MM));
}

/** Dots over the marked vertices that shine through whatever hides them. */
function makeDots(limit = 20000) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", dynamic(new Float32Array(3 * limit)));
  geometry.setAttribute("color", dynamic(new Float32Array(3 * limit)));
  const material = new PointsMaterial({
    size: 2.5, sizeAttenuation: false, vertexColors: true, transparent: true, opacity: 0.45, depthTest: false,
    depthWrite: false,
  });
  const dots = new Points(geometry, material);
  dots.frustumCulled = false;
  dots.renderOrder = 10;
  return dots;
}

function dynamic(array) {
  return new BufferAttribute(array, 3).setUsage(DynamicDrawUsage);
}
