// In the worker: blocks to whole numbers, and those to Gaussians. The layout is in docs/player_format.md.

const QUAT_LEVELS = 127;
const OTHERS = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];
const PLANES = { largest: 0, quats: 1, scales: 4, opacity: 7, colors: 8, n: 11 }; // of bytes, after the positions

async function inflated(text, nBytes) {
  const letters = atob(text), packed = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) packed[i] = letters.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  if (bytes.length !== nBytes) throw new Error(`a block has ${bytes.length} bytes instead of ${nBytes}`);
  return bytes;
}

/** Reads a block from its beginning to its end. */
class BlockReader {
  constructor(bytes) {
    this.bytes = bytes;
    this.at = 0;
  }

  take(nBytes) {
    this.at += nBytes;
    return this.bytes.subarray(this.at - nBytes, this.at);
  }

  /** Rows as planes of whole numbers: {n, positions: Uint16Array [3 n], bytes: Uint8Array [11 n]}. */
  rows(n) {
    const low = this.take(3 * n), high = this.take(3 * n), positions = new Uint16Array(3 * n);
    for (let plane = 0; plane < 3; plane++) {
      let value = 0;
      for (let i = plane * n; i < (plane + 1) * n; i++) {
        value += unfolded(low[i] | (high[i] << 8));
        positions[i] = value; // modulo 65536
      }
    }
    const bytes = this.take(PLANES.n * n).slice();
    for (let plane = 0; plane < PLANES.n; plane++) {
      let value = 0;
      for (let i = plane * n; i < (plane + 1) * n; i++) {
        value += unfolded(bytes[i]);
        bytes[i] = value; // modulo 256
      }
    }
    return { n, positions, bytes };
  }

  /** Planes that say how far bytes differ from others. */
  changed(before) {
    return this.take(before.length).map((folded, i) => before[i] + unfolded(folded));
  }
}

function unfolded(value) {
  return (value >>> 1) ^ -(value & 1);
}

/** Shapes and places of Gaussians, as the texture holds them, in whole lines. */
class Shapes {
  constructor(n) {
    this.n = n;
    this.means = new Float32Array(3 * n); // for sorting; what the texture holds is given away
    this.geometry = new Float32Array(4 * TEXELS_PER_ROW * ROWS_PER_LINE * lines(n));
  }

  /** Put rows in, from a row on, all of them or those that are not hidden. */
  put(rows, rounding, first, isHidden) {
    const { n, positions, bytes } = rows, { means, geometry } = this;
    const [ox, oy, oz] = rounding.origin, step = rounding.step;
    const scales = Float32Array.from({ length: 256 }, (_, level) =>
      Math.exp(rounding.scale_low + level * rounding.scale_step));
    const three = [0, 0, 0];
    let row = first;
    for (let i = 0; i < n; i++) {
      if (isHidden && (isHidden[i >> 3] >> (i & 7)) & 1) continue;
      const at = 4 * TEXELS_PER_ROW * row;
      geometry[at] = means[3 * row] = ox + step * positions[i];
      geometry[at + 1] = means[3 * row + 1] = oy + step * positions[n + i];
      geometry[at + 2] = means[3 * row + 2] = oz + step * positions[2 * n + i];
      geometry[at + 3] = bytes[PLANES.opacity * n + i] / 255;
      const largest = bytes[i], others = OTHERS[largest];
      let rest = 1;
      for (let k = 0; k < 3; k++) {
        three[k] = (bytes[(PLANES.quats + k) * n + i] - QUAT_LEVELS) / (QUAT_LEVELS * Math.SQRT2);
        rest -= three[k] * three[k];
        geometry[at + 4 + others[k]] = three[k];
        geometry[at + 8 + k] = scales[bytes[(PLANES.scales + k) * n + i]];
      }
      geometry[at + 4 + largest] = Math.sqrt(Math.max(rest, 0));
      row++;
    }
    return row;
  }
}

/** Colours of n Gaussians as the texture holds them, in whole lines. */
function emptyColors(n) {
  return new Float32Array(4 * ROWS_PER_LINE * lines(n));
}

/** Add a share of colours, given as planes of bytes, to those of n rows from a row on. */
function addColors(colors, planes, colorMax, first, n, share = 1) {
  const unit = (share * colorMax) / 255;
  for (let plane = 0; plane < 3; plane++) {
    for (let i = 0; i < n; i++) colors[4 * (first + i) + plane] += unit * planes[plane * n + i];
  }
}

function colorPlanes(rows) {
  return rows.bytes.subarray(PLANES.colors * rows.n);
}

/** Planes of the rows that are not hidden. */
function shownPlanes(planes, n, isHidden) {
  if (!isHidden) return planes;
  return planes.filter((_, i) => !((isHidden[(i % n) >> 3] >> ((i % n) & 7)) & 1));
}
