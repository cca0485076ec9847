// In a headset: a session of WebXR, both eyes, and going about with controllers. Lengths are metres unless a name says so.

const SNAP_TURN = Math.PI / 6;
const PUSHED = 0.7, RELEASED = 0.4; // of a thumbstick
const THROW_M_S = 7, FALL_M_S2 = 9.81; // of the arc that shows where one will stand
const ARC_STEPS = 24, RING_STEPS = 32, ARC_WIDTH_M = 0.015, RING_M = [0.22, 0.28];
const MARK_COLOR = [0.337, 0.706, 0.914, 0.9];
const EYE_HEIGHT_M = 1.6; // where the floor is not known
const SORT_TURN = 0.01, SORT_WAY = 0.002; // radians, and of the scene's radius: less does not change the order visibly
const SLOW_FRAMES = 30, LATE = 1.4, LEAST_SHARE = 0.5; // fewer lines are drawn after so many frames that come so late
const NEAREST_HANDS_M = 0.05; // nearer ones would resize by chance
const BUTTON_A = 4, BUTTON_B = 5;
const SAID_MS = 8000; // so long words are there that nothing else takes away
const WAY_TO_RESIZE = "Squeeze both controllers and pull them apart or together to change its size.";

class Headset {
  constructor(player, button) {
    this.player = player;
    this.button = button;
    this.session = null;
    this.isPlaced = false; // in the scene
    const { is_measured } = player.header.stage;
    this.advice = `${is_measured ? "The scene has its true size at first." : "The size of the scene is a guess."} ${WAY_TO_RESIZE}`;
    button.title = `Stand in the scene. ${this.advice}`;
    button.onclick = () => this.begin();
    if (!navigator.xr) return;
    this.look();
    if (navigator.xr.addEventListener) navigator.xr.addEventListener("devicechange", () => this.look());
  }

  /** The button is there where a headset is. */
  async look() {
    this.button.hidden = !(await navigator.xr.isSessionSupported("immersive-vr").catch(() => false));
  }

  async begin() {
    const { player, button } = this;
    if (this.session || button.disabled) return;
    button.disabled = true;
    try {
      this.session = await navigator.xr.requestSession("immersive-vr", { optionalFeatures: ["local-floor"] });
      await this.start();
      player.pictures.interrupt(this.advice, SAID_MS);
    } catch (error) {
      if (this.session) await this.session.end().catch(() => {});
      this.session = null;
      player.pictures.interrupt(`The headset did not start: ${error.message}`, SAID_MS);
    }
    button.disabled = false;
  }

  async start() {
    const { session, player } = this;
    this.pageRenderer = player.renderer;
    session.addEventListener("end", () => this.end());
    if (!(player.renderer instanceof Renderer)) { // sessions draw with WebGL
      player.renderer = new Renderer(document.createElement("canvas"), player.shaders, player.header.background, player.nLines);
      player.followContext(player.renderer.canvas);
    }
    player.pictures.forget(); // the page may have been painted, or sorted elsewhere
    const { gl } = player.renderer;
    session.addEventListener("select", (event) => this.select(event));
    this.squeezing = new Set();
    this.apart = null; // how far from each other two squeezed controllers were
    this.hasResized = false;
    session.addEventListener("squeezestart", ({ inputSource }) => this.squeezing.add(inputSource));
    session.addEventListener("squeezeend", ({ inputSource }) => {
      this.squeezing.delete(inputSource);
      if (!this.hasResized) this.play();
    });
    await gl.makeXRCompatible();
    session.updateRenderState({ baseLayer: new XRWebGLLayer(session, gl, { antialias: false, depth: false, alpha: false }) });
    this.space = await this.floor(session);
    this.stage = new Stage(player.header, player.view.levelAxes());
    this.hands = new Map(); // what each controller was doing
    this.share = 1;
    this.nLate = 0;
    this.lastMs = null;
    this.row = null;
    session.requestAnimationFrame((nowMs, frame) => this.frame(nowMs, frame));
  }

