// The scrub bar: clips as bands, the frame that is shown, and the frame that is wanted where that is another one.

class Timeline {
  /** stored(frame): the stored frame that is shown then; onFrame(frame): the user wants this one. */
  constructor(header, nFrames, stored, onFrame) {
    this.bar = document.getElementById("scrub");
    this.nFrames = nFrames;
    this.bar.setAttribute("aria-valuemax", nFrames - 1);
    const bands = document.getElementById("bands");
    this.starts = []; // frames at which a clip begins
    const clipAt = (frame) => header.clips.findIndex((clip) => stored(frame) < clip.first + clip.moving.n.length);
    let band = null, first = 0, before = null, place = -1;
    for (let frame = 0; frame < nFrames; frame++) {
      const at = clipAt(frame), clip = header.clips[at];
      if (at !== place) this.starts.push(frame);
      if (before !== clip.clip_index) {
        band = document.createElement("div");
        band.style.left = `${(100 * frame) / nFrames}%`;
        band.textContent = `Clip ${clip.clip_index}`;
        bands.append(band);
        first = frame;
      }
      band.style.width = `${(100 * (frame + 1 - first)) / nFrames}%`;
      before = clip.clip_index;
      place = at;
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
