// Ties it together: what is wanted, what is shown, and the words that say so. The label belongs to the picture that is
// shown, never to the playhead.

const SLOW_MS = 60; // where a picture takes longer, as in software, half as many lines are drawn while something moves
const VERY_SLOW_MS = 300; // then fewer Gaussians still
const REST_MS = 250; // after so long without a move a picture is drawn in full
const GOOD_PIXELS = 3 << 20; // more of them are not drawn on screens with very small ones

class Player {
  constructor(header, shaders, workerSource, device) {
    this.header = header;
    this.canvas = document.getElementById("picture");
    const nFrames = header.take ? header.take.length : header.clips.reduce((n, clip) => n + clip.moving.n.length, 0);
    const most = (numbers) => Math.max(0, ...numbers);
    const nStill = header.shared.n + most(header.clips.map((clip) => (clip.own ? clip.own.n : 0)));
    const nMoving = most(header.clips.flatMap((clip) => clip.moving.n));
    this.view = new View(header);
    this.clock = new Clock(nFrames, header.fps / header.step);
    this.timeline = new Timeline(header, nFrames, (frame) => this.stored(frame), (frame) => this.go(frame));
    this.shown = null; // frame that the renderer holds, of the take where there is one
    this.onScreen = null; // frame of the picture on the screen
    this.isLost = this.isDrawn = false;
    this.share = 1; // of the screen's pixels, along a side
    this.movedMs = -REST_MS;
    this.scheduled = 0;
    this.pictures = new Pictures(header, new Blocks(header), workerSource, {
      upcoming: () => this.upcoming(),
      onPicture: (answer) => this.take(answer),
      onNotice: (text, canRetry) => notify(text, canRetry),
    });
    followAddress(this);
    followEmbedder(this);
    this.pictures.want(this.stored(this.clock.frame), [0, 0, 1, 0]); // loads while shaders are compiled
    notify("Loading \u2026");
    this.shaders = shaders;
    this.nLines = lines(nStill) + lines(nMoving);
    this.followCanvas();
    this.device = device && GpuRenderer.canHold(device, this.nLines) ? device : null;
    try {
      if (this.device) this.useGpu();
      else this.useGl();
    } catch (error) {
      this.pictures.stop(error.message);
      throw error;
    }
    this.pictures.wish = null; // until the next tick says how it is drawn
    this.headset = new Headset(this, document.getElementById("headset"));
    fillControls(this);
    const table = keyTable(this);
    fillKeySheet(table);
    followKeys(table);
    this.changed();
  }

  // ---- what draws

  useGl() {
    const renderer = new Renderer(this.canvas, this.shaders, this.header.background, this.nLines);
    if (this.headset?.session) this.headset.pageRenderer = renderer; // which draws with another one
    else this.renderer = renderer;
  }

  useGpu() {
    const { device, canvas, shaders, header, nLines } = this;
    this.attempt(() => {
      this.renderer = new GpuRenderer(device, canvas, shaders["splats.wgsl"], header.background, nLines, (error) => this.leaveGpu(error));
    });
  }

  /** Does it succeed? What WebGPU throws is a reason to leave it. */
  attempt(act) {
    const { device } = this;
    try {
      act();
    } catch (error) {
      if (!device) throw error;
      this.leaveGpu(error);
    }
    return this.device === device;
  }

  /** WebGPU has failed, for whatever reason: WebGL goes on with the same frame and view, on a canvas that was not WebGPU's. */
  leaveGpu(error) {
    const { device, canvas, pictures } = this;
    if (!device) return; // one reason makes several errors
    console.warn(error);
    this.device = null;
    device.destroy();
    const hasFocus = document.activeElement === canvas;
    this.canvas = canvas.cloneNode();
    canvas.replaceWith(this.canvas);
    if (hasFocus) this.canvas.focus({ preventScroll: true });
    this.followCanvas();
    try {
      this.useGl();
    } catch (reason) {
      pictures.stop(reason.message);
      return;
    }
    pictures.interrupt("WebGPU has failed in this browser, so the page draws with WebGL 2.", SAID_MS);
    if (this.headset?.session) return; // everything is sent again when it ends
    pictures.forget();
    this.shown = this.onScreen = null;
    this.changed();
  }

  // ---- what is shown

