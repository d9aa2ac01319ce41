// The volume view: a canvas that can be turned, with forms, transfer function and cut planes.
import { el, uniqueId } from "../dom.js";
import { steer } from "./camera.js";
import { FORMS, Marcher } from "./marcher.js";
import { TransferControl, densityOf, rampBytes } from "./transfer.js";
import { histogram, percentile, threshold } from "./voxels.js";

const NAMES = { cloud: "Cloud", cube: "Cube", sphere: "Sphere", torus: "Torus" };
const AXES = ["z", "y", "x"];

/** The initial transfer function of a volume: dark values are transparent, bright ones opaque. */
export function defaultTransfer(volume) {
  const counts = histogram(volume);
  const low = threshold(counts);
  return { low, high: Math.max(low + 1, percentile(counts, 0.98)), density: 68, ramp: "grey" };
}

/** Radio buttons as a segmented control. */
export function choice(label, options, chosen, changed) {
  const name = uniqueId("choice");
  return el("fieldset", { class: "choice" }, el("legend", { class: "visually-hidden" }, label),
    ...options.map(([value, text]) => el("label", {},
      el("input", { type: "radio", name, value, checked: value === chosen, on: { change: () => changed(value) } }), el("span", {}, text))));
}

/**
 * A view of `volume` (see voxels.js), turned by `camera`.
 * state: {form, transfer, cut: {low: [z, y, x], high: [z, y, x]} in shares of the sides}; `changed(state)`.
 */
export class Viewer {
  constructor({ volume, camera, state, changed, label, signal, bare = false }) {
    Object.assign(this, { volume, camera, state, changed });
    this.canvas = el("canvas", { class: "volume", tabindex: "0", role: "application", "aria-roledescription": "volume that can be turned",
      "aria-label": `${label}: arrow keys turn it, plus and minus zoom, 0 resets the view` });
    this.note = el("p", { class: "volume-note edge", "aria-hidden": "true" }, "drag to turn · scroll to zoom · double-click to reset");
    this.stage = el("div", { class: "stage" }, this.canvas, bare ? null : this.note);
    this.element = el("div", { class: "viewer" }, this.stage);
    try {
      this.marcher = new Marcher(this.canvas);
      this.marcher.setVolume(volume);
    } catch (error) {
      this.stage.replaceChildren(el("p", { class: "stage-note" }, `This browser cannot draw the volume (${error.message}). Its slices are shown below. Enable WebGL2 to see the volume.`));
      this.stage.classList.add("cannot");
      this.marcher = null;
      return;
    }
    if (!bare) this.element.append(this.controls());
    const turn = () => this.marcher.set({ frame: camera.frame() });
    camera.addEventListener("turn", turn, { signal });
    camera.addEventListener("turn", () => this.note.classList.add("known"), { signal, once: true });
    steer(this.canvas, camera, signal);
    this.watch = new ResizeObserver(() => this.marcher.fit());
    this.watch.observe(this.canvas);
    this.show();
    turn();
  }

  /** Draws the state. */
  show() {
    if (!this.marcher) return;
    const { form, transfer, cut } = this.state;
    this.marcher.setRamp(rampBytes(transfer));
    this.marcher.set({ form, density: densityOf(transfer), cut: { low: [...cut.low].reverse(), high: [...cut.high].reverse() } });
  }

  update() {
    this.show();
    this.changed?.(this.state);
  }

  controls() {
    this.transfer = new TransferControl(this.state.transfer, histogram(this.volume), () => this.update(), this.volume.channels === 3);
    const forms = choice("Form", FORMS.map((form) => [form, NAMES[form]]), this.state.form, (form) => { this.state.form = form; this.update(); });
    return el("div", { class: "viewer-controls" }, forms, this.cuts(), this.transfer.element);
  }

  /** Two cut planes for each axis. */
  cuts() {
    const { sides } = this.volume;
    const outputs = [];
    const updateOutputs = () => outputs.forEach((write) => write());
    const rows = AXES.map((axis, at) => {
      const output = el("output", { class: "edge" });
      outputs.push(() => { output.textContent = `${Math.round(this.state.cut.low[at] * sides[at])}–${Math.round(this.state.cut.high[at] * sides[at])}`; });
      const end = (which, text) => {
        const input = el("input", { type: "range", min: 0, max: 100, step: 1, value: Math.round(this.state.cut[which][at] * 100), "aria-label": `${text} ${axis}`,
          on: { input: () => {
            // At least a twentieth of the side always remains.
            const other = this.state.cut[which === "low" ? "high" : "low"][at], want = input.value / 100;
            const value = which === "low" ? Math.min(want, other - 0.05) : Math.max(want, other + 0.05);
            input.value = Math.round(value * 100);
            this.state.cut[which][at] = Math.round(value * 100) / 100;
            updateOutputs();
            this.update();
          } } });
        return input;
      };
      return el("div", { class: "row cut" }, el("span", {}, axis), end("low", "Cut from the start of"), end("high", "Cut from the end of"), output);
    });
    updateOutputs();
    return el("fieldset", { class: "cuts" }, el("legend", {}, "Cut planes"), ...rows);
  }

  leave() {
    this.watch?.disconnect();
    this.transfer?.leave();
    this.marcher?.leave();
  }
}
