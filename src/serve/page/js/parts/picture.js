// Pictures of textures: a middle slice in a square, or all slices as a sheet; and what stands for a texture without voxels.
import * as api from "../api.js";
import { el } from "../dom.js";

// Sheets on cards show so many slices at most, spread evenly, and none larger than this: the whole might be many megabytes.
const MOST_SLICES = 64;
const MOST_PIXELS = 96;
// A slice on a card of hits is about this wide on the screen.
const SMALL_PIXELS = 32;

/** A mark for textures of which only the moments are kept. */
export const noVoxels = () => el("span", { class: "no-voxels", title: "Only the moments of this texture are kept" }, el("span", {}, "moments only"));

/** The middle slice of `what` ({id} or {token}, voxels), in a square. */
export function place(what, size = 96) {
  if (!what.voxels) return noVoxels();
  const picture = el("img", { alt: "", decoding: "async", draggable: "false", src: api.thumbnail(what, size) });
  picture.addEventListener("error", () => picture.replaceWith(noVoxels()), { once: true });
  return picture;
}

/** How many slices a row of a sheet has: about as wide as tall, without gaps at the end where that is to be had. */
export function columnsFor([depth, height, width]) {
  const square = Math.sqrt((depth * height) / width);
  for (let columns = Math.max(1, Math.round(square)); columns <= square * 1.4; columns += 1) if (depth % columns === 0) return columns;
  return Math.max(1, Math.ceil(square));
}

/** All slices of `what` along z. Boxes have their final shape before the picture is there. */
export function sheet(what, { eager = false, small = false } = {}) {
  const box = el("span", { class: "sheet" });
  if (!what.voxels || !what.shape) { box.append(noVoxels()); return box; }
  const [depth, height, width] = what.shape, longest = Math.max(height, width), most = small ? SMALL_PIXELS * Math.ceil(devicePixelRatio) : MOST_PIXELS;
  const shown = Math.min(depth, MOST_SLICES);
  const columns = columnsFor([shown, height, width]), lines = Math.ceil(shown / columns);
  box.style.aspectRatio = `${columns * width} / ${lines * height}`;
  rule(box, columns, lines);
  const source = api.sheet(what, { axis: "z", columns, gap: 0, slices: shown < depth ? shown : null, pixels: longest > most ? most : null });
  const picture = el("img", { alt: "", decoding: "async", draggable: "false", loading: eager ? "eager" : "lazy", src: source });
  picture.addEventListener("error", () => picture.replaceWith(noVoxels()), { once: true });
  box.append(picture);
  return box;
}

/** Lines between the slices of a sheet, one pixel wide however large it is shown. */
export function rule(box, columns, lines) {
  box.style.setProperty("--columns", columns);
  box.style.setProperty("--lines", lines);
}