  /** Have as many pixels as the screen shows. */
  fit() {
    const { canvas } = this, width = canvas.clientWidth, height = canvas.clientHeight;
    const sharp = Math.max(1, Math.sqrt(GOOD_PIXELS / Math.max(width * height, 1)));
    const ratio = this.share * Math.min(devicePixelRatio, sharp);
    const size = [width, height].map((length) => Math.max(1, Math.round(length * ratio)));
    if (canvas.width === size[0] && canvas.height === size[1]) return;
    [canvas.width, canvas.height] = size; // which clears it
    this.isDrawn = false;
  }

  /** What is done to the canvas, and its size, which changes with the window, with zooming, and from screen to screen. */
  followCanvas() {
    followPointer(this.canvas, this.view, () => this.moved());
    this.followContext(this.canvas);
    const observer = new ResizeObserver(() => this.changed());
    try {
      observer.observe(this.canvas, { box: "device-pixel-content-box" });
    } catch {
      observer.observe(this.canvas); // Safari does not know that box
      addEventListener("resize", () => this.changed());
    }
  }

  /** Something that is seen has changed: draw once, soon. */
  changed() {
    this.isDrawn = false;
    this.schedule();
  }

  schedule() {
    if (!this.scheduled) this.scheduled = requestAnimationFrame((nowMs) => this.tick(nowMs));
  }

  /** The same, by somebody who goes on moving. */
  moved() {
    this.movedMs = performance.now();
    this.changed();
  }

  passTime(nowMs) {
    this.clock.tell(nowMs, this.pictures.isWaitingFor(this.stored(this.clock.frame)));
    for (const name of ["shown", "onScreen"]) // the same picture may come several times
      if (this[name] !== null && this.stored(this[name]) === this.stored(this.clock.frame)) this[name] = this.clock.frame;
  }

  tick(nowMs) {
    this.scheduled = 0;
    if (!this.renderer || this.headset.session) return; // which has its own pace
    this.passTime(nowMs);
    const isReady = this.renderer.isDone();
    if (isReady) {
      const isMoving = this.clock.isPlaying || performance.now() - this.movedMs < REST_MS;
      this.share = isMoving && this.renderer.fullMs > SLOW_MS ? 0.5 : 1;
      this.fit();
    }
    const lens = this.view.lens(this.canvas.width, this.canvas.height);
    const { isSoftware, sortsItself } = this.renderer, row = sortsItself ? null : lens.worldToCamera.slice(8, 12);
    const view = { ...lens, size: [this.canvas.width, this.canvas.height], isFull: this.share === 1 };
    this.pictures.isPlaying = this.clock.isPlaying;
    const atMost = this.share === 1 ? Infinity : this.renderer.fullMs > VERY_SLOW_MS ? 1 : 2;
    this.pictures.want(this.stored(this.clock.frame), row, atMost, isSoftware ? view : null);
    const isWanted = !this.isDrawn && !this.isLost && this.shown !== null;
    if (isWanted && isReady && this.attempt(() => this.renderer.draw(lens, this.header.near_plane, this.share === 1))) {
      this.isDrawn = true;
      document.getElementById("poster")?.remove();
      this.onScreen = this.shown;
    }
    this.tell();
    clearTimeout(this.rest);
    if (this.clock.isPlaying || (isWanted && !isReady) || !this.renderer.isDone()) this.schedule();
    else if (this.share < 1) this.rest = setTimeout(() => this.changed(), REST_MS);
  }

  take(answer) {
    if (this.isLost || !this.attempt(() => this.renderer.take(answer))) return;
    const { take } = this.header, now = this.clock.frame;
    this.shown = take ? (take[now] === answer.frame ? now : take.indexOf(answer.frame)) : answer.frame;
    this.changed();
  }

  /** Clips that are played next, in their order. */
  upcoming() {
    const { starts } = this.timeline, { frame, isLooping } = this.clock;
    const later = starts.filter((start) => start > frame), around = isLooping ? starts.filter((start) => start <= frame) : [];
    return [...new Set([...later, ...around].map((start) => this.pictures.clipOf(this.stored(start))))];
  }

  /** The stored frame that one of the take shows. */
  stored(frame) {
    return this.header.take ? this.header.take[frame] : frame;
  }

