// The scrub bar: clips as bands, the frame that is shown, and the frame that is wanted where that is another one.

class Timeline {
  /** onFrame(frame): the user wants this one. */
  constructor(header, nFrames, onFrame) {
    this.bar = document.getElementById("scrub");
    this.nFrames = nFrames;
    this.bar.setAttribute("aria-valuemax", nFrames - 1);
    const bands = document.getElementById("bands");
    let band = null, first = null;
    for (const clip of header.clips) {
      if (first === null || first.clip_index !== clip.clip_index) {
        band = document.createElement("div");
        band.style.left = `${(100 * clip.first) / nFrames}%`;
        band.textContent = `Clip ${clip.clip_index}`;
        bands.append(band);
        first = clip;
      }
      band.style.width = `${(100 * (clip.first + clip.moving.n.length - first.first)) / nFrames}%`;
    }
    const pick = (event) => {
      const box = this.bar.getBoundingClientRect();
      onFrame(Math.floor(((event.clientX - box.left) / box.width) * nFrames));
    };
    this.bar.addEventListener("pointerdown", (event) => {
      if (event.button > 0) return;
      this.bar.setPointerCapture(event.pointerId);
      pick(event);
    });
    this.bar.addEventListener("pointermove", (event) => this.bar.hasPointerCapture(event.pointerId) && pick(event));
  }

  show(shown, wanted, text) {
    const place = (frame) => `${(100 * (frame + 0.5)) / this.nFrames}%`;
    const playhead = document.getElementById("playhead"), marker = document.getElementById("wanted");
    playhead.hidden = shown === null;
    marker.hidden = wanted === shown;
    marker.style.left = place(wanted);
    if (shown === null) return;
    playhead.style.left = place(shown);
    this.bar.setAttribute("aria-valuenow", shown);
    this.bar.setAttribute("aria-valuetext", text);
  }
}
