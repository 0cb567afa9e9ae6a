// The room: its glTF as meshes, grouped so that walls and tall furniture can leave the view.
import {
  Box3, BufferAttribute, BufferGeometry, DoubleSide, Group, Mesh, MeshLambertMaterial, Raycaster, RepeatWrapping,
  SRGBColorSpace, Texture, Vector3,
} from "three";

export const WALL_MODES = ["cutaway", "xray", "solid"];
const XRAY_OPACITY = { wall: 0.14, thing: 0.3 };
const [TALL, AT_WALL] = [1.15, 0.15]; // metres, as in the clips
const ROUND_EYE = 0.1; // metres: a wall this close to the eye counts as in front of the room

export class Room {
  static async read(glb, manifest) {
    const textures = await Promise.all((glb.json.images ?? []).map((_, index) => readTexture(glb.image(index))));
    return new Room(glb, manifest, textures);
  }

  constructor(glb, manifest, textures) {
    this.size = manifest.room_size;
    this.group = new Group();
    this.groups = [];
    this.mode = "cutaway";
    const solid = glb.json.materials.map((material) => roomMaterial(material, textures));
    const [wallXray, thingXray] = ["wall", "thing"].map((kind) => solid.map((material) => seeThrough(material, kind)));
    const outside = solid.map((material) => occluded(Object.assign(material.clone(), { side: DoubleSide })));
    for (const index of glb.json.nodes[0].children) {
      const node = glb.json.nodes[index];
      const group = new Group();
      group.name = node.name;
      const xray = node.extras.wall === null ? thingXray : wallXray;
      for (const child of node.children) {
        const part = glb.json.nodes[child];
        const primitive = glb.json.meshes[part.mesh].primitives[0];
        const mesh = new Mesh(readGeometry(glb, primitive), solid[primitive.material]);
        mesh.name = part.name;
        mesh.userData = {
          solid: solid[primitive.material],
          xray: xray[primitive.material],
          outside: outside[primitive.material],
          open: mesh.geometry.attributes.occlusion.array.slice(),
          released: new Map((part.extras?.released ?? []).map((name, n) => [
            name, glb.accessor(primitive.attributes[`_RELEASED_${n}`]).array])),
        };
        mesh.castShadow = !manifest.light.no_shadow_from.includes(node.name);
        mesh.receiveShadow = true;
        group.add(mesh);
      }
      group.userData = { wall: node.extras.wall, tall: node.name.startsWith("object:"), box: new Box3().setFromObject(group) };
      this.groups.push(group);
      this.group.add(group);
    }
  }

  /** Show, fade or hide the groups for this eye; `body` is the box of the shown body. */
  update(eye, body) {
    const shut = this.#wallsInFront(eye);
    for (const group of this.groups) {
      const { wall, tall, box } = group.userData;
      const touched = box.intersectsBox(body);
      const away = wall === null ? tall && !touched && this.#standsAt(shut, box) : shut.has(wall);
      group.visible = this.mode === "solid" || !away;
      const fades = this.mode === "xray"
        ? group.name !== "floor"
        : this.mode === "cutaway" && group.visible && tall && !touched && hides(eye, body, group);
      // The shell has no backs; asked for solid walls, it shows them from outside too.
      const kind = fades ? "xray" : this.mode === "solid" && wall !== null ? "outside" : "solid";
      for (const mesh of group.children) mesh.material = mesh.userData[kind];
    }
    this.#relight();
  }

