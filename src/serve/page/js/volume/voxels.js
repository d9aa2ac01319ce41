// Voxels in the page: reading, slices, histograms.
import * as api from "../api.js";

/**
 * Resolves to {data, shape: [Z, Y, X], channels, sides, reduced}. The server averages sides longer than `edge`, each by its own
 * factor; the proportions are those of `sides`, the full shape.
 */
export async function readVoxels(what, edge, signal) {
  const response = await api.request(api.voxelsPath(what, edge), { signal });
  const shape = (response.headers.get("x-shape") ?? "").split(",").map(Number);
  const channels = Number(response.headers.get("x-channels") ?? 1);
  const data = new Uint8Array(await response.arrayBuffer());
  const length = shape.reduce((product, side) => product * side, channels);
  if (shape.length !== 3 || length !== data.length) throw new api.Problem(0, `The server sent ${data.length} voxels for a shape of ${shape.join(" × ")}.`);
  const sides = what.shape ?? shape;
  return { data, shape, channels, sides, reduced: sides.some((side, at) => side > shape[at]) };
}

/** The number of voxels with each of the 256 values (luma for colour). */
export function histogram({ data, channels }) {
  const counts = new Float64Array(256);
  if (channels === 1) for (let at = 0; at < data.length; at += 1) counts[data[at]] += 1;
  else for (let at = 0; at + 2 < data.length; at += channels) counts[Math.round(0.299 * data[at] + 0.587 * data[at + 1] + 0.114 * data[at + 2])] += 1;
  return counts;
}

/** The value below which a share of the voxels lies. */
export function percentile(counts, share) {
  const total = counts.reduce((sum, n) => sum + n, 0);
  let seen = 0;
  for (let value = 0; value < 256; value += 1) {
    seen += counts[value];
    if (seen >= share * total) return value;
  }
  return 255;
}

/** The value that best separates a histogram into dark and bright (Otsu's method); the middle one of several. */
export function threshold(counts) {
  let total = 0, sum = 0;
  counts.forEach((n, value) => { total += n; sum += n * value; });
  let below = 0, sumBelow = 0, best = -1, first = 127, last = 127;
  for (let value = 0; value < 255; value += 1) {
    below += counts[value];
    sumBelow += counts[value] * value;
    if (below === 0 || below === total) continue;
    const apart = sumBelow / below - (sum - sumBelow) / (total - below), between = (below / total) * (1 - below / total) * apart * apart;
    if (between > best * (1 + 1e-9)) { best = between; first = last = value; } else if (between > best * (1 - 1e-9)) last = value;
  }
  return Math.round((first + last) / 2);
}

/** The sides [rows, columns] of a slice across `axis`. A slice across z has rows along y and columns along x, as in the paper. */
export const sliceSides = ([depth, height, width], axis) => ({ z: [height, width], y: [depth, width], x: [depth, height] })[axis];

/** The number of slices across `axis`. */
export const depthOf = (shape, axis) => shape[{ z: 0, y: 1, x: 2 }[axis]];

/** One slice as ImageData. */
export function slicePixels({ data, shape, channels }, axis, index) {
  const [, height, width] = shape;
  const [rows, columns] = sliceSides(shape, axis);
  const step = { z: [width, 1, index * height * width], y: [height * width, 1, index * width], x: [height * width, width, index] }[axis];
  const image = new ImageData(columns, rows), pixels = image.data;
  let to = 0;
  for (let row = 0; row < rows; row += 1) {
    let from = (step[2] + row * step[0]) * channels;
    for (let column = 0; column < columns; column += 1, from += step[1] * channels, to += 4) {
      pixels[to] = data[from];
      pixels[to + 1] = data[from + (channels > 1 ? 1 : 0)];
      pixels[to + 2] = data[from + (channels > 1 ? 2 : 0)];
      pixels[to + 3] = 255;
    }
  }
  return image;
}
