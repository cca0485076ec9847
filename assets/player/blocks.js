// Where the scene's bytes come from: the page itself, or a folder beside it.

class Blocks {
  /** folder: URL of the data folder; null where everything is in the page. */
  constructor(folder) {
    this.folder = folder;
    this.waiting = new Map();
    window.clipgstreamBlock = (name, text) => {
      const taken = this.waiting.get(name);
      if (taken) taken(text);
    };
  }

  /** Text of a block. Pages from a disk may not fetch files, but they may load scripts, so blocks are scripts. */
  text(name) {
    const inPage = document.getElementById(`block-${name}`);
    if (inPage) return Promise.resolve(inPage.textContent);
    return new Promise((resolve, reject) => {
      const script = document.createElement("script");
      const done = (answer) => {
        this.waiting.delete(name);
        script.remove();
        answer();
      };
      this.waiting.set(name, (text) => done(() => resolve(text)));
      script.onerror = () => done(() => reject(new Error(`${decodeURI(this.folder)}/${name}.js cannot be read.`)));
      script.onload = () => this.waiting.has(name) && script.onerror();
      script.src = `${this.folder}/${name}.js`;
      document.head.append(script);
    });
  }
}