  /** Metres from the floor, which is taken to be below the head where the headset does not know it. */
  floor(session) {
    return session.requestReferenceSpace("local-floor").catch(async () => {
      const space = await session.requestReferenceSpace("local");
      return space.getOffsetReferenceSpace(new XRRigidTransform({ x: 0, y: -EYE_HEIGHT_M, z: 0 }));
    });
  }

  end() {
    const { player } = this, { renderer } = player;
    this.session = null;
    this.isPlaced = false;
    player.renderer = this.pageRenderer;
    if (renderer !== this.pageRenderer) {
      player.isLost = false; // if so, it was that one
      renderer.gl.getExtension("WEBGL_lose_context")?.loseContext(); // gives its memory back
    }
    player.pictures.forget();
    player.changed();
  }

  play() {
    this.player.play(!this.player.clock.isPlaying);
  }

  frame(nowMs, frame) {
    const { session, player } = this;
    if (!session) return;
    session.requestAnimationFrame((laterMs, later) => this.frame(laterMs, later));
    player.passTime(nowMs);
    const pose = frame.getViewerPose(this.space);
    if (!pose || player.isLost) return;
    const { matrix } = pose.transform;
    this.head = [matrix[12], matrix[13], matrix[14]];
    if (!this.isPlaced) {
      const { worldToCamera } = player.view.lens(player.canvas.width, player.canvas.height);
      this.stage.enter(worldToCamera, this.head, [-matrix[8], -matrix[9], -matrix[10]]);
      this.isPlaced = true;
    }
    const marks = [...session.inputSources].flatMap((source) => this.follow(source, frame) || []);
    if (!this.session) return; // a button ended it
    this.resize(frame);
    this.sort(this.stage.worldToCamera(pose.transform.inverse.matrix).slice(8, 12));
    this.keepPace(nowMs);
    this.draw(pose, marks);
  }

  /** Both eyes have one order, by the depth from the head; it is asked for when the head has moved. */
  sort(row) {
    const { player } = this, way = SORT_WAY * player.header.radius;
    const differs = (a, b, i) => Math.abs(a - b) > (i < 3 ? SORT_TURN : way);
    if (!this.row || row.some((value, i) => differs(value, this.row[i], i))) this.row = row;
    player.pictures.isPlaying = player.clock.isPlaying;
    player.pictures.want(player.stored(player.clock.frame), this.row);
  }

  keepPace(nowMs) {
    const dueMs = 1000 / (this.session.frameRate || 72), tookMs = this.lastMs === null ? 0 : nowMs - this.lastMs;
    this.lastMs = nowMs;
    this.nLate = tookMs > LATE * dueMs ? this.nLate + 1 : 0;
    if (this.nLate < SLOW_FRAMES) return;
    this.nLate = 0;
    this.share = Math.max(LEAST_SHARE, 0.8 * this.share);
  }

  draw(pose, marks) {
    const { player, share } = this, { renderer, header } = player, layer = this.session.renderState.baseLayer;
    for (const view of pose.views) {
      const viewport = layer.getViewport(view);
      if (!viewport || !viewport.width) continue;
      const size = [viewport.width, viewport.height].map((length) => Math.max(1, Math.round(share * length)));
      const lens = projectedLens(view.projectionMatrix, ...size), { inverse } = view.transform;
      renderer.paint({ worldToCamera: this.stage.worldToCamera(inverse.matrix), ...lens }, header.near_plane, size);
      for (const mark of marks) renderer.mark(mark, cameraRows(inverse.matrix), lens, MARK_COLOR);
      renderer.put(renderer.target.texture, layer.framebuffer, viewport);
    }
    player.onScreen = player.shown;
  }

  // ---- controllers

  /** A hand, or whatever has no thumbstick, goes where it points with its trigger; controllers play with it. */
  select({ inputSource, frame }) {
    const target = hasStick(inputSource) || !this.isPlaced ? null : this.aim(inputSource, frame);
    if (target) this.stage.go(target.point, this.head);
    else this.play();
  }

