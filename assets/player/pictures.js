// Asks the worker for pictures, one at a time, the newest wish first, and says which blocks they need.

const AHEAD_S = 6; // of playing are loaded beforehand where a server sends clips one by one
const AHEAD_BYTES = 96 << 20; // unpacked, at most: half of what the worker keeps, or what a larger clip that is shown leaves
const COARSE = 2; // levels of the low quality
const SHARE_OF_LINE = 0.8; // that playing may take

class Pictures {
  /**
   * upcoming(): numbers of the clips that are played next, in their order; onPicture(answer); onNotice(text, canRetry):
   * what stands in the way of the wish, empty where nothing does.
   */
  constructor(header, blocks, workerSource, { upcoming, onPicture, onNotice }) {
    Object.assign(this, { header, blocks, upcoming, onPicture, onNotice });
    this.isReady = this.isBusy = this.isStopped = this.isInterrupted = false;
    this.wish = this.answered = null;
    this.epoch = 0; // another one after everything was forgotten
    this.nLevels = header.shared.parts.length;
    this.quality = "auto";
    this.isPlaying = false;
    this.loaded = new Map(); // clips of which something can be drawn: how many levels
    const onLevels = (key, first, data) => this.worker.postMessage({ kind: "levels", key, first, data });
    this.loader = new Loader(blocks, { onLevels, onChange: () => this.go() });
    const url = URL.createObjectURL(new Blob([workerSource], { type: "text/javascript" }));
    this.worker = new Worker(url);
    URL.revokeObjectURL(url);
    this.worker.onmessage = ({ data }) => this.receive(data);
    this.worker.onerror = (event) => this.stop(`The sorter has stopped: ${event.message}`);
    this.worker.postMessage({ kind: "scene", header });
  }

  clipOf(frame) {
    return this.header.clips.findIndex((clip) => frame < clip.first + clip.moving.n.length);
  }

  /** Is this frame still on its way because its clip is being loaded? */
  isWaitingFor(frame) {
    const index = this.clipOf(frame), { loader } = this;
    return !this.loaded.has(index) && !loader.failure("shared")?.isFinal && !loader.failure(index)?.isFinal;
  }

  /**
   * A frame seen from where depths are `row`, the third row of world_to_camera, null where nothing has to be sorted;
   * atMost: so many levels are enough; view: to have it painted, as of Painter.paint. */
  want(frame, row, atMost = Infinity, view = null) {
    const { quality } = this, few = { auto: atMost, low: Math.min(COARSE, atMost), full: Infinity }[quality];
    const clipIndex = this.clipOf(frame);
    if (this.wish && this.wish.clipIndex !== clipIndex) this.loader.hurry(clipIndex);
    this.wish = { frame, row, view, clipIndex, nLevels: Math.min(few, this.nLevels) };
    this.go();
  }

  key({ frame, row, view, clipIndex, nLevels }) {
    return `${frame} ${row} ${view && JSON.stringify(view)} ${nLevels} ${this.loaded.get(clipIndex)}`;
  }

  go() {
    const { wish, loader } = this;
    if (this.isStopped || !wish) return;
    const { clipIndex } = wish, isLoaded = this.loaded.has(clipIndex);
    wish.key = this.key(wish);
    loader.ask(this.needs(clipIndex));
    const failure = loader.failure("shared") || loader.failure(clipIndex);
    if (failure) this.say(failure.isFinal ? failure.message : `${failure.message} Trying again \u2026`, failure.isFinal);
    else this.say(isLoaded ? "" : "Loading \u2026", false);
    if (!this.isReady || !isLoaded || this.isBusy || wish.key === this.answered) return;
    this.isBusy = true;
    this.asked = wish.key;
    const { frame, row, view, nLevels } = wish, near = this.header.near_plane;
    this.worker.postMessage({ kind: "picture", frame, clipIndex, row, near, view, nLevels, epoch: this.epoch });
  }

  /** A coarse picture first, then all of it, then what comes next as far as the line brings it in time, then the rest. */
  needs(clipIndex) {
    const all = this.quality === "low" ? Math.min(COARSE, this.nLevels) : this.nLevels;
    const { clips, fps, step } = this.header, seconds = (index) => (clips[index].moving.n.length * step) / fps;
    const now = this.isPlaying ? Math.min(all, this.affordable(clipIndex, seconds(clipIndex))) : all;
    const needs = [["shared", 1, 0], [clipIndex, 1, 0], ["shared", all, 1], [clipIndex, now, 1]];
    const nBytes = (index) => clips[index].parts.reduce((sum, [, n]) => sum + n, 0);
    const room = 2 * AHEAD_BYTES - Math.max(nBytes(clipIndex), AHEAD_BYTES);
    let ahead = 0, held = 0;
    for (const index of this.upcoming()) {
      if (index === clipIndex || (held > 0 && (ahead > AHEAD_S || !this.blocks.isStreamed))) continue;
      if (held > 0 && held + nBytes(index) > room) break;
      needs.push([index, Math.min(all, this.affordable(index, seconds(index))), 2], [index, all, 3]);
      ahead += seconds(index);
      held += nBytes(index);
    }
    return needs.map(([key, upTo, rank]) => ({ key, upTo, rank }));
  }

  /** Levels of a clip that the line brings in the time that it plays. */
  affordable(index, seconds) {
    const { bytesPerS } = this.loader, { parts } = this.header.clips[index];
    if (this.quality !== "auto" || bytesPerS === null) return parts.length;
    let n = 0, size = 0;
    while (n < parts.length && (size += parts[n][0]) < SHARE_OF_LINE * bytesPerS * seconds) n++;
    return Math.max(n, 1);
  }

  say(text, canRetry) {
    if (!this.isInterrupted) this.onNotice(text, canRetry);
  }

  /** Something else is said for so long. */
  interrupt(text, ms) {
    if (this.isStopped) return;
    this.isInterrupted = true;
    this.onNotice(text, false);
    setTimeout(() => {
      this.isInterrupted = false;
      this.go();
    }, ms);
  }

  /** Nothing more can be shown. */
  stop(message) {
    this.isStopped = true;
    this.onNotice(message, false);
  }

  /** Nothing of what was answered is there any more, and the next wish may be another kind of picture. */
  forget() {
    this.epoch++;
    this.wish = this.answered = null;
    this.worker.postMessage({ kind: "forget" });
  }

  receive(answer) {
    if (answer.kind === "ready") this.isReady = true;
    if (answer.kind === "levels") {
      answer.gone.forEach((index) => this.loader.forget(index));
      this.loaded = new Map(answer.nClips.filter(([, n]) => n > 0));
    }
    if (answer.kind === "missing") {
      this.isBusy = false;
      this.loaded.delete(answer.index);
    }
    if (answer.kind === "failed") {
      const { key } = answer;
      if (answer.of === "levels" && key !== "shared") {
        this.loader.forget(key); // so that trying again asks for it again
        this.loader.fail(key, `A clip is damaged: ${answer.message}`, true);
      } else this.stop(`The scene cannot be shown: ${answer.message} Load the page again.`);
    }
    if (answer.kind === "picture") {
      this.isBusy = false;
      if (answer.epoch === this.epoch) {
        this.answered = this.asked;
        this.onPicture(answer);
      }
    }
    this.go();
  }
}
