// In the worker: takes blocks in, and answers with what has to be drawn of a frame in a view. An answer says which frame
// it is of; it holds only what differs from the answer before it.

const CORNERS = 4; // every Gaussian is drawn as four, each of which has its number

const sorter = new DepthSorter(), painter = new Painter();
const NOTHING = { frame: null, clip: null, still: null, moving: null, kept: null };
let scene = null, built = NOTHING;

const answers = {
  async scene({ header, text }) {
    const { n, n_bytes } = header.shared;
    scene = new Scene(header, new BlockReader(await inflated(text, n_bytes)).rows(n));
    return { kind: "ready" };
  },

  async clip({ index, text }) {
    await scene.addClip(index, text);
    return { kind: "clip", index };
  },

  /** Nothing of what was answered is there any more, because the graphics context was lost. */
  forget() {
    built = NOTHING;
    return { kind: "forgotten" };
  },

  /** view: where the picture itself is painted here, as of Painter.paint. */
  picture({ epoch, frame, clipIndex, row, near, view }) {
    const clip = scene.clip(clipIndex), begunMs = performance.now();
    if (!clip) return { kind: "missing", index: clipIndex };
    const answer = { kind: "picture", epoch, frame, gifts: [] };
    if (Boolean(view) !== Boolean(built.kept)) built = NOTHING; // what was given away is not here
    if (built.frame !== frame) build(clip, frame, frame - scene.header.clips[clipIndex].first, answer, Boolean(view));
    if (!row) return answer;
    const { still, moving, kept } = built;
    const parts = [{ means: still.means, n: still.n, first: 0 }];
    parts.push({ means: moving.means, n: moving.n, first: lines(still.n) * ROWS_PER_LINE });
    const order = sorter.order(parts, row, near, view ? 1 : CORNERS);
    if (!view) {
      give(answer, "order", order);
      return answer;
    }
    const shapes = [{ geometry: kept.stillGeometry, colors: kept.stillColors }];
    shapes.push({ geometry: kept.movingGeometry, colors: kept.movingColors, first: parts[1].first });
    give(answer, "pixels", painter.paint(shapes, order, { ...view, near, background: scene.header.background }));
    return { ...answer, size: view.size, isFull: view.isFull, tookMs: performance.now() - begunMs };
  },
};

/** Make a frame, and put what is new of it into the answer, or keep it. */
function build(clip, frame, inClip, answer, isKept) {
  const before = built, isStillNew = !before.clip || !hasSameStill(before.clip, clip);
  const { shapes, colors } = scene.moving(clip, inClip);
  built = { frame, clip, still: isStillNew ? scene.still(clip) : before.still, moving: shapes, kept: null };
  const made = { movingGeometry: shapes.geometry, movingColors: colors };
  if (isStillNew) made.stillGeometry = built.still.geometry;
  if (before.clip !== clip || clip.light) made.stillColors = scene.stillColors(clip, inClip);
  if (isKept) {
    built.kept = { ...before.kept, ...made };
    return;
  }
  answer.nStill = built.still.n;
  answer.nMoving = shapes.n;
  for (const [name, array] of Object.entries(made)) give(answer, name, array);
}

function hasSameStill(some, other) {
  return some === other || (!some.isHidden && !other.isHidden && !some.own.n && !other.own.n);
}

/** The arrays change their owner, which costs nothing. */
function give(answer, name, array) {
  answer[name] = array;
  answer.gifts.push(array.buffer);
}

onmessage = async ({ data }) => {
  let answer;
  try {
    answer = await answers[data.kind](data);
  } catch (error) {
    answer = { kind: "failed", of: data.kind, index: data.index, message: String(error && error.message) };
  }
  const { gifts = [], ...told } = answer;
  postMessage(told, gifts);
};
