// The camera of a volume view. Views that share a camera turn together.

const NEAREST = 0.5, FARTHEST = 4;
const HOME = { yaw: -0.6, pitch: 0.45, zoom: 1 };

/** Angles in radians; a zoom above 1 is nearer. Dispatches `turn` when it changes. */
export class Camera extends EventTarget {
  constructor(text = null) {
    super();
    Object.assign(this, HOME);
    this.read(text);
  }

  set(changes) {
    Object.assign(this, changes);
    this.pitch = Math.max(-1.55, Math.min(1.55, this.pitch));
    this.zoom = Math.max(NEAREST, Math.min(FARTHEST, this.zoom));
    this.yaw = Math.atan2(Math.sin(this.yaw), Math.cos(this.yaw));
    this.dispatchEvent(new Event("turn"));
  }

  turn(right, down) { this.set({ yaw: this.yaw + right, pitch: this.pitch + down }); }
  nearer(times) { this.set({ zoom: this.zoom * times }); }
  home() { this.set(HOME); }
  get isHome() { return Object.keys(HOME).every((key) => Math.abs(this[key] - HOME[key]) < 1e-3); }

  /** The state for an address: degrees and zoom; null for the initial state. */
  write() {
    const degrees = (angle) => Math.round((angle * 180) / Math.PI);
    return this.isHome ? null : `${degrees(this.yaw)},${degrees(this.pitch)},${Number(this.zoom.toFixed(2))}`;
  }

  read(text) {
    const [yaw, pitch, zoom] = (text ?? "").split(",").map(Number);
    if ([yaw, pitch, zoom].every(Number.isFinite) && zoom > 0) this.set({ yaw: (yaw * Math.PI) / 180, pitch: (pitch * Math.PI) / 180, zoom });
  }

  /** The position of the eye and the axes of its picture, for an object at the origin. */
  frame() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const back = [sy * cp, sp, cy * cp];
    const right = [cy, 0, -sy];
    const up = [-sy * sp, cp, -cy * sp];
    const far = 4.2 / this.zoom;
    return { eye: back.map((x) => x * far), right, up, ahead: back.map((x) => -x) };
  }
}

/** Turns and zooms `camera` by pointers and keys on `canvas`. */
export function steer(canvas, camera, signal) {
  const on = (name, listener, options = {}) => canvas.addEventListener(name, listener, { signal, ...options });
  const pointers = new Map();
  on("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
    canvas.classList.add("held");
  });
  on("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    if (pointers.size === 1) {
      const per = Math.PI / Math.max(1, canvas.clientWidth);
      camera.turn(-(now[0] - before[0]) * per, (now[1] - before[1]) * per);
    } else {
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const span = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
      if (span(before) > 0) camera.nearer(span(now) / span(before));
    }
    pointers.set(event.pointerId, now);
  });
  const release = (event) => { pointers.delete(event.pointerId); if (pointers.size === 0) canvas.classList.remove("held"); };
  on("pointerup", release);
  on("pointercancel", release);
  // The wheel scrolls the page unless the canvas has the focus (after a click) or Ctrl is pressed.
  on("wheel", (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return;
    event.preventDefault();
    camera.nearer(Math.exp(-event.deltaY / 500));
  }, { passive: false });
  on("dblclick", () => camera.home());
  on("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const by = event.shiftKey ? 0.5 : 0.12;
    const moves = {
      ArrowLeft: () => camera.turn(-by, 0), ArrowRight: () => camera.turn(by, 0), ArrowUp: () => camera.turn(0, -by), ArrowDown: () => camera.turn(0, by),
      "+": () => camera.nearer(1.15), "=": () => camera.nearer(1.15), "-": () => camera.nearer(1 / 1.15), 0: () => camera.home(),
    };
    if (!moves[event.key]) return;
    event.preventDefault();
    moves[event.key]();
  });
}
