// Draws Gaussians with WebGPU, where a graphics card has it: splats.wgsl. Sorting is done there too, so that turning the view
// asks nothing of the worker. As of Renderer from outside.

const GROUP = 256, PAIR_BYTES = 8, ROW_BYTES = 16 * TEXELS_PER_ROW, ELLIPSE_BYTES = 48, STEP_BYTES = 256;
const VIEW_FLOATS = 28;
const ANSWER_MS = 4000; // later than that, a device is not waited for

/** A device of WebGPU, or nothing where there is none. */
function graphicsDevice() {
  const late = new Promise((done) => setTimeout(done, ANSWER_MS));
  return Promise.race([askedDevice(), late]).catch(() => null);
}

/** The same; it may reject, or never answer. Where the processor plays the device, there is none: to paint is faster. */
async function askedDevice() {
  const gl = navigator.gpu && document.createElement("canvas").getContext("webgl2");
  if (!gl || isSoftware(gl)) return null; // nothing is asked for in vain, which browsers warn about
  const adapter = await navigator.gpu.requestAdapter({ powerPreference: "high-performance" });
  if (!adapter || (adapter.info?.isFallbackAdapter ?? adapter.isFallbackAdapter)) return null; // older browsers have it there
  const { maxBufferSize, maxStorageBufferBindingSize } = adapter.limits;
  return adapter.requestDevice({ requiredLimits: { maxBufferSize, maxStorageBufferBindingSize } });
}

class GpuRenderer {
  /** Are textures of so many lines not too much for a device? */
  static canHold({ limits }, nLines) {
    const nRows = ROWS_PER_LINE * nLines;
    return nRows * ROW_BYTES <= limits.maxStorageBufferBindingSize && pairsOf(nRows) <= GROUP * limits.maxComputeWorkgroupsPerDimension;
  }

  /** device: as of graphicsDevice; nLines: as of Renderer, so many that it can hold. May throw, and calls
   * onFailed(error) whenever the device refuses something or goes away: then nothing that it draws is to be trusted. */
  constructor(device, canvas, source, background, nLines, onFailed) {
    const nRows = ROWS_PER_LINE * Math.max(nLines, 1);
    Object.assign(this, { device, canvas, background });
    device.lost.then(({ message }) => onFailed(new Error(message)));
    device.addEventListener("uncapturederror", (event) => {
      event.preventDefault();
      onFailed(event.error);
    });
    this.sortsItself = true;
    this.isSoftware = this.isBusy = false;
    this.fullMs = this.nStill = this.firstMoving = this.nMoving = 0;
    this.size = [0, 0];
    this.context = canvas.getContext("webgpu");
    const format = navigator.gpu.getPreferredCanvasFormat();
    this.context.configure({ device, format, alphaMode: "opaque" });
    this.nPairs = pairsOf(nRows);
    this.buffers(nRows);
    this.pipelines(device.createShaderModule({ code: source }), format);
  }

  buffers(nRows) {
    const { STORAGE, COPY_DST, UNIFORM, INDIRECT } = GPUBufferUsage;
    const buffer = (size, usage) => this.device.createBuffer({ size, usage });
    this.rows = buffer(nRows * ROW_BYTES, STORAGE | COPY_DST);
    this.colors = buffer(nRows * 16, STORAGE | COPY_DST);
    this.ellipses = buffer(nRows * ELLIPSE_BYTES, STORAGE);
    this.pairs = buffer(this.nPairs * PAIR_BYTES, STORAGE);
    this.arguments = buffer(16, STORAGE | COPY_DST | INDIRECT);
    this.view = buffer(4 * VIEW_FLOATS, UNIFORM | COPY_DST);
    this.steps = [{ run: 2 * GROUP, reach: 1, isNear: true }]; // of the sort
    for (let run = 4 * GROUP; run <= this.nPairs; run *= 2) {
      let reach = run / 2;
      for (; reach > GROUP; reach /= 2) this.steps.push({ run, reach, isNear: false });
      this.steps.push({ run, reach: run / 2, isNear: true });
    }
    this.stepValues = buffer(this.steps.length * STEP_BYTES, UNIFORM | COPY_DST);
    const values = new Uint32Array((this.steps.length * STEP_BYTES) / 4);
    this.steps.forEach(({ run, reach }, i) => values.set([run, reach], (i * STEP_BYTES) / 4));
    this.device.queue.writeBuffer(this.stepValues, 0, values);
  }

