// In the worker: takes blocks in, and answers with what has to be drawn of a frame in a view. An answer says which frame
// it is of; it holds only what differs from the answer before it.

const sorter = new DepthSorter();
const NOTHING = { frame: null, clip: null, still: null, moving: null };
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

  picture({ epoch, frame, clipIndex, row, near }) {
    const clip = scene.clip(clipIndex);
    if (!clip) return { kind: "missing", index: clipIndex };
    const answer = { kind: "picture", epoch, frame, gifts: [] };
    if (built.frame !== frame) build(clip, frame, frame - scene.header.clips[clipIndex].first, answer);
    const { still, moving } = built;
    const parts = [{ means: still.means, n: still.n, first: 0 }];
    parts.push({ means: moving.means, n: moving.n, first: lines(still.n) * ROWS_PER_LINE });
    answer.order = sorter.order(parts, row, near);
    answer.gifts.push(answer.order.buffer);
    return answer;
  },
};

/** Make a frame, and put what is new of it into the answer. */
function build(clip, frame, inClip, answer) {
  const before = built, isStillNew = !before.clip || !hasSameStill(before.clip, clip);
  const { shapes, colors } = scene.moving(clip, inClip);
  built = { frame, clip, still: isStillNew ? scene.still(clip) : before.still, moving: shapes };
  answer.nStill = built.still.n;
  answer.nMoving = shapes.n;
  if (isStillNew) give(answer, "stillGeometry", built.still.geometry);
  if (before.clip !== clip || clip.light) give(answer, "stillColors", scene.stillColors(clip, inClip));
  give(answer, "movingGeometry", shapes.geometry);
  give(answer, "movingColors", colors);
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