  /** Words and marks about what is on the screen. */
  tell() {
    const { onScreen: shown, header, clock } = this;
    const number = (frame) => {
      if (header.take) return frame * header.step;
      const clip = header.clips[this.pictures.clipOf(frame)];
      return clip.frame_index + (frame - clip.first) * header.step;
    };
    const text = shown === null ? "" : `Frame ${number(shown)} of ${number(clock.nFrames - 1)}`;
    const seconds = shown === null ? "" : `${(number(shown) / header.fps).toFixed(2)} s`;
    document.getElementById("time").textContent = shown === null ? "" : `${text} \u00b7 ${seconds}`;
    this.timeline.show(shown, clock.frame, `${text}, ${seconds}`);
    document.getElementById("play").setAttribute("aria-label", clock.isPlaying ? "Pause" : "Play");
    document.getElementById("loop").setAttribute("aria-pressed", clock.isLooping);
    document.getElementById("speed").value = clock.speed;
    document.getElementById("quality").value = this.pictures.quality;
    document.getElementById("camera").value = this.view.camera === null ? "" : this.view.camera;
  }

  // ---- what the user does

  go(frame) {
    this.clock.go(frame);
    this.moved();
  }

  goToSecond(seconds) {
    this.go(Math.floor(seconds * this.clock.fps + 1e-6));
  }

  goToClip(steps) {
    const starts = this.timeline.starts, now = this.clock.frame;
    const target = steps > 0 ? starts.find((start) => start > now) : starts.filter((start) => start < now).pop();
    if (target !== undefined) this.go(target);
  }

  play(isPlaying) {
    this.clock.play(isPlaying);
    this.changed();
  }

  loop(isLooping) {
    this.clock.isLooping = isLooping;
    this.changed();
  }

  changeSpeed(steps) {
    this.clock.faster(steps);
    this.changed();
  }

  look(camera, isHome = false) {
    if (isHome) this.view.home();
    else if (camera === null) this.view.leave();
    else if (camera < this.header.cameras.length) this.view.look(camera);
    this.changed();
  }

  nextCamera(steps) {
    const n = this.header.cameras.length, before = this.view.camera;
    if (n) this.look(before === null ? (steps > 0 ? 0 : n - 1) : (before + steps + n) % n);
  }

  fillScreen() {
    if (document.fullscreenElement) document.exitFullscreen();
    else if (document.documentElement.requestFullscreen) document.documentElement.requestFullscreen().catch(() => {});
  }

  help() {
    const sheet = document.getElementById("keys");
    sheet.showModal();
    sheet.scrollTop = 0; // on a low screen the button at its end, which has the focus, was scrolled to
  }

  /** A driver may take the context away, as when a laptop wakes up; everything is sent again then. */
  followContext(canvas) {
    canvas.addEventListener("webglcontextlost", (event) => {
      if (this.renderer?.canvas !== canvas) return; // of a headset that was put down
      event.preventDefault();
      this.isLost = true;
      this.shown = this.onScreen = null;
      if (this.headset.isPlaced) this.headset.session.end().catch(() => {}); // its pictures went with the context
    });
    canvas.addEventListener("webglcontextrestored", () => {
      if (this.renderer.canvas !== canvas) return;
      this.isLost = false;
      this.renderer.begin();
      this.pictures.forget();
      this.changed();
    });
  }
}

/** Words over the picture, which screen readers are told too; canRetry: with a button to try again. */
function notify(text, canRetry = false) {
  const by = (id) => document.getElementById(id);
  for (const [id, said] of [["words", text], ["status", text || "The scene is shown."]]) {
    if (by(id).textContent !== said) by(id).textContent = said;
  }
  by("again").hidden = !canRetry;
  by("notice").hidden = !text;
}

function missing() {
  if (typeof DecompressionStream === "undefined") return "unpack the scene (DecompressionStream)";
  if (typeof Worker === "undefined" || typeof ResizeObserver === "undefined") return "run its parts side by side";
  return "";
}

async function begin() {
  const part = (id) => document.getElementById(id).textContent;
  const lacks = missing();
  try {
    if (lacks) throw new Error(`This browser cannot ${lacks}. A version of 2023 or later can.`);
    const header = JSON.parse(part("header")), shaders = JSON.parse(part("shaders"));
    window.clipgstreamPlayer = new Player(header, shaders, part("worker"), await graphicsDevice());
  } catch (error) {
    notify(error.message);
  }
}

begin();
