// Draws Gaussians with the shaders of the window: assets/shaders/splat.vert and splat.frag, translated for WebGL 2.

const SOFTWARE = /swiftshader|llvmpipe|softpipe|swrast|microsoft basic render/i; // graphics cards that are none
const HIDDEN_MS = 5000; // nobody looked meanwhile, as in a tab in the background

/** Does the processor play the graphics card? */
function isSoftware(gl) {
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  return SOFTWARE.test(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
}

class Renderer {
  /** shaders: sources by name; nLines: of the textures, for the largest frame. Throws where the browser cannot do it; begin() again after the context was restored. */
  constructor(canvas, shaders, background, nLines) {
    this.canvas = canvas;
    this.shaders = shaders;
    this.background = background;
    this.nLines = Math.max(nLines, 1);
    const wishes = { alpha: false, antialias: false, depth: false, powerPreference: "high-performance" };
    this.gl = canvas.getContext("webgl2", wishes);
    if (!this.gl) throw new Error("WebGL 2 is not available in this browser, or it is switched off.");
    this.begin();
  }

  begin() {
    const { gl } = this;
    if (this.nLines > gl.getParameter(gl.MAX_TEXTURE_SIZE)) {
      throw new Error("There are more Gaussians than this graphics card can hold.");
    }
    const hasFloats = gl.getExtension("EXT_color_buffer_float") || gl.getExtension("EXT_color_buffer_half_float");
    this.isSoftware = isSoftware(gl); // then pictures are better painted by the worker than drawn here
    this.targetFormat = hasFloats ? gl.RGBA16F : gl.RGBA8; // many faint layers drift in 8 bits
    this.splats = this.program("splat.vert", "splat.frag");
    this.present = this.program("resolve.vert", "present.frag");
    this.marks = this.program("mark.vert", "mark.frag");
    this.geometry = this.texture(gl.RGBA32F, TEXELS_PER_ROW * ROWS_PER_LINE, this.nLines);
    this.colors = this.texture(gl.RGBA32F, ROWS_PER_LINE, this.nLines);
    this.target = this.fence = this.painted = null;
    this.fullMs = 0;
    this.nDrawn = 0;
    this.size = [0, 0];
    this.order = gl.createBuffer();
    this.quads = gl.createVertexArray();
    gl.bindVertexArray(this.quads);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    const id = gl.getAttribLocation(this.splats.program, "splat_id");
    gl.enableVertexAttribArray(id);
    gl.vertexAttribIPointer(id, 1, gl.UNSIGNED_INT, 0, 0);
    this.corners = gl.createBuffer(); // two triangles for each Gaussian, in plain triangles: instances are slow in software
    this.nCorners = 0;
    this.nothing = gl.createVertexArray();
    this.strip = gl.createVertexArray();
    this.stripPlaces = gl.createBuffer();
    gl.bindVertexArray(this.strip);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.stripPlaces);
    const place = gl.getAttribLocation(this.marks.program, "place");
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    gl.disable(gl.DEPTH_TEST);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
  }

  program(vertex, fragment) {
    const { gl } = this, program = gl.createProgram();
    for (const [kind, name] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, this.shaders[name]);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new Error(`The graphics driver refused ${name}: ${gl.getShaderInfoLog(shader)}`);
      }
      gl.attachShader(program, shader);
      gl.deleteShader(shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`The graphics driver refused ${vertex}: ${gl.getProgramInfoLog(program)}`);
    }
    const at = (name) => gl.getUniformLocation(program, name);
    return { program, at };
  }

  /** Take up what the worker answered; what it leaves out stays as it is. */
  take(answer) {
    if (answer.pixels) {
      this.takePainted(answer);
      return;
    }
    if (this.painted) this.gl.deleteTexture(this.painted);
    this.painted = null;
    if (answer.movingGeometry) {
      const first = lines(answer.nStill);
      if (answer.stillGeometry) this.write(this.geometry, TEXELS_PER_ROW, 0, answer.stillGeometry);
      if (answer.stillColors) this.write(this.colors, 1, 0, answer.stillColors);
      this.write(this.geometry, TEXELS_PER_ROW, first, answer.movingGeometry);
      this.write(this.colors, 1, first, answer.movingColors);
    }
    const { gl } = this;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.order);
    gl.bufferData(gl.ARRAY_BUFFER, answer.order, gl.DYNAMIC_DRAW);
    this.nDrawn = answer.order.length / 4;
    this.holdCorners(this.nDrawn);
  }

  /** Take up a picture that the worker painted. */
  takePainted({ pixels, size, isFull, tookMs }) {
    const { gl } = this;
    if (!this.painted) this.painted = this.smooth(gl.createTexture());
    gl.bindTexture(gl.TEXTURE_2D, this.painted);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, ...size, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(pixels.buffer));
    if (isFull) this.fullMs = tookMs;
  }

  holdCorners(n) {
    if (n <= this.nCorners) return;
    const { gl } = this, corners = new Uint32Array(6 * (this.nCorners = Math.ceil(1.25 * n)));
    for (let i = 0; i < this.nCorners; i++) corners.set([4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 2, 4 * i + 1, 4 * i + 3], 6 * i);
    gl.bindVertexArray(this.quads);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.corners);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
  }

  texture(format, width, height) {
    const { gl } = this, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return texture;
  }

  /** Between its pixels a texture is linear. */
  smooth(texture) {
    const { gl } = this;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const side of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, side, gl.LINEAR);
    for (const axis of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, axis, gl.CLAMP_TO_EDGE);
    return texture;
  }

  write(texture, texels, firstLine, values) {
    const { gl } = this, width = texels * ROWS_PER_LINE, height = values.length / (4 * width);
    if (!height) return;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, firstLine, width, height, gl.RGBA, gl.FLOAT, values);
  }

  /** Have a picture so wide and high to draw into. */
  resize(width, height) {
    const { gl } = this;
    if (this.size[0] === width && this.size[1] === height) return;
    this.size = [width, height];
    if (this.target) {
      gl.deleteTexture(this.target.texture);
      gl.deleteFramebuffer(this.target.framebuffer);
    }
    const texture = this.texture(this.targetFormat, width, height), framebuffer = gl.createFramebuffer();
    this.smooth(texture);
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    this.target = { texture, framebuffer };
  }

  /** Is the last picture finished? What comes before that only waits. */
  isDone() {
    const { gl, fence } = this;
    if (!fence || gl.isContextLost()) return true;
    if (gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) return false;
    gl.deleteSync(fence);
    this.fence = null;
    const tookMs = performance.now() - this.begunMs;
    if (this.isFull && tookMs < HIDDEN_MS) this.fullMs = tookMs;
    return true;
  }

  /**
   * Draw onto the canvas. lens: {worldToCamera: 16 numbers by rows, focal: [2], center: [2]} in pixels of the canvas; near:
   * scene units; isFull: whether the canvas has all pixels of the screen, so that fullMs is how long such a picture takes. */
  draw(lens, near, isFull = true) {
    const { gl, canvas } = this;
    if (!this.painted) this.paint(lens, near, [canvas.width, canvas.height]);
    const picture = this.painted || this.target.texture;
    this.put(picture, null, { x: 0, y: 0, width: canvas.width, height: canvas.height });
    this.isFull = isFull && !this.painted;
    this.begunMs = performance.now();
    this.fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
  }

  /** Draw a picture so wide and high, which is then put somewhere. */
  paint(lens, near, [width, height]) {
    const { gl, splats } = this;
    this.resize(width, height);
    gl.viewport(0, 0, width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target.framebuffer);
    gl.clearColor(...this.background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (!this.nDrawn) return;
    gl.useProgram(splats.program);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.colors);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.geometry);
    gl.uniform1i(splats.at("geometry"), 0);
    gl.uniform1i(splats.at("colors"), 1);
    gl.uniformMatrix4fv(splats.at("world_to_camera"), true, lens.worldToCamera);
    gl.uniform2fv(splats.at("focal_px"), lens.focal);
    gl.uniform2fv(splats.at("center_px"), lens.center);
    gl.uniform2f(splats.at("size_px"), width, height);
    gl.uniform1f(splats.at("near"), near);
    gl.bindVertexArray(this.quads);
    gl.drawElements(gl.TRIANGLES, 6 * this.nDrawn, gl.UNSIGNED_INT, 0);
  }

  /** Draw a strip of triangles over the picture. places: x, y, z of each corner; toCamera: by rows, OpenCV axes; lens: as of paint. */
  mark(places, toCamera, lens, color) {
    const { gl, marks } = this;
    gl.useProgram(marks.program);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.uniformMatrix4fv(marks.at("to_camera"), true, toCamera);
    gl.uniform2fv(marks.at("focal_px"), lens.focal);
    gl.uniform2fv(marks.at("center_px"), lens.center);
    gl.uniform2f(marks.at("size_px"), ...this.size);
    gl.uniform4fv(marks.at("shade"), color);
    gl.bindVertexArray(this.strip);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.stripPlaces);
    gl.bufferData(gl.ARRAY_BUFFER, places, gl.DYNAMIC_DRAW);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, places.length / 3);
  }

  /** Put a picture onto a rectangle of a framebuffer, null for the canvas. */
  put(picture, framebuffer, { x, y, width, height }) {
    const { gl, present } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    gl.viewport(x, y, width, height);
    gl.disable(gl.BLEND);
    gl.useProgram(present.program);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, picture);
    gl.uniform1i(present.at("picture"), 0);
    gl.uniform4f(present.at("place"), x, y, width, height);
    gl.bindVertexArray(this.nothing);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }
}
