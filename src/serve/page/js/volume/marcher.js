// Draws a volume with WebGL2. While things move, a small picture is drawn and enlarged; its size follows how long it took.
// When they are still, the full picture is drawn strip by strip, so that a slow machine stays free to answer.
import { COPY, MARCH, VERTEX } from "./shaders.js";

export const FORMS = ["cloud", "cube", "sphere", "torus"];
const STILL_AFTER = 140;
const GOOD_FRAME = 28;
// The full picture may take so long; where it would take longer, it has fewer pixels.
const LONGEST = 2500;
const MOST_PIXELS = 1600 * 1600;
const UNIFORMS = ["volume", "ramp", "coloured", "halfSize", "cutLow", "cutHigh", "eye", "right", "up", "ahead", "aspect", "form", "radius", "stride", "density", "lens", "fine", "voxelSize"];

/** Whether this browser can draw volumes. */
export function canDraw() {
  const gl = document.createElement("canvas").getContext("webgl2");
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return gl !== null;
}

export class Marcher {
  /** `trouble(sentence)` is called when drawing has become impossible. */
  constructor(canvas, trouble) {
    Object.assign(this, { canvas, trouble, scale: 0.5, asked: 0, strip: null, pending: null, volume: null, last: 0, budget: MOST_PIXELS });
    this.state = { form: "cloud", density: 12, cut: null, frame: null };
    const options = { alpha: true, premultipliedAlpha: true, antialias: false, depth: false, preserveDrawingBuffer: true };
    this.gl = canvas.getContext("webgl2", options);
    if (!this.gl) throw new Error("WebGL2 is not to be had");
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

  /** Takes {data, shape, channels, sides}. Beyond its borders a volume goes on mirrored. */
  setVolume(volume) {
    const { gl } = this, [depth, height, width] = volume.shape;
    if (Math.max(depth, height, width) > gl.getParameter(gl.MAX_3D_TEXTURE_SIZE)) throw new Error("the volume is larger than this graphics driver takes");
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

  /** Takes 256 times red, green, blue, opacity. */
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

  /** Changes what is drawn: `form`, `density`, `frame` (of a camera), `cut` ({low, high}: shares of x, y, z). */
  set(changes) {
    Object.assign(this.state, changes);
    this.touch();
  }

  /** Fits the picture to the size the canvas has on the screen. */
  fit() {
    const { clientWidth, clientHeight } = this.canvas;
    const ratio = Math.min(devicePixelRatio, 2, Math.sqrt(this.budget / Math.max(1, clientWidth * clientHeight)));
    const [width, height] = [clientWidth, clientHeight].map((side) => Math.max(1, Math.round(side * ratio)));
    if (this.canvas.width === width && this.canvas.height === height) return;
    this.canvas.width = width;
    this.canvas.height = height;
    this.touch();
  }

  /** Something has changed: a small picture now, the full one when nothing changes any more. */
  touch() {
    this.last = performance.now();
    this.strip = null;
    this.moved = true;
    this.canvas.dataset.drawn = "no";
    if (!this.asked && !this.lost) this.asked = requestAnimationFrame(() => this.tick());
  }

  tick() {
    this.asked = 0;
    const { gl } = this;
    if (this.lost || !this.volumeTexture || !this.state.frame) return;
    const again = () => { this.asked = requestAnimationFrame(() => this.tick()); };
    // Whether a strip is done is asked more often than a slow machine has frames.
    if (this.pending && !this.finished()) { if (this.pending.kind === "strip") this.asked = -setTimeout(() => this.tick(), 4); else again(); return; }
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

  /** `asked`: above 0 a frame, below 0 a timer. */
  cancel() {
    if (this.asked > 0) cancelAnimationFrame(this.asked); else clearTimeout(-this.asked);
    this.asked = 0;
  }

  pend(kind, pixels = 1) {
    this.pending = { kind, pixels, fence: this.gl.fenceSync(this.gl.SYNC_GPU_COMMANDS_COMPLETE, 0), since: performance.now() };
  }

  /** Whether the last picture is done; then its time decides the size of the next. */
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
    } else if (this.economise(took / pending.pixels)) return true;
    else if (this.strip) this.strip.rows = Math.max(Math.ceil(this.canvas.height / 16), Math.round(this.strip.rows * Math.max(0.5, Math.min(2, 40 / took))));
    return true;
  }

  /** Gives up pixels on machines that would draw the full picture for seconds: they have no graphics card. */
  economise(perPixel) {
    const budget = Math.max(480 * 480, LONGEST / perPixel);
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
      // Memory for the largest picture yet: one whose size changes with every frame would be taken anew each time.
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

  /** Sets the program up; `coarse`: how many voxels a step of the cloud is long. */
  useMarch(coarse) {
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
    // Forms keep a useful size in flat volumes, whose texture goes on mirrored; the cuts are then shares of the form.
    const radius = Math.max(Math.min(...half), 0.3);
    const room = solid ? [radius, radius, radius] : half;
    // Shares count along the volume's axes: y and z run against the world's.
    gl.uniform3fv(at.cutLow, [room[0] * (2 * cut.low[0] - 1), room[1] * (1 - 2 * cut.high[1]), room[2] * (1 - 2 * cut.high[2])]);
    gl.uniform3fv(at.cutHigh, [room[0] * (2 * cut.high[0] - 1), room[1] * (1 - 2 * cut.low[1]), room[2] * (1 - 2 * cut.low[2])]);
    for (const name of ["eye", "right", "up", "ahead"]) gl.uniform3fv(at[name], state.frame[name]);
    const wide = canvas.width / canvas.height;
    gl.uniform2f(at.aspect, wide >= 1 ? wide : 1, wide >= 1 ? 1 : 1 / wide);
    gl.uniform1i(at.form, FORMS.indexOf(state.form));
    gl.uniform1f(at.radius, radius);
    gl.uniform1f(at.stride, coarse / Math.min(160, finest));
    gl.uniform1f(at.density, state.density);
    gl.uniform1f(at.voxelSize, 1 / finest);
    // Round forms leave the corners of their cube free: a narrower lens shows them as large.
    gl.uniform1f(at.lens, state.form === "sphere" || state.form === "torus" ? 0.17 : 0.215);
    gl.uniform1i(at.fine, solid && coarse < 1 ? 1 : 0);
  }

  leave() {
    this.cancel();
    this.lost = true;
    this.gl.getExtension("WEBGL_lose_context")?.loseContext();
  }
}
