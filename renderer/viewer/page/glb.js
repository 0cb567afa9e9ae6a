// Binary glTF 2.0 as typed arrays: what our own files use of the format and no more.
const KINDS = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4, MAT4: 16 };
const ARRAYS = {
  5120: Int8Array, 5121: Uint8Array, 5122: Int16Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array,
};

/** @param {ArrayBuffer} buffer @returns {{json: object, accessor: function, image: function}} */
export function readGlb(buffer) {
  const view = new DataView(buffer);
  if (buffer.byteLength < 28 || view.getUint32(0, true) !== 0x46546c67 || view.getUint32(8, true) !== buffer.byteLength) {
    throw new Error("A model is damaged: it is not a whole binary glTF file.");
  }
  const textLength = view.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 20, textLength)));
  const binary = 28 + textLength;

  /** Values of an accessor without gaps: {array, width, normalized}. */
  function accessor(index) {
    const about = json.accessors[index];
    const place = json.bufferViews[about.bufferView];
    const [Kind, width] = [ARRAYS[about.componentType], KINDS[about.type]];
    const start = binary + (place.byteOffset ?? 0);
    const row = width * Kind.BYTES_PER_ELEMENT;
    const stride = place.byteStride ?? row;
    const array = new Kind(about.count * width);
    if (stride === row) {
      array.set(new Kind(buffer.slice(start, start + about.count * row)));
    } else {
      const bytes = new Uint8Array(array.buffer);
      for (let i = 0; i < about.count; i++) bytes.set(new Uint8Array(buffer, start + i * stride, row), i * row);
    }
    return { array, width, normalized: about.normalized ?? false };
  }

  /** An image as a Blob of its type. */
  function image(index) {
    const { bufferView, mimeType } = json.images[index];
    const place = json.bufferViews[bufferView];
    return new Blob([new Uint8Array(buffer, binary + (place.byteOffset ?? 0), place.byteLength)], { type: mimeType });
  }

  return { json, accessor, image };
}