  pipelines(module, format) {
    const { device } = this, { COMPUTE, VERTEX, FRAGMENT } = GPUShaderStage;
    const layout = (visibility, ...kinds) =>
      device.createBindGroupLayout({
        entries: kinds.map((kind, binding) => ({
          binding,
          visibility,
          ...(kind === "texture" ? { texture: { sampleType: "unfilterable-float" } } : { buffer: kind }),
        })),
      });
    const uniform = { type: "uniform" }, read = { type: "read-only-storage" }, write = { type: "storage" };
    const rows = layout(COMPUTE, uniform, read, read, write, write, write);
    const step = layout(COMPUTE, { type: "uniform", hasDynamicOffset: true });
    const shown = layout(VERTEX, uniform, read, read);
    this.finishedLayout = layout(FRAGMENT, "texture");
    const sorting = device.createPipelineLayout({ bindGroupLayouts: [rows, step] });
    const compute = (entryPoint) => device.createComputePipeline({ layout: sorting, compute: { module, entryPoint } });
    [this.project, this.sortFar, this.sortNear] = ["project", "sort_far", "sort_near"].map(compute);
    const over = { srcFactor: "one", dstFactor: "one-minus-src-alpha" };
    const render = (group, vertex, fragment, target) =>
      device.createRenderPipeline({
        layout: device.createPipelineLayout({ bindGroupLayouts: [group] }),
        vertex: { module, entryPoint: vertex },
        fragment: { module, entryPoint: fragment, targets: [target] },
        primitive: { topology: "triangle-strip" },
      });
    this.drawing = render(shown, "corner_of", "color_of", { format: "rgba16float", blend: { color: over, alpha: over } });
    this.presenting = render(this.finishedLayout, "whole", "present", { format });
    const group = (of, ...bound) =>
      device.createBindGroup({ layout: of, entries: bound.map((buffer, binding) => ({ binding, resource: { buffer } })) });
    this.rowGroup = group(rows, this.view, this.rows, this.colors, this.ellipses, this.pairs, this.arguments);
    this.shownGroup = group(shown, this.view, this.ellipses, this.pairs);
    this.stepGroup = device.createBindGroup({
      layout: step,
      entries: [{ binding: 0, resource: { buffer: this.stepValues, size: 8 } }],
    });
  }

  /** See Renderer. */
  take(answer) {
    const { queue } = this.device;
    [this.nStill, this.nMoving] = answer.nSeen;
    if (!answer.movingGeometry) return;
    const first = (this.firstMoving = ROWS_PER_LINE * lines(answer.nStill));
    if (answer.stillGeometry) queue.writeBuffer(this.rows, 0, answer.stillGeometry);
    if (answer.stillColors) queue.writeBuffer(this.colors, 0, answer.stillColors);
    queue.writeBuffer(this.rows, first * ROW_BYTES, answer.movingGeometry);
    queue.writeBuffer(this.colors, first * 16, answer.movingColors);
  }

  resize() {
    const { canvas, device } = this;
    if (this.size[0] === canvas.width && this.size[1] === canvas.height) return;
    this.size = [canvas.width, canvas.height];
    if (this.target) this.target.destroy();
    const { RENDER_ATTACHMENT, TEXTURE_BINDING } = GPUTextureUsage;
    this.target = device.createTexture({ size: this.size, format: "rgba16float", usage: RENDER_ATTACHMENT | TEXTURE_BINDING });
    const entries = [{ binding: 0, resource: this.target.createView() }];
    this.finished = device.createBindGroup({ layout: this.finishedLayout, entries });
  }

  isDone() {
    return !this.isBusy;
  }

  /** See Renderer. */
  draw(lens, near, isFull = true) {
    const { device, nPairs } = this;
    this.resize();
    const values = new Float32Array(VIEW_FLOATS), m = lens.worldToCamera;
    values.set([0, 1, 2, 3].flatMap((column) => [0, 1, 2, 3].map((row) => m[4 * row + column])));
    values.set([...lens.focal, ...lens.center, ...this.size, near], 16);
    new Uint32Array(values.buffer).set([this.nStill, this.firstMoving, this.firstMoving + this.nMoving], 23);
    device.queue.writeBuffer(this.view, 0, values);
    device.queue.writeBuffer(this.arguments, 0, new Uint32Array([4, 0, 0, 0]));
    const commands = device.createCommandEncoder(), compute = commands.beginComputePass();
    compute.setBindGroup(0, this.rowGroup);
    compute.setBindGroup(1, this.stepGroup, [0]);
    compute.setPipeline(this.project);
    compute.dispatchWorkgroups(nPairs / GROUP);
    this.steps.forEach(({ isNear }, i) => {
      compute.setPipeline(isNear ? this.sortNear : this.sortFar);
      compute.setBindGroup(1, this.stepGroup, [i * STEP_BYTES]);
      compute.dispatchWorkgroups(nPairs / (2 * GROUP));
    });
    compute.end();
    const [r, g, b] = this.background, clearValue = { r, g, b, a: 1 };
    const pass = (view) =>
      commands.beginRenderPass({ colorAttachments: [{ view, clearValue, loadOp: "clear", storeOp: "store" }] });
    const drawing = pass(this.target.createView());
    drawing.setPipeline(this.drawing);
    drawing.setBindGroup(0, this.shownGroup);
    drawing.drawIndirect(this.arguments, 0);
    drawing.end();
    const presenting = pass(this.context.getCurrentTexture().createView());
    presenting.setPipeline(this.presenting);
    presenting.setBindGroup(0, this.finished);
    presenting.draw(4);
    presenting.end();
    device.queue.submit([commands.finish()]);
    const begunMs = performance.now();
    this.isBusy = true;
    const done = () => {
      const tookMs = performance.now() - begunMs;
      if (isFull && tookMs < HIDDEN_MS) this.fullMs = tookMs;
      this.isBusy = false;
    };
    device.queue.onSubmittedWorkDone().then(done, done); // refused where the card has gone away, which is said elsewhere
  }
}

/** So many are sorted to have so many rows in order: a power of two. */
function pairsOf(nRows) {
  return Math.max(2 * GROUP, 2 ** Math.ceil(Math.log2(nRows)));
}
