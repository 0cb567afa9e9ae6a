// Linear blend skinning of a glTF body on the processor, with any number of influences a vertex.
//
// World frame: z up, metres (the file's root node, which turns it for other viewers, is left out).
// What is drawn is what `vertex` tells: both come from `pose`.

export class Skin {
  constructor(glb) {
    const { json, accessor } = glb;
    const mesh = json.meshes[0];
    const { attributes, indices, material } = mesh.primitives[0];
    this.indices = accessor(indices).array;
    this.rest = accessor(attributes.POSITION).array;
    this.restNormals = accessor(attributes.NORMAL).array;
    this.colour = json.materials[material].pbrMetallicRoughness.baseColorFactor.slice(0, 3);
    this.count = this.rest.length / 3;
    this.#readJoints(json, accessor);
    this.#readInfluences(attributes, accessor);
    this.#readAnimation(json, accessor);
    this.positions = new Float32Array(3 * this.count);
    this.normals = new Float32Array(3 * this.count);
    this.marks = mesh.extras?.marks && Object.fromEntries(
      Object.entries(mesh.extras.marks).map(([name, index]) => [name, accessor(index).array]));
    this.bounds = [Infinity, Infinity, Infinity, -Infinity, -Infinity, -Infinity];
  }

  #readJoints(json, accessor) {
    const { joints, inverseBindMatrices } = json.skins[0];
    const order = new Map(joints.map((node, joint) => [node, joint]));
    const binds = accessor(inverseBindMatrices).array;
    this.names = joints.map((node) => json.nodes[node].name);
    this.parents = new Int32Array(joints.length).fill(-1);
    for (const [node, joint] of order) {
      for (const child of json.nodes[node].children ?? []) this.parents[order.get(child)] = joint;
    }
    this.offsets = Float64Array.from(joints.flatMap((node) => json.nodes[node].translation));
    this.binds = Float64Array.from(joints.flatMap((_, joint) => [12, 13, 14].map((i) => binds[16 * joint + i])));
    this.turn = new Float64Array(9 * joints.length); // world rotations, row by row
    this.place = new Float64Array(3 * joints.length); // world positions
    this.shift = new Float64Array(3 * joints.length); // place + turn * bind
    this.order = order;
  }

  /** Influences as rows of a sparse matrix: those of vertex v are [starts[v], starts[v + 1]). */
  #readInfluences(attributes, accessor) {
    const sets = [];
    for (let n = 0; `JOINTS_${n}` in attributes; n++) {
      sets.push([accessor(attributes[`JOINTS_${n}`]).array, accessor(attributes[`WEIGHTS_${n}`])]);
    }
    const [joint, weight] = [[], []];
    this.starts = new Uint32Array(this.count + 1);
    for (let v = 0; v < this.count; v++) {
      for (const [joints, { array, normalized }] of sets) {
        for (let i = 4 * v; i < 4 * v + 4; i++) {
          if (array[i] > 0) {
            joint.push(joints[i]);
            weight.push(normalized ? array[i] / 65535 : array[i]);
          }
        }
      }
      this.starts[v + 1] = joint.length;
    }
    this.joint = Uint16Array.from(joint);
    this.weight = Float64Array.from(weight);
  }

  #readAnimation(json, accessor) {
    const { samplers, channels } = json.animations[0];
    this.times = accessor(samplers[0].input).array;
    this.frames = this.times.length;
    this.rotations = new Map();
    for (const { sampler, target } of channels) {
      const values = accessor(samplers[sampler].output).array;
      if (target.path === "translation") this.root = values;
      else this.rotations.set(this.order.get(target.node), values);
    }
  }

  /** Fill `positions` and `normals` for a frame; between frames joints turn evenly. */
  pose(frame) {
    this.#poseJoints(frame);
    const { starts, joint, weight, rest, restNormals, turn, shift, positions, normals } = this;
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    for (let v = 0; v < this.count; v++) {
      const [x, y, z] = [rest[3 * v], rest[3 * v + 1], rest[3 * v + 2]];
      const [u, t, s] = [restNormals[3 * v], restNormals[3 * v + 1], restNormals[3 * v + 2]];
      for (let row = 0; row < 3; row++) {
        let [point, normal] = [0, 0];
        for (let i = starts[v]; i < starts[v + 1]; i++) {
          const r = 9 * joint[i] + 3 * row;
          point += weight[i] * (turn[r] * x + turn[r + 1] * y + turn[r + 2] * z + shift[3 * joint[i] + row]);
          normal += weight[i] * (turn[r] * u + turn[r + 1] * t + turn[r + 2] * s);
        }
        positions[3 * v + row] = point;
        normals[3 * v + row] = normal;
        low[row] = Math.min(low[row], point);
        high[row] = Math.max(high[row], point);
      }
    }
    this.bounds = [...low, ...high];
    return this;
  }

  /** World position of a vertex at a frame; the drawn pose is left alone. */
  vertex(frame, v) {
    this.#poseJoints(frame);
    const point = [0, 0, 0];
    for (let i = this.starts[v]; i < this.starts[v + 1]; i++) {
      for (let row = 0; row < 3; row++) {
        const r = 9 * this.joint[i] + 3 * row;
        let value = this.shift[3 * this.joint[i] + row];
        for (let axis = 0; axis < 3; axis++) value += this.turn[r + axis] * this.rest[3 * v + axis];
        point[row] += this.weight[i] * value;
      }
    }
    return point;
  }

  #poseJoints(frame) {
    const early = Math.max(0, Math.min(this.frames - 1, Math.floor(frame)));
    const late = Math.min(this.frames - 1, early + 1);
    const share = Math.max(0, Math.min(1, frame - early));
    const { turn, place, shift, parents, offsets, binds } = this;
    for (let j = 0; j < parents.length; j++) {
      const parent = parents[j];
      const rotations = this.rotations.get(j);
      const local = rotations ? matrix(slerp(rotations, early, late, share)) : IDENTITY;
      for (let row = 0; row < 3; row++) {
        if (parent < 0) {
          for (let c = 0; c < 3; c++) turn[9 * j + 3 * row + c] = local[3 * row + c];
          place[3 * j + row] = this.root[3 * early + row] * (1 - share) + this.root[3 * late + row] * share;
        } else {
          const r = 9 * parent + 3 * row;
          for (let c = 0; c < 3; c++) {
            turn[9 * j + 3 * row + c] = turn[r] * local[c] + turn[r + 1] * local[3 + c] + turn[r + 2] * local[6 + c];
          }
          place[3 * j + row] = place[3 * parent + row]
            + turn[r] * offsets[3 * j] + turn[r + 1] * offsets[3 * j + 1] + turn[r + 2] * offsets[3 * j + 2];
        }
      }
      for (let row = 0; row < 3; row++) {
        const r = 9 * j + 3 * row;
        shift[3 * j + row] = place[3 * j + row]
          + turn[r] * binds[3 * j] + turn[r + 1] * binds[3 * j + 1] + turn[r + 2] * binds[3 * j + 2];
      }
    }
  }
}

const IDENTITY = [1, 0, 0, 0, 1, 0, 0, 0, 1];

/** Spherical interpolation between two rows of quaternions (x, y, z, w), glTF 2.0 appendix C. */
function slerp(values, early, late, share) {
  const [a, b] = [values.subarray(4 * early, 4 * early + 4), values.subarray(4 * late, 4 * late + 4)];
  if (share === 0) return a;
  const dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const angle = Math.acos(Math.min(1, Math.abs(dot)));
  const near = angle < 1e-5;
  const first = near ? 1 - share : Math.sin((1 - share) * angle) / Math.sin(angle);
  const second = (near ? share : Math.sin(share * angle) / Math.sin(angle)) * Math.sign(dot || 1);
  return [0, 1, 2, 3].map((i) => first * a[i] + second * b[i]);
}

/** Rotation matrix, row by row, of a quaternion that need not have length one. */
function matrix([x, y, z, w]) {
  const s = 2 / (x * x + y * y + z * z + w * w);
  return [
    1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w),
    s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w),
    s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y),
  ];
}
