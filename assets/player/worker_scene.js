// In the worker: what stands still, and clips as long as there is room for them. Each comes level by level.

const CLIPS_BYTES = 192 << 20; // of unpacked clips; at least two are kept

class Scene {
  constructor(header) {
    this.header = header;
    this.shared = []; // rows that clips share, by level
    this.clips = new Map(); // by number, the one asked for last comes last
    this.shown = null; // number of the one that a picture was made of last
  }

  /** Packed bytes of levels of a block, one after the other, from level `first` on. */
  async add(key, first, packed) {
    const { parts } = key === "shared" ? this.header.shared : this.header.clips[key];
    for (let level = first, at = 0; level < parts.length && at < packed.length; level++) {
      const [nPacked, nBytes] = parts[level];
      const bytes = await inflated(packed.subarray(at, at + nPacked), nBytes);
      at += nPacked;
      if (key === "shared") {
        this.shared[level] = new BlockReader(bytes).rows(this.header.shared.levels[level]);
        continue;
      }
      const clip = this.clipToFill(key);
      if (level >= clip.levels.length) clip.waiting[level] = bytes; // some come again where others were damaged
    }
    for (const clip of this.clips.values()) this.settle(clip);
    return this.makeRoom(key);
  }

  clipToFill(index) {
    const { moving } = this.header.clips[index];
    const clip = this.clips.get(index) || { index, levels: [], waiting: [], n: moving.n.length };
    this.clips.delete(index);
    this.clips.set(index, clip);
    return clip;
  }

  /** Unpack what a clip has, as far as what clips share is there. */
  settle(clip) {
    while (clip.levels.length < this.shared.length && clip.waiting[clip.levels.length]) {
      const level = clip.levels.length;
      clip.levels.push(this.unpacked(clip.index, level, new BlockReader(clip.waiting[level])));
      clip.waiting[level] = null;
    }
  }

  unpacked(index, level, reader) {
    const { own, light, moving, hides } = this.header.clips[index], shared = this.shared[level];
    const isHidden = hides ? reader.take((shared.n + 7) >> 3) : null;
    const rows = reader.rows(own ? own.levels[level] : 0);
    const shown = shownPlanes(colorPlanes(shared), shared.n, isHidden), n = shown.length / 3 + rows.n, keys = [];
    let before = light && joinedPlanes(shown, colorPlanes(rows));
    for (const _ of light ? light.frames : []) keys.push((before = reader.changed(before)));
    return { n, isHidden, own: rows, shown, light: keys, frames: reader.frames(moving.rows[level], moving.levels[level]) };
  }

  /** Let go of clips that were not asked for the longest. Returns their numbers. */
  makeRoom(newest) {
    const size = ({ index }) => this.header.clips[index].parts.reduce((sum, [, nBytes]) => sum + nBytes, 0), gone = [];
    let held = 0;
    for (const clip of this.clips.values()) held += size(clip);
    for (const [index, clip] of this.clips) {
      if (held <= CLIPS_BYTES || this.clips.size <= 2) break;
      if (index === newest || index === this.shown) continue;
      this.clips.delete(index);
      gone.push(index);
      held -= size(clip);
    }
    return gone;
  }

  clip(index) {
    const clip = this.clips.get(index);
    this.shown = index;
    if (clip) {
      this.clips.delete(index);
      this.clips.set(index, clip);
    }
    return clip && clip.levels.length ? clip : null;
  }

  /** Shapes of everything that stands still in a clip, as far as it is there. */
  still(clip) {
    const { own } = this.header.clips[clip.index], ends = [];
    const shapes = new Shapes(clip.levels.reduce((sum, level) => sum + level.n, 0));
    let row = 0;
    clip.levels.forEach((level, i) => {
      row = shapes.put(this.shared[i], this.header.shared.rounding, row, level.isHidden);
      if (own) row = shapes.put(level.own, own.rounding, row);
      ends.push(row);
    });
    return Object.assign(shapes, { ends });
  }

  /** Colours of everything that stands still, in the light of a frame of the clip. */
  stillColors(clip, frame) {
    const { own, light } = this.header.clips[clip.index], { shared } = this.header, unit = (of) => of.color_max / of.color_levels;
    const colors = emptyColors(clip.levels.reduce((sum, level) => sum + level.n, 0));
    const { key, next, share } = light ? between(light.frames, frame) : {};
    let row = 0;
    for (const level of clip.levels) {
      const first = level.n - level.own.n;
      if (light) {
        addColors(colors, level.light[key], ((1 - share) * light.color_max) / 255, row, level.n);
        if (share > 0) addColors(colors, level.light[next], (share * light.color_max) / 255, row, level.n);
      } else {
        addColors(colors, level.shown, unit(shared.rounding), row, first);
        if (own) addColors(colors, colorPlanes(level.own), unit(own.rounding), row + first, level.own.n);
      }
      row += level.n;
    }
    return colors;
  }

  moving(clip, frame) {
    const { rounding } = this.header.clips[clip.index].moving, levels = clip.levels.map((level) => level.frames[frame]);
    const n = levels.reduce((sum, rows) => sum + rows.n, 0), shapes = new Shapes(n), colors = emptyColors(n), ends = [];
    let row = 0;
    for (const rows of levels) {
      addColors(colors, colorPlanes(rows), rounding.color_max / rounding.color_levels, row, rows.n);
      row = shapes.put(rows, rounding, row);
      ends.push(row);
    }
    return { shapes: Object.assign(shapes, { ends }), colors };
  }
}

/** The stored frames before and after one, and how far it is from the first to the second. */
function between(frames, frame) {
  let key = 0;
  while (key + 1 < frames.length && frames[key + 1] <= frame) key++;
  const next = Math.min(key + 1, frames.length - 1);
  return { key, next, share: next > key ? (frame - frames[key]) / (frames[next] - frames[key]) : 0 };
}

function joinedPlanes(some, others) {
  const n = some.length / 3, m = others.length / 3, joined = new Uint8Array(some.length + others.length);
  for (let plane = 0; plane < 3; plane++) {
    joined.set(some.subarray(plane * n, (plane + 1) * n), plane * (n + m));
    joined.set(others.subarray(plane * m, (plane + 1) * m), plane * (n + m) + n);
  }
  return joined;
}