  /** Where furniture is hidden, no dark patch stays behind. */
  #relight() {
    const gone = this.groups.filter((group) => !group.visible).map((group) => group.name);
    if (gone.join() === this.gone) return;
    this.gone = gone.join();
    for (const mesh of this.groups.flatMap((group) => group.children)) {
      const gained = gone.filter((name) => mesh.userData.released.has(name)).map((name) => mesh.userData.released.get(name));
      if (gained.length === 0 && !mesh.userData.relit) continue;
      mesh.userData.relit = gained.length > 0;
      const occlusion = mesh.geometry.attributes.occlusion;
      mesh.userData.open.forEach((open, i) => {
        occlusion.array[i] = Math.min(255, gained.reduce((sum, values) => sum + values[i], open));
      });
      occlusion.needsUpdate = true;
    }
  }

  /** Whether tall furniture stands with its back to one of these walls: with the wall gone it would hide the room. */
  #standsAt(walls, box) {
    const [width, depth] = this.size;
    const gap = { n: depth - box.max.y, s: box.min.y, e: width - box.max.x, w: box.min.x };
    return box.max.z > TALL && [...walls].some((wall) => gap[wall] < AT_WALL);
  }

  #wallsInFront(eye) {
    const [width, depth] = this.size;
    const beyond = { n: eye.y - depth, s: -eye.y, e: eye.x - width, w: -eye.x };
    return new Set(Object.keys(beyond).filter((wall) => beyond[wall] > -ROUND_EYE));
  }
}

/** Whether a group really stands between the eye and two or more of five points up the body's middle. */
function hides(eye, body, group) {
  if (body.isEmpty()) return false;
  const middle = body.getCenter(new Vector3());
  let blocked = 0;
  for (const share of [0.1, 0.3, 0.5, 0.7, 0.9]) {
    const target = new Vector3(middle.x, middle.y, body.min.z + share * (body.max.z - body.min.z));
    const caster = new Raycaster(eye, target.clone().sub(eye).normalize(), 0, eye.distanceTo(target));
    const near = caster.ray.intersectsBox(group.userData.box);
    if (near && caster.intersectObjects(group.children, false).length > 0) blocked += 1;
  }
  return blocked >= 2;
}

async function readTexture(blob) {
  const texture = new Texture(await createImageBitmap(blob));
  texture.flipY = false; // glTF images start at the top
  texture.wrapS = texture.wrapT = RepeatWrapping;
  texture.colorSpace = SRGBColorSpace;
  texture.anisotropy = 8;
  texture.needsUpdate = true;
  return texture;
}

function readGeometry(glb, primitive) {
  const names = { POSITION: "position", NORMAL: "normal", COLOR_0: "color", TEXCOORD_0: "uv", _OCCLUSION: "occlusion" };
  const geometry = new BufferGeometry();
  for (const [name, index] of Object.entries(primitive.attributes)) {
    if (!(name in names)) continue;
    const { array, width, normalized } = glb.accessor(index);
    geometry.setAttribute(names[name], new BufferAttribute(array, width, normalized));
  }
  geometry.setIndex(new BufferAttribute(glb.accessor(primitive.indices).array, 1));
  return geometry;
}

function roomMaterial(described, textures) {
  const image = described.pbrMetallicRoughness.baseColorTexture;
  const map = image ? textures[image.index] : null;
  return occluded(new MeshLambertMaterial({ vertexColors: true, map }));
}

function seeThrough(material, kind) {
  const faded = occluded(material.clone());
  Object.assign(faded, { transparent: true, opacity: XRAY_OPACITY[kind], depthWrite: false });
  return faded;
}

/** Baked occlusion dims the light that comes from everywhere, not the lamp's; backs that stood at a wall stay readable. */
function occluded(material) {
  material.onBeforeCompile = (shader) => {
    shader.vertexShader = shader.vertexShader
      .replace("#include <common>", "#include <common>\nattribute float occlusion;\nvarying float vOpen;")
      .replace("#include <begin_vertex>", "#include <begin_vertex>\nvOpen = occlusion;");
    shader.fragmentShader = shader.fragmentShader
      .replace("#include <common>", "#include <common>\nvarying float vOpen;")
      .replace("#include <aomap_fragment>", "reflectedLight.indirectDiffuse *= max(vOpen, 0.25);");
  };
  return material;
}
