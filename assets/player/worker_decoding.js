// In the worker: blocks to whole numbers, and those to Gaussians. The layout is in docs/player_format.md.

const OTHERS = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];
const PLANES = { largest: 0, quats: 1, scales: 4, opacity: 7, colors: 8, n: 11 }; // of bytes, after the positions

/** Inflated bytes of a part, never more than it is said to have. */
async function inflated(packed, nBytes) {
  const reader = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate-raw")).getReader();
  const bytes = new Uint8Array(nBytes);
  let at = 0;
  for (let { done, value } = await reader.read(); !done; { done, value } = await reader.read()) {
    if (at + value.length > nBytes) throw new Error(`a part has more than the ${nBytes} bytes that it is said to have`);
    bytes.set(value, at);
    at += value.length;
  }
  if (at < nBytes) throw new Error(`a part has ${at} bytes instead of ${nBytes}`);
  return bytes;
}

function bytesOf(base64) {
  const letters = atob(base64), bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

/** Reads a part of a block from its beginning to its end. */
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
    const rows = this.changes(n), { positions, bytes } = rows;
    for (let i = 0; i < positions.length; i++) if (i % n) positions[i] += positions[i - 1]; // modulo 65536
    for (let i = 0; i < bytes.length; i++) if (i % n) bytes[i] += bytes[i - 1]; // modulo 256
    return rows;
  }

  /** The same planes as they are stored: how far numbers differ from others. */
  changes(n) {
    const low = this.take(3 * n), high = this.take(3 * n);
    const positions = Uint16Array.from(low, (byte, i) => unfolded(byte | (high[i] << 8)));
    return { n, positions, bytes: this.take(PLANES.n * n).map(unfolded) };
  }

  /** Rows of so many frames, each like those of `rows`: nRows of them appear once in full, and change from then on. */
  frames(nRows, counts) {
    const presence = counts.map(() => this.take((nRows + 7) >> 3)), now = this.rows(nRows);
    const changes = this.changes(counts.reduce((sum, n) => sum + n, -nRows));
    let known = 0, first = 0; // of the rows, and of the changes
    return counts.map((n, frame) => {
      const bits = presence[frame], here = new Uint32Array(n);
      let at = 0, nOld = 0;
      for (let row = 0; row < nRows && at < n; row++) if ((bits[row >> 3] >> (row & 7)) & 1) here[at++] = row;
      while (nOld < n && here[nOld] < known) nOld++;
      if (nOld < n) known = here[n - 1] + 1;
      const update = (now, by, nPlanes, frameRows) => {
        for (let plane = 0; plane < nPlanes; plane++) {
          const change = plane * changes.n + first;
          for (let i = 0; i < n; i++) {
            const row = plane * nRows + here[i];
            if (i < nOld) now[row] += by[change + i];
            frameRows[plane * n + i] = now[row];
          }
        }
        return frameRows;
      };
      const positions = update(now.positions, changes.positions, 3, new Uint16Array(3 * n));
      const bytes = update(now.bytes, changes.bytes, PLANES.n, new Uint8Array(PLANES.n * n));
      first += nOld;
      return { n, positions, bytes };
    });
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
    const { quat_levels, opacity_levels } = rounding, three = [0, 0, 0];
    let row = first;
    for (let i = 0; i < n; i++) {
      if (isHidden && (isHidden[i >> 3] >> (i & 7)) & 1) continue;
      const at = 4 * TEXELS_PER_ROW * row;
      geometry[at] = means[3 * row] = ox + step * positions[i];
      geometry[at + 1] = means[3 * row + 1] = oy + step * positions[n + i];
      geometry[at + 2] = means[3 * row + 2] = oz + step * positions[2 * n + i];
      geometry[at + 3] = bytes[PLANES.opacity * n + i] / opacity_levels;
      const largest = bytes[i], others = OTHERS[largest];
      let rest = 1;
      for (let k = 0; k < 3; k++) {
        three[k] = (bytes[(PLANES.quats + k) * n + i] - quat_levels) / (quat_levels * Math.SQRT2);
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

/** Add a share of colours, given as planes of bytes whose 1 stands for `unit`, to those of n rows from a row on. */
function addColors(colors, planes, unit, first, n) {
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
