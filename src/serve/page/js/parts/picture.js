// Pictures of textures: a thumbnail, a contact sheet, or a mark for a texture without voxels.
import * as api from "../api.js";
import { el } from "../dom.js";

// Limits of the slices of a contact sheet, which might otherwise have many megabytes.
const MAX_SLICES = 64;
const MAX_SLICE_PIXELS = 96;
// The width of a slice in the list of hits.
const SMALL_SLICE_PIXELS = 32;

/** A mark for a texture whose voxels are not stored. */
export const noVoxels = () => el("span", { class: "no-voxels", title: "Only the moments of this texture are stored" }, el("span", {}, "moments only"));

/** A square thumbnail of `what` ({id} or {token}, voxels). */
export function thumbnail(what, size = 96) {
  if (!what.voxels) return noVoxels();
  const picture = el("img", { alt: "", decoding: "async", draggable: "false", src: api.thumbnail(what, size) });
  picture.addEventListener("error", () => picture.replaceWith(noVoxels()), { once: true });
  return picture;
}

/** The number of columns that makes a contact sheet about square, if possible without gaps in the last row. */
export function columnsFor([depth, height, width]) {
  const square = Math.sqrt((depth * height) / width);
  for (let columns = Math.max(1, Math.round(square)); columns <= square * 1.4; columns += 1) if (depth % columns === 0) return columns;
  return Math.max(1, Math.ceil(square));
}

/** The contact sheet of `what` across z. The box has its final shape before the picture is loaded. */
export function contactSheet(what, { eager = false, small = false } = {}) {
  const box = el("span", { class: "sheet" });
  if (!what.voxels || !what.shape) { box.append(noVoxels()); return box; }
  const [depth, height, width] = what.shape, longest = Math.max(height, width), limit = small ? SMALL_SLICE_PIXELS * Math.ceil(devicePixelRatio) : MAX_SLICE_PIXELS;
  const shown = Math.min(depth, MAX_SLICES);
  const columns = columnsFor([shown, height, width]), lines = Math.ceil(shown / columns);
  box.style.aspectRatio = `${columns * width} / ${lines * height}`;
  setGrid(box, columns, lines);
  const source = api.sheet(what, { axis: "z", columns, gap: 0, slices: shown < depth ? shown : null, pixels: longest > limit ? limit : null });
  const picture = el("img", { alt: "", decoding: "async", draggable: "false", loading: eager ? "eager" : "lazy", src: source });
  picture.addEventListener("error", () => picture.replaceWith(noVoxels()), { once: true });
  box.append(picture);
  return box;
}

/** Sets the grid of a contact sheet. CSS draws its lines, so that they have the same width at every size. */
export function setGrid(box, columns, lines) {
  box.style.setProperty("--columns", columns);
  box.style.setProperty("--lines", lines);
}
