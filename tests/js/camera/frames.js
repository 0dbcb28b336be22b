/** Pictures in the format of the console's messages. */

export function packed(header, bytes = [1, 2, 3]) {
  const text = new TextEncoder().encode(JSON.stringify(header));
  const frame = new Uint8Array(4 + text.length + bytes.length);
  new DataView(frame.buffer).setUint32(0, text.length);
  frame.set(text, 4);
  frame.set(bytes, 4 + text.length);
  return frame.buffer;
}

export function headerOf(number, rest = {}) {
  return {
    camera: "head",
    number,
    format: "jpeg",
    key: true,
    width: 640,
    height: 480,
    taken_ms: 1000,
    lens: null,
    pose: null,
    ...rest,
  };
}

/** A canvas that records what was painted on it. */
export function recordingCanvas() {
  const canvas = document.createElement("canvas");
  const painted = [];
  canvas.getContext = () => ({ drawImage: (source) => painted.push(source), clearRect() {} });
  return { canvas, painted };
}
