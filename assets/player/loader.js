// Loads what is needed, the most urgent first. What is not needed any more is given up, and what fails is tried again;
// until then it is in nobody's way.

const MAX_REQUESTS = 2; // at once; more would only share the line
const MAX_TRIES = 6;
const FIRST_WAIT_MS = 500; // twice as long after each try
const LONGEST_WAIT_MS = 8000;

class Loader {
  /** onLevels(key, first, data): see Blocks.load; onChange(): ask again. */
  constructor(blocks, { onLevels, onChange }) {
    Object.assign(this, { blocks, onLevels, onChange });
    this.levels = new Map(); // how many of each block arrived
    this.running = new Map();
    this.failures = new Map(); // by block: {tries, message, isFinal, againMs}
    this.bytesPerS = null; // of the line, once it is known
  }

  nArrived(key) {
    return this.levels.get(key) || 0;
  }

  /** What stands in the way of a block; null where nothing does. */
  failure(key) {
    return this.failures.get(key) || null;
  }

  /** needs: [{key, upTo, rank}] the most urgent first; those of a rank wait until all of lower ones are there or have failed. */
  ask(needs) {
    const missing = needs.filter((need) => this.nArrived(need.key) < need.upTo && !this.failure(need.key)?.isFinal);
    const waits = missing.map(({ key }) => (this.failure(key)?.againMs ?? 0) - performance.now());
    const open = missing.filter((_, i) => waits[i] <= 0);
    clearTimeout(this.timer);
    if (open.length < missing.length) this.timer = setTimeout(this.onChange, Math.min(...waits.filter((wait) => wait > 0)));
    const rank = Math.min(...open.map((need) => need.rank));
    const now = open.filter((need) => need.rank === rank);
    for (const [key, request] of this.running) {
      if (this.blocks.isStreamed && !now.some((need) => need.key === key)) request.abort();
    }
    for (const need of now) {
      if (this.running.size >= MAX_REQUESTS) break;
      if (!this.running.has(need.key)) this.start(need);
    }
  }

  async start({ key, upTo }) {
    const controller = new AbortController(), { signal } = controller;
    this.running.set(key, controller);
    try {
      const begunMs = performance.now(), nBefore = this.blocks.nReceived; // of all requests: they share the line
      await this.blocks.load(key, this.nArrived(key), upTo, signal, (first, data) => {
        if (signal.aborted) return;
        const n = typeof data === "string" ? this.blocks.about(key).parts.length : first + 1;
        this.levels.set(key, Math.max(n, this.nArrived(key)));
        this.failures.delete(key);
        this.onLevels(key, first, data);
      });
      this.measure(this.blocks.nReceived - nBefore, performance.now() - begunMs);
    } catch (error) {
      if (!signal.aborted) this.fail(key, error.message, error.isFinal !== false);
    }
    this.running.delete(key);
    this.onChange();
  }

  fail(key, message, isFinal) {
    const tries = (this.failure(key)?.tries || 0) + 1, wait = Math.min(FIRST_WAIT_MS * 2 ** (tries - 1), LONGEST_WAIT_MS);
    this.failures.set(key, { tries, message, isFinal: isFinal || tries >= MAX_TRIES, againMs: performance.now() + wait });
  }

  /** Try everything again that failed. */
  again() {
    this.failures.clear();
    this.onChange();
  }

  /** What failed is asked for now, once; for what has come to be wanted most. */
  hurry(key) {
    if (this.failures.has(key)) Object.assign(this.failure(key), { isFinal: false, againMs: 0 });
  }

  /** The worker does not have a block any more. */
  forget(key) {
    this.running.get(key)?.abort(); // what it would bring belongs to what is gone
    this.levels.delete(key);
  }

  measure(nBytes, tookMs) {
    if (nBytes < 20000 || tookMs <= 0) return;
    const rate = nBytes / (tookMs / 1000);
    this.bytesPerS = this.bytesPerS === null ? rate : 0.7 * this.bytesPerS + 0.3 * rate;
  }
}
