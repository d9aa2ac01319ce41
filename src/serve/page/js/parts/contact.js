// The contact sheet: all slices of a texture in rows, as in the paper, with a frame around the current slice.
import * as api from "../api.js";
import { el } from "../dom.js";
import { depthOf, sliceSides } from "../volume/voxels.js";
import { columnsFor, setGrid } from "./picture.js";

// Up to this many voxels all slices are fetched as one picture; above, each slice by itself when it scrolls into view.
const MAX_SHEET_VOXELS = 2.2e6;

/** `what`: {id} or {token}, with `shape`. `picked(index)` when a slice is clicked. */
export class ContactSheet {
  constructor({ what, axis, picked }) {
    Object.assign(this, { what, picked });
    this.element = el("div", { class: "contact" });
    this.show(axis);
  }

  show(axis) {
    this.axis = axis;
    const { shape } = this.what, depth = depthOf(shape, axis), [rows, columns] = sliceSides(shape, axis);
    this.columns = columnsFor([depth, rows, columns]);
    const lines = Math.ceil(depth / this.columns);
    const edge = el("div", { class: "contact-rule edge", "aria-hidden": "true" }, ...Array.from({ length: lines }, (_, line) => el("span", {}, line * this.columns + 1)));
    this.stage = el("div", { class: "contact-stage", style: { "aspect-ratio": `${this.columns * columns} / ${lines * rows}` } });
    setGrid(this.stage, this.columns, lines);
    this.lines = lines;
    this.depth = depth;
    if (shape[0] * shape[1] * shape[2] <= MAX_SHEET_VOXELS) {
      this.stage.append(el("img", { src: api.sheet(this.what, { axis, columns: this.columns, gap: 0 }), alt: `All ${depth} slices across ${axis}, ${this.columns} per row`, draggable: "false" }));
    } else {
      this.stage.classList.add("single");
      for (let at = 0; at < depth; at += 1) {
        this.stage.append(el("img", { src: api.slice(this.what, axis, at), alt: "", loading: "lazy", decoding: "async", draggable: "false", style: { "aspect-ratio": `${columns} / ${rows}` } }));
      }
    }
    this.pointer = el("i", { class: "contact-now", "aria-hidden": "true" });
    this.stage.append(this.pointer);
    this.stage.addEventListener("click", (event) => {
      const box = this.stage.getBoundingClientRect();
      const column = Math.floor(((event.clientX - box.left) / box.width) * this.columns), line = Math.floor(((event.clientY - box.top) / box.height) * lines);
      const index = line * this.columns + column;
      if (index >= 0 && index < depth) this.picked?.(index);
    });
    this.element.replaceChildren(edge, this.stage);
  }

  /** Frames the current slice. */
  point(index) {
    this.pointer.style.left = `${((index % this.columns) / this.columns) * 100}%`;
    this.pointer.style.top = `${(Math.floor(index / this.columns) / this.lines) * 100}%`;
    this.pointer.style.width = `${100 / this.columns}%`;
    this.pointer.style.height = `${100 / this.lines}%`;
  }
}
