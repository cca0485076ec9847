// Where the scene's bytes come from: the page itself, files that a server sends, or scripts in a folder on a disk.

const STALLED_MS = 15000; // without a byte

class LoadError extends Error {
  /** isFinal: asking again would not help. */
  constructor(message, isFinal) {
    super(message);
    this.isFinal = isFinal;
  }
}

class Blocks {
  /** header: folder is the URL of the data folder, or null where everything is in the page. */
  constructor(header) {
    this.header = header;
    this.folder = header.folder;
    this.isStreamed = Boolean(this.folder) && location.protocol !== "file:";
    this.nReceived = 0; // bytes, of a server
    this.waiting = new Map();
    window.clipgstreamBlock = (name, text) => {
      const taken = this.waiting.get(name);
      if (taken) taken(text);
    };
  }

  about(key) {
    return key === "shared" ? { name: "shared", parts: this.header.shared.parts } : this.header.clips[key];
  }

  /**
   * Levels of a block, from `first` to before `upTo`, or more where they cannot be had alone.
   * onLevels(first, data): packed bytes of one level or several, or base64 of all. Rejects with a LoadError, or as the
   * signal is aborted.
   */
  async load(key, first, upTo, signal, onLevels) {
    const { name, parts } = this.about(key), inPage = document.getElementById(`block-${name}`);
    if (inPage) onLevels(0, inPage.textContent);
    else if (this.isStreamed) await this.fetched(name, parts, first, upTo, signal, onLevels);
    else onLevels(0, await this.script(name));
  }

  /** A range of a file. A server that knows no ranges sends all of it, of which the beginning is read over. */
  async fetched(name, parts, first, upTo, signal, onLevels) {
    const ends = [0];
    for (const [nPacked] of parts) ends.push(ends.at(-1) + nPacked);
    const file = `${this.folder}/${name}.bin`, shown = decodeURI(file), headers = { Range: `bytes=${ends[first]}-${ends[upTo] - 1}` };
    const stall = new AbortController(), stop = () => stall.abort();
    signal.addEventListener("abort", stop);
    let timer = setTimeout(stop, STALLED_MS);
    try {
      const response = await fetch(file, { headers, signal: stall.signal });
      const isFinal = response.status >= 400 && response.status < 500 && ![408, 425, 429].includes(response.status);
      if (!response.ok) throw new LoadError(`${shown} cannot be read (HTTP ${response.status}).`, isFinal);
      const isRange = response.status === 206, reader = response.body.getReader();
      if (isRange && !(response.headers.get("Content-Range") || `bytes ${ends[first]}-`).startsWith(`bytes ${ends[first]}-`)) {
        throw new LoadError(`${shown} was sent in another range than was asked for.`, true);
      }
      const wanted = new Uint8Array(ends[upTo] - ends[first]);
      let at = isRange ? ends[first] : 0, level = first;
      while (level < upTo) {
        const { done, value } = await reader.read();
        if (done) throw new LoadError(`${shown} ended after ${at} of ${ends[upTo]} bytes.`, false);
        clearTimeout(timer);
        timer = setTimeout(stop, STALLED_MS);
        this.nReceived += value.length;
        const skipped = Math.min(Math.max(ends[first] - at, 0), value.length);
        const from = Math.max(at + skipped - ends[first], 0), part = value.subarray(skipped, skipped + wanted.length - from);
        wanted.set(part, from);
        at += value.length;
        while (level < upTo && at >= ends[level + 1]) {
          onLevels(level, wanted.slice(ends[level] - ends[first], ends[level + 1] - ends[first]));
          level++;
        }
      }
    } catch (error) {
      if (error instanceof LoadError || signal.aborted) throw error;
      throw new LoadError(`${shown} cannot be read: ${stall.signal.aborted ? "the server does not answer" : error.message}.`, false);
    } finally {
      stop(); // what was not read does not come any more
      clearTimeout(timer);
      signal.removeEventListener("abort", stop);
    }
  }

  /** Text of a block. Pages from a disk may not fetch files, but they may load scripts, so blocks are scripts too. */
  script(name) {
    return new Promise((resolve, reject) => {
      const script = document.createElement("script");
      const done = (answer) => {
        this.waiting.delete(name);
        script.remove();
        answer();
      };
      this.waiting.set(name, (text) => done(() => resolve(text)));
      script.onerror = () => done(() => reject(new LoadError(`${decodeURI(this.folder)}/${name}.js cannot be read.`, true)));
      script.onload = () => this.waiting.has(name) && script.onerror();
      script.src = `${this.folder}/${name}.js`;
      document.head.append(script);
    });
  }
}
