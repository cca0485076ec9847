// Asks the worker for pictures, one at a time, the newest wish first, and loads the clips that they need.

class Pictures {
  /** onPicture(answer); onNotice(text): what stands in the way of the wish, empty where nothing does. */
  constructor(header, blocks, workerSource, { onPicture, onNotice }) {
    Object.assign(this, { header, blocks, onPicture, onNotice });
    this.isReady = this.isBusy = false;
    this.wish = this.answered = null;
    this.epoch = 0; // another one after everything was forgotten
    this.loaded = new Set();
    this.loading = new Set();
    this.failed = new Map();
    const url = URL.createObjectURL(new Blob([workerSource], { type: "text/javascript" }));
    this.worker = new Worker(url);
    URL.revokeObjectURL(url);
    this.worker.onmessage = ({ data }) => this.receive(data);
    this.worker.onerror = (event) => this.stop(`The sorter has stopped: ${event.message}`);
    blocks.text("shared").then(
      (text) => this.worker.postMessage({ kind: "scene", header, text }),
      (error) => this.stop(error.message),
    );
  }

  clipOf(frame) {
    return this.header.clips.findIndex((clip) => frame < clip.first + clip.moving.n.length);
  }

  /** Is this frame still on its way because its clip is being loaded? */
  isWaitingFor(frame) {
    const index = this.clipOf(frame);
    return !this.loaded.has(index) && !this.failed.has(index);
  }

  /**
   * A frame seen from where depths are `row`, the third row of world_to_camera; null where nothing has to be sorted; view: to have it painted, as of
   * Painter.paint. */
  want(frame, row, view = null) {
    this.wish = { frame, row, view, key: `${frame} ${row} ${view ? JSON.stringify(view) : ""}` };
    this.go();
  }

  go() {
    const { wish } = this;
    if (!this.isReady || !wish) return;
    const clipIndex = this.clipOf(wish.frame), isLoaded = this.loaded.has(clipIndex);
    this.onNotice(this.failed.get(clipIndex) || (isLoaded ? "" : "Loading \u2026"));
    this.load(clipIndex);
    if (!isLoaded || this.isBusy || wish.key === this.answered) return;
    if (this.header.clips.length > 1) this.load((clipIndex + 1) % this.header.clips.length);
    this.isBusy = true;
    this.asked = wish.key;
    const { frame, row, view } = wish, near = this.header.near_plane;
    this.worker.postMessage({ kind: "picture", frame, clipIndex, row, near, view, epoch: this.epoch });
  }

  async load(index) {
    if (this.loaded.has(index) || this.loading.has(index) || this.failed.has(index)) return;
    this.loading.add(index);
    try {
      const text = await this.blocks.text(this.header.clips[index].name);
      this.worker.postMessage({ kind: "clip", index, text });
    } catch (error) {
      this.fail(index, error.message);
    }
  }

  fail(index, message) {
    this.loading.delete(index);
    this.failed.set(index, message);
    this.go();
  }

  /** Nothing more can be shown. */
  stop(message) {
    this.isReady = false;
    this.onNotice(message);
  }

  /** Nothing of what was answered is there any more. */
  forget() {
    this.epoch++;
    this.answered = null;
    this.worker.postMessage({ kind: "forget" });
    this.go();
  }

  receive(answer) {
    if (answer.kind === "ready") this.isReady = true;
    if (answer.kind === "clip") {
      this.loading.delete(answer.index);
      this.loaded.add(answer.index);
    }
    if (answer.kind === "missing") {
      this.isBusy = false;
      this.loaded.delete(answer.index);
    }
    if (answer.kind === "failed") {
      if (answer.of === "clip") this.fail(answer.index, `A clip is damaged: ${answer.message}`);
      else this.stop(answer.message);
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
