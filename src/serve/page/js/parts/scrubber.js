// Three slices through one voxel, one across each axis. Dragging in one slice moves the other two.
import * as api from "../api.js";
import { el, uniqueId, debounce } from "../dom.js";
import { depthOf, slicePixels, sliceSides } from "../volume/voxels.js";

const AXES = ["z", "y", "x"];
// The axes of the rows and columns of a slice.
const ALONG = { z: ["y", "x"], y: ["z", "x"], x: ["z", "y"] };

/** `what`: {id} or {token} with its full shape; `volume`: its voxels, possibly reduced; `at`: {z, y, x}; `changed(at)`. */
export class Scrubber {
  constructor({ what, volume, at, changed }) {
    Object.assign(this, { what, volume, changed });
    this.shape = what.shape;
    this.at = Object.fromEntries(AXES.map((axis, i) => [axis, Math.max(0, Math.min(this.shape[i] - 1, at?.[axis] ?? Math.floor(this.shape[i] / 2)))]));
    this.panels = Object.fromEntries(AXES.map((axis) => [axis, this.panel(axis)]));
    this.element = el("div", { class: "scrubber" }, ...AXES.map((axis) => this.panels[axis].element));
    // If the voxels are reduced, the slices in full resolution are fetched once the position no longer changes.
    this.sharpen = debounce(180, () => { for (const axis of AXES) this.fetchSlice(axis); });
    this.draw();
  }

  panel(axis) {
    const [rows, columns] = sliceSides(this.volume.shape, axis), [fullRows, fullColumns] = sliceSides(this.shape, axis);
    const canvas = el("canvas", { "aria-hidden": "true" });
    canvas.width = columns;
    canvas.height = rows;
    const image = el("img", { alt: "", hidden: true, draggable: "false" });
    const cross = [el("i", { class: "cross row" }), el("i", { class: "cross column" })];
    const stage = el("div", { class: "slice", style: { "aspect-ratio": `${fullColumns} / ${fullRows}` } }, canvas, image, cross);
    const id = uniqueId("slice"), output = el("output", { for: id, class: "edge" });
    const last = depthOf(this.shape, axis) - 1;
    const input = el("input", { id, type: "range", min: 0, max: last, step: 1, value: this.at[axis], on: { input: () => this.set({ [axis]: Number(input.value) }) } });
    const move = (event) => {
      if (event.buttons === 0) return;
      const box = stage.getBoundingClientRect(), [down, across] = ALONG[axis];
      const place = (share, other) => Math.max(0, Math.min(depthOf(this.shape, other) - 1, Math.floor(share * depthOf(this.shape, other))));
      this.set({ [down]: place((event.clientY - box.top) / box.height, down), [across]: place((event.clientX - box.left) / box.width, across) });
    };
    stage.addEventListener("pointerdown", (event) => { stage.setPointerCapture(event.pointerId); move(event); });
    stage.addEventListener("pointermove", move);
    const element = el("div", { class: "scrub" }, stage, el("div", { class: "row" }, el("label", { for: id }, axis), input, output));
    return { element, canvas, image, cross, input, output, last };
  }

  set(changes) {
    Object.assign(this.at, changes);
    this.draw();
    this.changed?.(this.at);
  }

  draw() {
    for (const axis of AXES) {
      const panel = this.panels[axis], [down, across] = ALONG[axis];
      const here = depthOf(this.volume.shape, axis), full = depthOf(this.shape, axis);
      panel.canvas.getContext("2d").putImageData(slicePixels(this.volume, axis, Math.min(here - 1, Math.floor((this.at[axis] * here) / full))), 0, 0);
      const wanted = api.slice(this.what, axis, this.at[axis]);
      if (panel.image.dataset.of !== wanted) panel.image.hidden = true;
      panel.input.value = this.at[axis];
      panel.output.textContent = `${this.at[axis] + 1} of ${panel.last + 1}`;
      const share = (other) => `${((this.at[other] + 0.5) / depthOf(this.shape, other)) * 100}%`;
      panel.cross[0].style.top = share(down);
      panel.cross[1].style.left = share(across);
    }
    if (this.volume.reduced) this.sharpen();
  }

  fetchSlice(axis) {
    const { image } = this.panels[axis], wanted = api.slice(this.what, axis, this.at[axis]);
    if (image.dataset.of === wanted) { image.hidden = false; return; }
    image.dataset.of = wanted;
    image.onload = () => { image.hidden = image.dataset.of !== api.slice(this.what, axis, this.at[axis]); };
    image.src = wanted;
  }

  leave() { this.sharpen.cancel(); }
}
