// In the worker: takes blocks in, and answers with what has to be drawn of a frame in a view. An answer says which frame
// it is of; it holds only what differs from the answer before it.

const CORNERS = 4; // every Gaussian is drawn as four, each of which has its number

const sorter = new DepthSorter(), painter = new Painter();
const NOTHING = { frame: null, clip: null, still: null, moving: null, kept: null, nLevels: 0 };
let scene = null, built = NOTHING;

const answers = {
  scene({ header }) {
    scene = new Scene(header);
    return { kind: "ready" };
  },

  /** Levels of a block, from one on: packed bytes, or all of them as base64. */
  async levels({ key, first, data }) {
    const gone = await scene.add(key, first, typeof data === "string" ? bytesOf(data) : data);
    const nLevels = scene.shared.length;
    return { kind: "levels", key, gone, nShared: nLevels, nClips: [...scene.clips.values()].map((c) => [c.index, c.levels.length]) };
  },

  /** Nothing of what was answered is there any more, because the graphics context was lost. */
  forget() {
    built = NOTHING;
    return { kind: "forgotten" };
  },

  /** view: where the picture itself is painted here, as of Painter.paint. */
  picture({ epoch, frame, clipIndex, row, near, view, nLevels }) {
    const clip = scene.clip(clipIndex), begunMs = performance.now();
    if (!clip) return { kind: "missing", index: clipIndex };
    const answer = { kind: "picture", epoch, frame, gifts: [] };
    if (Boolean(view) !== Boolean(built.kept)) built = NOTHING; // what was given away is not here
    if (built.frame !== frame || built.clip !== clip || built.nLevels !== clip.levels.length) {
      build(clip, frame, frame - scene.header.clips[clipIndex].first, answer, Boolean(view));
    }
    const { still, moving, kept } = built, first = lines(still.n) * ROWS_PER_LINE;
    const seen = (shapes) => shapes.ends[Math.min(nLevels, shapes.ends.length) - 1];
    if (!row) return { ...answer, nSeen: [seen(still), seen(moving)] };
    const parts = [{ means: still.means, n: seen(still), first: 0 }, { means: moving.means, n: seen(moving), first }];
    const order = sorter.order(parts, row, near, view ? 1 : CORNERS);
    if (!view) {
      give(answer, "order", order);
      return answer;
    }
    const shapes = [{ geometry: kept.stillGeometry, colors: kept.stillColors }];
    shapes.push({ geometry: kept.movingGeometry, colors: kept.movingColors, first });
    give(answer, "pixels", painter.paint(shapes, order, { ...view, near, background: scene.header.background }));
    return { ...answer, size: view.size, isFull: view.isFull, tookMs: performance.now() - begunMs };
  },
};

/** Make a frame, and put what is new of it into the answer, or keep it. */
function build(clip, frame, inClip, answer, isKept) {
  const before = built, nLevels = clip.levels.length;
  const isStillNew = before.nLevels !== nLevels || !hasSameStill(before.clip, clip);
  const { shapes, colors } = scene.moving(clip, inClip);
  built = { frame, clip, still: isStillNew ? scene.still(clip) : before.still, moving: shapes, kept: null, nLevels };
  const made = { movingGeometry: shapes.geometry, movingColors: colors };
  if (isStillNew) made.stillGeometry = built.still.geometry;
  if (isStillNew || before.clip !== clip || clip.levels[0].light.length) made.stillColors = scene.stillColors(clip, inClip);
  if (isKept) {
    built.kept = { ...before.kept, ...made };
    return;
  }
  answer.nStill = built.still.n;
  for (const [name, array] of Object.entries(made)) give(answer, name, array);
}

function hasSameStill(some, other) {
  const isPlain = (clip) => clip.levels.every((level) => !level.isHidden && !level.own.n);
  return some === other || (isPlain(some) && isPlain(other));
}

/** The arrays change their owner, which costs nothing. */
function give(answer, name, array) {
  answer[name] = array;
  answer.gifts.push(array.buffer);
}

/** One message after the other: unpacking lets others in between, which would read clips that are half there. */
let before = Promise.resolve();
onmessage = ({ data }) => {
  before = before.then(() => answered(data));
};

async function answered(data) {
  let answer;
  try {
    answer = await answers[data.kind](data);
  } catch (error) {
    answer = { kind: "failed", of: data.kind, key: data.key, message: String(error && error.message) };
  }
  const { gifts = [], ...told } = answer;
  postMessage(told, gifts);
}
