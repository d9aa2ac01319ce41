// Draws a volume by ray marching in WebGL2. During changes a small picture is drawn and enlarged; its size adapts to the time it
// takes. Afterwards the full picture is drawn in strips, so that the page stays responsive on slow machines.
import { COPY, MARCH, VERTEX } from "./shaders.js";

export const FORMS = ["cloud", "cube", "sphere", "torus"];
const STILL_AFTER = 140;
const GOOD_FRAME = 28;
// The time limit of the full picture in ms; on slower machines it has fewer pixels.
const MAX_TIME = 2500;
const MAX_PIXELS = 1600 * 1600;
const UNIFORMS = ["volume", "ramp", "coloured", "halfSize", "cutLow", "cutHigh", "eye", "right", "up", "ahead", "aspect", "form", "radius", "stride", "density", "lens", "fine", "voxelSize"];

export class Marcher {
  constructor(canvas) {
    Object.assign(this, { canvas, scale: 0.5, scheduled: 0, strip: null, pending: null, volume: null, last: 0, budget: MAX_PIXELS });
    this.state = { form: "cloud", density: 12, cut: null, frame: null };
    const options = { alpha: true, premultipliedAlpha: true, antialias: false, depth: false, preserveDrawingBuffer: true };
    this.gl = canvas.getContext("webgl2", options);
    if (!this.gl) throw new Error("WebGL2 is not available");
    canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.lost = true; this.cancel(); });
    canvas.addEventListener("webglcontextrestored", () => {
      this.lost = false;
      this.build();
      if (this.volume) this.setVolume(this.volume);
      if (this.rampBytes) this.setRamp(this.rampBytes);
      this.touch();
    });
    this.build();
  }

  build() {
    const { gl } = this;
    const vertex = this.compile(gl.VERTEX_SHADER, VERTEX);
    this.march = this.link(vertex, this.compile(gl.FRAGMENT_SHADER, MARCH));
    this.copy = this.link(vertex, this.compile(gl.FRAGMENT_SHADER, COPY));
    this.at = Object.fromEntries(UNIFORMS.map((name) => [name, gl.getUniformLocation(this.march, name)]));
    this.copyAt = { small: gl.getUniformLocation(this.copy, "small"), share: gl.getUniformLocation(this.copy, "share") };
    this.small = { texture: gl.createTexture(), buffer: gl.createFramebuffer(), width: 0, height: 0 };
    this.rampTexture = gl.createTexture();
    this.volumeTexture = null;
    gl.bindVertexArray(gl.createVertexArray());
  }

  compile(kind, source) {
    const { gl } = this, shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) throw new Error(gl.getShaderInfoLog(shader));
    return shader;
  }

  link(vertex, fragment) {
    const { gl } = this, program = gl.createProgram();
    gl.attachShader(program, vertex);
    gl.attachShader(program, fragment);
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) throw new Error(gl.getProgramInfoLog(program));
    return program;
  }

  /** Sets the volume {data, shape, channels, sides}. Beyond its borders it is mirrored. */
  setVolume(volume) {
    const { gl } = this, [depth, height, width] = volume.shape;
    if (Math.max(depth, height, width) > gl.getParameter(gl.MAX_3D_TEXTURE_SIZE)) throw new Error("the volume is too large for this graphics driver");
    if (this.volumeTexture) gl.deleteTexture(this.volumeTexture);
    this.volume = volume;
    this.volumeTexture = gl.createTexture();
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_3D, this.volumeTexture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    const colour = volume.channels === 3;
    gl.texImage3D(gl.TEXTURE_3D, 0, colour ? gl.RGB8 : gl.R8, width, height, depth, 0, colour ? gl.RGB : gl.RED, gl.UNSIGNED_BYTE, volume.data);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T, gl.TEXTURE_WRAP_R]) gl.texParameteri(gl.TEXTURE_3D, side, gl.MIRRORED_REPEAT);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_3D, filter, gl.LINEAR);
    this.touch();
  }

  /** Sets the transfer function: 256 times red, green, blue, opacity. */
  setRamp(bytes) {
    const { gl } = this;
    this.rampBytes = bytes;
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.rampTexture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.LINEAR);
    for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    this.touch();
  }

  /** Changes the state: `form`, `density`, `frame` (of a camera), `cut` ({low, high}: shares of x, y, z). */
  set(changes) {
    Object.assign(this.state, changes);
    this.touch();
  }

  /** Fits the picture to the size of the canvas on the screen. */
  fit() {
    const { clientWidth, clientHeight } = this.canvas;
    const ratio = Math.min(devicePixelRatio, 2, Math.sqrt(this.budget / Math.max(1, clientWidth * clientHeight)));
    const [width, height] = [clientWidth, clientHeight].map((side) => Math.max(1, Math.round(side * ratio)));
    if (this.canvas.width === width && this.canvas.height === height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    this.touch();
  }

  /** After a change: draws a small picture now, and the full one when no more changes follow. */
  touch() {
    this.last = performance.now();
    this.strip = null;
    this.moved = true;
    this.canvas.dataset.drawn = "no";
    if (!this.scheduled && !this.lost) this.scheduled = requestAnimationFrame(() => this.tick());
  }

  tick() {
    this.scheduled = 0;
    const { gl } = this;
    if (this.lost || !this.volumeTexture || !this.state.frame) return;
    const again = () => { this.scheduled = requestAnimationFrame(() => this.tick()); };
    // Strips are polled more often than a slow machine draws frames.
    if (this.pending && !this.finished()) { if (this.pending.kind === "strip") this.scheduled = -setTimeout(() => this.tick(), 4); else again(); return; }
    if (this.moved) {
      this.moved = false;
      this.drawSmall();
      this.pend("small");
      again();
    } else if (performance.now() - this.last < STILL_AFTER) again();
    else {
      this.strip ??= { row: 0, rows: Math.ceil(this.canvas.height / 12) };
      const before = this.strip.row;
      this.drawStrip();
      this.pend("strip", (this.strip.row - before) * this.canvas.width);
      if (this.strip.row < this.canvas.height) again();
      else { this.strip = null; this.canvas.dataset.drawn = "yes"; }
    }
    gl.flush();
  }

  /** `scheduled` is a frame request if positive, a timer if negative. */
  cancel() {
    if (this.scheduled > 0) cancelAnimationFrame(this.scheduled); else clearTimeout(-this.scheduled);
    this.scheduled = 0;
  }

  pend(kind, pixels = 1) {
    this.pending = { kind, pixels, fence: this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0), since: performance.now() };
  }

  /** Whether the last picture is done. If so, its time decides the size of the next. */
  finished() {
    const { gl, pending } = this;
    const status = gl.clientWaitSync(pending.fence, 0, 0);
    if (status === gl.TIMEOUT_EXPIRED && performance.now() - pending.since < 2000) return false;
    gl.deleteSync(pending.fence);
    const took = performance.now() - pending.since;
    this.pending = null;
    if (pending.kind === "small") {
      if (took > 1.4 * GOOD_FRAME) this.scale = Math.max(0.2, this.scale * 0.8);
      else if (took < 0.7 * GOOD_FRAME) this.scale = Math.min(1, this.scale * 1.2);
    } else if (this.reduceBudget(took / pending.pixels)) return true;
    else if (this.strip) this.strip.rows = Math.max(Math.ceil(this.canvas.height / 16), Math.round(this.strip.rows * Math.max(0.5, Math.min(2, 40 / took))));
    return true;
  }

  /** Reduces the pixels on machines without a graphics card, where the full picture would take seconds. */
  reduceBudget(perPixel) {
    const budget = Math.max(480 * 480, MAX_TIME / perPixel);
    if (this.canvas.width * this.canvas.height < 1.5 * budget) return false;
    this.budget = budget;
    this.fit();
    return true;
  }

  drawSmall() {
    const { gl, small, canvas } = this;
    const [width, height] = [canvas.width, canvas.height].map((side) => Math.max(16, Math.round(side * this.scale)));
    gl.activeTexture(gl.TEXTURE2);
    gl.bindTexture(gl.TEXTURE_2D, small.texture);
    if (width > small.width || height > small.height) {
      // The texture only grows, because reallocating it for every frame would be slow.
      Object.assign(small, { width: Math.max(width, small.width), height: Math.max(height, small.height) });
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, small.width, small.height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
      for (const filter of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, filter, gl.LINEAR);
      for (const side of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, side, gl.CLAMP_TO_EDGE);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, small.buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, small.texture, 0);
    gl.viewport(0, 0, width, height);
    gl.disable(gl.SCISSOR_TEST);
    this.useMarch(1.6);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.useProgram(this.copy);
    gl.uniform1i(this.copyAt.small, 2);
    gl.uniform2f(this.copyAt.share, width / small.width, height / small.height);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  drawStrip() {
    const { gl, strip, canvas } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.enable(gl.SCISSOR_TEST);
    const rows = Math.min(strip.rows, canvas.height - strip.row);
    gl.scissor(0, canvas.height - strip.row - rows, canvas.width, rows);
    this.useMarch(0.7);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.disable(gl.SCISSOR_TEST);
    strip.row += rows;
  }

  /** Sets the uniforms; `step`: the length of a step of the cloud in voxels. */
  useMarch(step) {
    const { gl, at, state, volume, canvas } = this;
    const most = Math.max(...volume.sides), [depth, height, width] = volume.sides, finest = Math.max(...volume.shape);
    const half = [width, height, depth].map((side) => side / most / 2);
    const cut = state.cut ?? { low: [0, 0, 0], high: [1, 1, 1] };
    gl.useProgram(this.march);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_3D, this.volumeTexture);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, this.rampTexture);
    gl.uniform1i(at.volume, 0);
    gl.uniform1i(at.ramp, 1);
    gl.uniform1i(at.coloured, volume.channels === 3 ? 1 : 0);
    gl.uniform3fv(at.halfSize, half);
    const solid = state.form !== "cloud";
    // In flat volumes, which are mirrored, forms keep a useful size; the cuts are then shares of the form.
    const radius = Math.max(Math.min(...half), 0.3);
    const room = solid ? [radius, radius, radius] : half;
    // Shares are along the axes of the volume; y and z are opposite to those of the world.
    gl.uniform3fv(at.cutLow, [room[0] * (2 * cut.low[0] - 1), room[1] * (1 - 2 * cut.high[1]), room[2] * (1 - 2 * cut.high[2])]);
    gl.uniform3fv(at.cutHigh, [room[0] * (2 * cut.high[0] - 1), room[1] * (1 - 2 * cut.low[1]), room[2] * (1 - 2 * cut.low[2])]);
    for (const name of ["eye", "right", "up", "ahead"]) gl.uniform3fv(at[name], state.frame[name]);
    const wide = canvas.width / canvas.height;
    gl.uniform2f(at.aspect, wide >= 1 ? wide : 1, wide >= 1 ? 1 : 1 / wide);
    gl.uniform1i(at.form, FORMS.indexOf(state.form));
    gl.uniform1f(at.radius, radius);
    gl.uniform1f(at.stride, step / Math.min(160, finest));
    gl.uniform1f(at.density, state.density);
    gl.uniform1f(at.voxelSize, 1 / finest);
    // Round forms do not fill the corners of their cube, so a narrower lens shows them at the same size.
    gl.uniform1f(at.lens, state.form === "sphere" || state.form === "torus" ? 0.17 : 0.215);
    gl.uniform1i(at.fine, solid && step < 1 ? 1 : 0);
  }

  leave() {
    this.cancel();
    this.lost = true;
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}
