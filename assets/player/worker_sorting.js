// In the worker: the order in which Gaussians are drawn, farthest first, exact.

const RADIX = 1 << 16;

class DepthSorter {
  constructor() {
    this.hold(0);
  }

  hold(n) {
    this.size = n;
    this.depths = new Float32Array(n);
    this.keys = new Uint32Array(this.depths.buffer); // floats above 0 are in the order of their bits
    this.ids = new Uint32Array(n);
    this.halfKeys = new Uint32Array(n);
    this.halfIds = new Uint32Array(n);
    this.low = new Uint32Array(RADIX);
    this.high = new Uint32Array(RADIX);
  }

  /**
   * Numbers of the Gaussians beyond the near plane. Of two at the same depth the later one comes first, because it lies
   * behind the other for the rasterizer.
   * parts: [{means, n, first}] with the number of the first one; row: third row of world_to_camera; nEach: how often each
   * number is there.
   */
  order(parts, row, near, nEach) {
    const nAll = parts.reduce((sum, part) => sum + part.n, 0);
    if (nAll > this.size) this.hold(Math.ceil(nAll * 1.25));
    const { depths, keys, ids, low, high } = this, [rx, ry, rz, t] = row;
    low.fill(0);
    high.fill(0);
    let n = 0;
    for (let p = parts.length - 1; p >= 0; p--) {
      const { means, first } = parts[p];
      for (let i = parts[p].n - 1; i >= 0; i--) {
        const depth = rx * means[3 * i] + ry * means[3 * i + 1] + rz * means[3 * i + 2] + t;
        if (!(depth > near)) continue;
        depths[n] = depth;
        const key = (keys[n] = ~keys[n]); // farther is smaller
        low[key & 0xffff]++;
        high[key >>> 16]++;
        ids[n++] = first + i;
      }
    }
    beginnings(low);
    beginnings(high);
    for (let i = 0; i < n; i++) {
      const place = low[keys[i] & 0xffff]++;
      this.halfKeys[place] = keys[i];
      this.halfIds[place] = ids[i];
    }
    const order = new Uint32Array(nEach * n);
    for (let i = 0; i < n; i++) {
      const place = nEach * high[this.halfKeys[i] >>> 16]++, id = this.halfIds[i];
      for (let k = 0; k < nEach; k++) order[place + k] = id;
    }
    return order;
  }
}

function beginnings(counts) {
  let sum = 0;
  for (let i = 0; i < RADIX; i++) {
    const count = counts[i];
    counts[i] = sum;
    sum += count;
  }
}