  /** What a thumbstick and buttons ask for. Returns the mark of where one will stand, or nothing. */
  follow(source, frame) {
    if (!hasStick(source)) return null;
    const { axes, buttons } = source.gamepad, [x, y] = axes.length > 3 ? axes.slice(2, 4) : axes;
    const was = this.hands.get(source) || { isTurned: false, isAiming: false, a: true, b: true };
    const now = { isTurned: Math.abs(x) > (was.isTurned ? RELEASED : PUSHED) };
    now.isAiming = y < -(was.isAiming ? RELEASED : PUSHED) && !now.isTurned;
    now.a = Boolean(buttons[BUTTON_A] && buttons[BUTTON_A].pressed);
    now.b = Boolean(buttons[BUTTON_B] && buttons[BUTTON_B].pressed);
    this.hands.set(source, now);
    if (now.isTurned && !was.isTurned) this.stage.turn(x > 0 ? -SNAP_TURN : SNAP_TURN, this.head);
    if (now.a && !was.a) this.play();
    if (now.b && !was.b) this.session.end();
    const target = now.isAiming || was.isAiming ? this.aim(source, frame) : null;
    if (target && !now.isAiming && !now.isTurned) this.stage.go(target.point, this.head);
    return target && now.isAiming ? target.strips : null;
  }

  /** The scene grows and shrinks with the way from one squeezed controller to the other. */
  resize(frame) {
    const poses = [...this.squeezing].map((source) => frame.getPose(source.targetRaySpace, this.space)), before = this.apart;
    if (!poses.length) this.hasResized = false;
    this.apart = null;
    if (poses.length < 2 || !poses.every(Boolean)) return;
    const [a, b] = poses.map(({ transform }) => transform.position);
    this.hasResized = true;
    this.apart = Math.max(NEAREST_HANDS_M, Math.hypot(a.x - b.x, a.y - b.y, a.z - b.z));
    if (before !== null) this.stage.resize(this.apart / before, this.head);
  }

  /** Where an arc from a hand lands, and the strips of triangles that show it. */
  aim(source, frame) {
    const pose = frame.getPose(source.targetRaySpace, this.space);
    if (!pose || !(pose.transform.position.y > 0)) return null;
    const { matrix } = pose.transform, speed = [8, 9, 10].map((at) => -THROW_M_S * matrix[at]);
    const from = [matrix[12], matrix[13], matrix[14]];
    const endS = (speed[1] + Math.sqrt(speed[1] ** 2 + 2 * FALL_M_S2 * from[1])) / FALL_M_S2;
    const at = (seconds) => {
      const [x, y, z] = sum(from, speed, seconds);
      return [x, y - (FALL_M_S2 / 2) * seconds ** 2, z];
    };
    const across = Math.hypot(speed[0], speed[2]) || 1, side = [-speed[2] / across, 0, speed[0] / across];
    const point = at(endS), arc = [], ring = [];
    for (let i = 0; i <= ARC_STEPS; i++) {
      const middle = at((i / ARC_STEPS) * endS);
      arc.push(...sum(middle, side, -ARC_WIDTH_M / 2), ...sum(middle, side, ARC_WIDTH_M / 2));
    }
    for (let i = 0; i <= RING_STEPS; i++) {
      const angle = (2 * Math.PI * i) / RING_STEPS, ray = [Math.cos(angle), 0, Math.sin(angle)];
      ring.push(...sum(point, ray, RING_M[0]), ...sum(point, ray, RING_M[1]));
    }
    return { point, strips: [new Float32Array(arc), new Float32Array(ring)] };
  }
}

function hasStick(source) {
  return Boolean(source.gamepad && source.gamepad.axes.length > 1 && source.targetRayMode === "tracked-pointer");
}

/** From a headset's metres to a camera with OpenCV axes, by rows. inverse: of the camera's pose, as of WebXR. */
function cameraRows(inverse) {
  return [0, 1, 2, 3].flatMap((row) => [0, 1, 2, 3].map((column) => (row === 1 || row === 2 ? -1 : 1) * inverse[4 * column + row]));
}
