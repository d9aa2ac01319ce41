// The transfer function from values to colour and opacity, and its controls: a window of values, a density, a colour ramp.
import { el, uniqueId } from "../dom.js";
import { colour } from "../theme.js";

/** Colour ramps as colours at equal steps. */
const RAMPS = {
  grey: [[0, 0, 0], [255, 255, 255]],
  ember: [[6, 4, 14], [70, 16, 58], [168, 40, 40], [234, 124, 34], [252, 230, 160]],
  lagoon: [[6, 14, 34], [16, 62, 104], [26, 128, 132], [128, 196, 138], [246, 244, 196]],
  bone: [[12, 12, 16], [78, 84, 98], [152, 158, 160], [224, 218, 204], [255, 252, 244]],
  negative: [[255, 255, 255], [0, 0, 0]],
};

/** {low, high, density, ramp} for an address; null if nothing was changed. */
export const writeTransfer = (t, home) =>
  Object.keys(home).every((key) => t[key] === home[key]) ? null : [t.low, t.high, t.density, t.ramp].join(",");

export function readTransfer(text, home) {
  const [low, high, density, ramp] = (text ?? "").split(",");
  const numbers = [low, high, density].map(Number);
  if (!text || numbers.some((x) => !Number.isFinite(x))) return { ...home };
  return { low: numbers[0], high: numbers[1], density: numbers[2], ramp: Object.hasOwn(RAMPS, ramp) ? ramp : home.ramp };
}

/** The opacity of a value: 0 up to `low`, 1 from `high`. */
export function opacity(value, { low, high }) {
  if (high <= low) return value >= high ? 1 : 0;
  const share = Math.max(0, Math.min(1, (value - low) / (high - low)));
  return share;
}

/** The colour of a value. The ramp ends at `high`, so that dark volumes are visible too. */
function rampColour({ ramp, high }, value) {
  const stops = RAMPS[ramp] ?? RAMPS.grey, at = Math.min(1, value / Math.max(1, high)) * (stops.length - 1), below = Math.min(stops.length - 2, Math.floor(at));
  return [0, 1, 2].map((channel) => Math.round(stops[below][channel] + (at - below) * (stops[below + 1][channel] - stops[below][channel])));
}

/** The transfer function as a table for the ray marcher. */
export function rampBytes(transfer) {
  const bytes = new Uint8Array(1024);
  for (let value = 0; value < 256; value += 1) bytes.set([...rampColour(transfer, value), Math.round(255 * opacity(value, transfer))], 4 * value);
  return bytes;
}

/** The density for the ray marcher, on a logarithmic scale. */
export const densityOf = ({ density }) => 0.8 * Math.pow(250, density / 100);

/** A histogram with the opacity curve, and controls. `changed(transfer)`. */
export class TransferControl {
  constructor(transfer, counts, changed, coloured) {
    Object.assign(this, { transfer, counts, changed });
    this.canvas = el("canvas", { class: "histogram", width: 256, height: 64, "aria-hidden": "true" });
    const range = (key, label, most) => {
      const id = uniqueId(key), output = el("output", { for: id, class: "edge" }, transfer[key]);
      const input = el("input", { id, type: "range", min: 0, max: most, step: 1, value: transfer[key], on: { input: () => { output.textContent = input.value; this.set({ [key]: Number(input.value) }); } } });
      this[key] = { input, output };
      return el("div", { class: "row" }, el("label", { for: id }, label), input, output);
    };
    const ramps = el("select", { "aria-label": "Colours", on: { change: () => this.set({ ramp: ramps.value }) } },
      ...Object.keys(RAMPS).map((name) => el("option", { value: name, selected: name === transfer.ramp }, name)));
    this.element = el("fieldset", { class: "transfer" }, el("legend", {}, "Transfer function"), this.canvas,
      range("low", "transparent up to", 255), range("high", "opaque from", 255), range("density", "density", 100),
      coloured ? null : el("div", { class: "row" }, el("span", {}, "colours"), ramps));
    this.drag();
    this.redraw = () => this.draw();
    addEventListener("theme", this.redraw);
    this.draw();
  }

  set(changes) {
    Object.assign(this.transfer, changes);
    this.draw();
    this.changed(this.transfer);
  }

  /** Dragging over the histogram moves the nearer end of the window. */
  drag() {
    let held = null;
    const value = (event) => {
      const box = this.canvas.getBoundingClientRect();
      return Math.max(0, Math.min(255, Math.round(((event.clientX - box.left) / box.width) * 255)));
    };
    const move = (event) => {
      if (!held) return;
      this[held].input.value = value(event);
      this[held].output.textContent = value(event);
      this.set({ [held]: value(event) });
    };
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      held = Math.abs(value(event) - this.transfer.low) <= Math.abs(value(event) - this.transfer.high) ? "low" : "high";
      move(event);
    });
    this.canvas.addEventListener("pointermove", move);
    for (const name of ["pointerup", "pointercancel"]) this.canvas.addEventListener(name, () => { held = null; });
  }

  draw() {
    const { canvas, counts, transfer } = this, context = canvas.getContext("2d");
    const [width, height] = [canvas.width, canvas.height];
    context.clearRect(0, 0, width, height);
    // Square roots, so that rare values are visible beside common ones.
    const most = Math.sqrt(counts.reduce((most, n) => Math.max(most, n), 1));
    for (let at = 0; at < 256; at += 1) {
      const tall = (Math.sqrt(counts[at]) / most) * (height - 4);
      const [r, g, b] = rampColour(transfer, at);
      context.fillStyle = colour("--hair");
      context.fillRect(at, height - tall, 1, tall);
      context.fillStyle = `rgb(${r} ${g} ${b})`;
      context.globalAlpha = opacity(at, transfer);
      context.fillRect(at, height - tall, 1, tall);
      context.globalAlpha = 1;
    }
    context.strokeStyle = colour("--mark");
    context.lineWidth = 1.5;
    context.beginPath();
    for (let at = 0; at < 256; at += 1) context.lineTo(at + 0.5, height - 2 - opacity(at, transfer) * (height - 4));
    context.stroke();
  }

  leave() { removeEventListener("theme", this.redraw); }
}
