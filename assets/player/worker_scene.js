// In the worker: what stands still, and clips as long as there is room for them.

const CLIPS_BYTES = 512 << 20; // of inflated clips; at least two are kept

class Scene {
  constructor(header, rows) {
    this.header = header;
    this.rows = rows; // what clips share
    this.clips = new Map(); // by number, the one asked for last comes last
  }

  async addClip(index, text) {
    const { own, light, moving, hides, n_bytes } = this.header.clips[index];
    const reader = new BlockReader(await inflated(text, n_bytes));
    const clip = { index, nBytes: n_bytes, isHidden: hides ? reader.take((this.rows.n + 7) >> 3) : null };
    clip.own = reader.rows(own ? own.n : 0);
    const shared = colorPlanes(this.rows);
    const shown = shownPlanes(shared, this.rows.n, clip.isHidden);
    clip.nStill = shown.length / 3 + clip.own.n;
    clip.light = light ? this.light(reader, joinedPlanes(shown, colorPlanes(clip.own)), light.frames.length) : null;
    clip.shown = shown;
    clip.frames = moving.n.map((n) => reader.rows(n));
    this.clips.delete(index);
    this.clips.set(index, clip);
    let held = 0;
    for (const other of this.clips.values()) held += other.nBytes;
    for (const [old, other] of this.clips) {
      if (held <= CLIPS_BYTES || this.clips.size <= 2) break;
      this.clips.delete(old);
      held -= other.nBytes;
    }
  }

  clip(index) {
    const clip = this.clips.get(index);
    if (clip) {
      this.clips.delete(index);
      this.clips.set(index, clip);
    }
    return clip;
  }

  light(reader, before, n) {
    const keys = [];
    for (let key = 0; key < n; key++) keys.push((before = reader.changed(before)));
    return keys;
  }

  /** Shapes of everything that stands still in a clip. */
  still(clip) {
    const { own } = this.header.clips[clip.index], shapes = new Shapes(clip.nStill);
    const first = shapes.put(this.rows, this.header.shared.rounding, 0, clip.isHidden);
    if (own) shapes.put(clip.own, own.rounding, first);
    return shapes;
  }

  /** Colours of everything that stands still, in the light of a frame of the clip. */
  stillColors(clip, frame) {
    const { own, light } = this.header.clips[clip.index], n = clip.nStill, colors = emptyColors(n);
    if (!light) {
      const first = n - clip.own.n;
      addColors(colors, clip.shown, this.header.shared.rounding.color_max, 0, first);
      if (own) addColors(colors, colorPlanes(clip.own), own.rounding.color_max, first, clip.own.n);
      return colors;
    }
    const { frames, color_max } = light;
    let key = 0;
    while (key + 1 < frames.length && frames[key + 1] <= frame) key++;
    const next = Math.min(key + 1, frames.length - 1);
    const share = next > key ? (frame - frames[key]) / (frames[next] - frames[key]) : 0;
    addColors(colors, clip.light[key], color_max, 0, n, 1 - share);
    if (share > 0) addColors(colors, clip.light[next], color_max, 0, n, share);
    return colors;
  }

  moving(clip, frame) {
    const rows = clip.frames[frame], { rounding } = this.header.clips[clip.index].moving;
    const shapes = new Shapes(rows.n), colors = emptyColors(rows.n);
    shapes.put(rows, rounding, 0);
    addColors(colors, colorPlanes(rows), rounding.color_max, 0, rows.n);
    return { shapes, colors };
  }
}

function joinedPlanes(some, others) {
  const n = some.length / 3, m = others.length / 3, joined = new Uint8Array(some.length + others.length);
  for (let plane = 0; plane < 3; plane++) {
    joined.set(some.subarray(plane * n, (plane + 1) * n), plane * (n + m));
    joined.set(others.subarray(plane * m, (plane + 1) * m), plane * (n + m) + n);
  }
  return joined;
}
