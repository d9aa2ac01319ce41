// A scatter plot on a canvas: points are written as pixels, and where there is room pictures take their place.
import { thumbnail } from "../api.js";
import { colour } from "../theme.js";

const CELLS = 128;
const PICTURE = 56;
const MAX_PICTURES = 120;
const REACH = 14;

export class Scatter {
  /** `points`: {ids, x, y}. `redraw()` is called when a picture has been loaded. */
  constructor(canvas, points, redraw) {
    Object.assign(this, { canvas, points, redraw, paints: null, dim: null, selected: -1, pictures: true, images: new Map() });
    this.context = canvas.getContext("2d", { willReadFrequently: true });
    this.measure();
    this.sortIntoCells();
  }

  /** Shows all points. Percentiles would hide outliers. */
  measure() {
    const { x, y } = this.points;
    let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
    for (let at = 0; at < x.length; at += 1) {
      if (x[at] < left) left = x[at];
      if (x[at] > right) right = x[at];
      if (y[at] < low) low = y[at];
      if (y[at] > high) high = y[at];
    }
    if (!(right > left)) { left -= 0.5; right += 0.5; }
    if (!(high > low)) { low -= 0.5; high += 0.5; }
    if (!Number.isFinite(left)) [left, right, low, high] = [-1, 1, -1, 1];
    this.bounds = { left, right, low, high };
    this.view = { x: (left + right) / 2, y: (low + high) / 2, zoom: 1 };
  }

  /** Sorts points into cells, so that near and visible points are found without visiting all. */
  sortIntoCells() {
    const { x, y } = this.points, { left, right, low, high } = this.bounds;
    const starts = new Uint32Array(CELLS * CELLS + 1), cell = new Uint32Array(x.length);
    for (let at = 0; at < x.length; at += 1) {
      const column = Math.min(CELLS - 1, Math.floor(((x[at] - left) / (right - left)) * CELLS)), row = Math.min(CELLS - 1, Math.floor(((y[at] - low) / (high - low)) * CELLS));
      cell[at] = row * CELLS + column;
      starts[cell[at] + 1] += 1;
    }
    for (let at = 0; at < CELLS * CELLS; at += 1) starts[at + 1] += starts[at];
    const next = starts.slice(), order = new Uint32Array(x.length);
    for (let at = 0; at < x.length; at += 1) order[next[cell[at]]++] = at;
    Object.assign(this, { starts, order });
  }

  /** Calls `each(point)` for the points in a rectangle of the plane. */
  within(left, right, low, high, each) {
    const b = this.bounds;
    const clamp = (value) => Math.max(0, Math.min(CELLS - 1, Math.floor(value)));
    if (right < b.left || left > b.right || high < b.low || low > b.high) return;
    const [c0, c1] = [left, right].map((at) => clamp(((at - b.left) / (b.right - b.left)) * CELLS)), [r0, r1] = [low, high].map((at) => clamp(((at - b.low) / (b.high - b.low)) * CELLS));
    const { x, y } = this.points;
    for (let row = r0; row <= r1; row += 1) {
      for (let at = this.starts[row * CELLS + c0]; at < this.starts[row * CELLS + c1 + 1]; at += 1) {
        const point = this.order[at];
        if (x[point] >= left && x[point] <= right && y[point] >= low && y[point] <= high) each(point);
      }
    }
  }

  fit() {
    this.ratio = Math.min(2, devicePixelRatio);
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight].map((side) => Math.max(1, Math.round(side * this.ratio)));
    if (this.canvas.width !== width || this.canvas.height !== height) { this.canvas.width = width; this.canvas.height = height; }
  }

  /** Pixels per unit of the plane, equal for both axes. */
  get scale() {
    const { left, right, low, high } = this.bounds;
    return Math.min((this.canvas.width * 0.9) / (right - left), (this.canvas.height * 0.9) / (high - low)) * this.view.zoom;
  }

  toScreen(x, y) { return [this.canvas.width / 2 + (x - this.view.x) * this.scale, this.canvas.height / 2 - (y - this.view.y) * this.scale]; }
  toPlane(px, py) { return [this.view.x + (px - this.canvas.width / 2) / this.scale, this.view.y - (py - this.canvas.height / 2) / this.scale]; }

  /** The visible rectangle of the plane, with a margin in pixels. */
  visibleRect(margin = 0) {
    const [left, high] = this.toPlane(-margin, -margin), [right, low] = this.toPlane(this.canvas.width + margin, this.canvas.height + margin);
    return [left, right, low, high];
  }

  /** The visible points, nearest to the centre first, at most `most`; and their total number. */
  visible(most) {
    const found = [];
    this.within(...this.visibleRect(), (point) => found.push(point));
    const { x, y } = this.points, { view } = this;
    const far = (point) => (x[point] - view.x) ** 2 + (y[point] - view.y) ** 2;
    const total = found.length;
    if (total > 4 * most && total > 2000) found.length = 2000;
    return { total, points: found.sort((a, b) => far(a) - far(b)).slice(0, most) };
  }

  /** The point nearest to the centre, visible or not. */
  nearestToCentre() {
    const { x, y } = this.points, { view } = this;
    let best = -1, least = Infinity;
    for (let at = 0; at < x.length; at += 1) {
      const far = (x[at] - view.x) ** 2 + (y[at] - view.y) ** 2;
      if (far < least && !this.dim?.[at]) { least = far; best = at; }
    }
    return best;
  }

  /** The point nearest to a position in CSS pixels; -1 if none is near. */
  pick(px, py) {
    const [cx, cy] = [px * this.ratio, py * this.ratio];
    const picture = this.drawn?.find((one) => Math.abs(one.px - cx) <= one.half && Math.abs(one.py - cy) <= one.half);
    if (picture) return picture.point;
    const [x, y] = this.toPlane(cx, cy), reach = (REACH * this.ratio) / this.scale;
    let best = -1, least = reach * reach;
    this.within(x - reach, x + reach, y - reach, y + reach, (point) => {
      const far = (this.points.x[point] - x) ** 2 + (this.points.y[point] - y) ** 2;
      if (far < least) { least = far; best = point; }
    });
    return best;
  }

  draw() {
    this.fit();
    this.dots();
    if (this.pictures) this.drawPictures(); else this.drawn = [];
    if (this.selected >= 0) this.ring(this.selected);
  }

  /** The pixels of the whole picture with the two axes. */
  background() {
    const { width, height } = this.canvas;
    if (this.frame?.width !== width || this.frame?.height !== height) {
      this.frame = new ImageData(width, height);
      this.pixels = new Uint32Array(this.frame.data.buffer);
    }
    const { pixels } = this, [x, y] = this.toScreen(0, 0).map(Math.round);
    pixels.fill(0);
    if (y >= 0 && y < height) pixels.fill(this.dimPaint, y * width, (y + 1) * width);
    if (x >= 0 && x < width) for (let at = x; at < pixels.length; at += width) pixels[at] = this.dimPaint;
    return pixels;
  }

  /** Draws square points in the colour of their value. Points of other values than the selected one are dimmed. */
  dots() {
    const { canvas, paints, dim, dimPaint } = this, { x, y } = this.points, { width, height } = canvas;
    const pixels = this.background(), rect = this.visibleRect(6);
    let n = 0;
    this.within(...rect, () => { n += 1; });
    const size = Math.max(2, Math.round((n > 40000 ? 2 : n > 4000 ? 3 : n > 600 ? 5 : 7) * Math.max(1, this.ratio * 0.8)));
    const half = size >> 1, scale = this.scale, [ox, oy] = this.toScreen(0, 0);
    const put = (point, paint) => {
      const px = Math.round(ox + x[point] * scale) - half, py = Math.round(oy - y[point] * scale) - half;
      if (px < 0 || py < 0 || px + size > width || py + size > height) return;
      for (let row = py * width + px, end = row + size * width; row < end; row += width) for (let at = row; at < row + size; at += 1) pixels[at] = paint;
    };
    // Dimmed points are drawn first, so that the others lie on top.
    if (dim) this.within(...rect, (point) => { if (dim[point]) put(point, dimPaint); });
    this.within(...rect, (point) => { if (!dim || !dim[point]) put(point, paints[point]); });
    this.context.putImageData(this.frame, 0, 0);
  }

  /** Draws pictures that do not overlap, beginning at the centre. */
  drawPictures() {
    this.drawn = [];
    // Without zoom, pictures would hide the shape of the whole.
    if (this.view.zoom < 1.9 && this.points.x.length > 60) return;
    const half = (PICTURE * this.ratio) / 2, taken = [];
    const { points } = this.visible(1500);
    const grid = new Set(), side = half * 2 + 6;
    for (const point of points) {
      if (this.dim?.[point]) continue;
      const [px, py] = this.toScreen(this.points.x[point], this.points.y[point]);
      const [column, row] = [Math.floor(px / side), Math.floor(py / side)];
      let free = true;
      for (let c = column - 1; free && c <= column + 1; c += 1) {
        for (let r = row - 1; free && r <= row + 1; r += 1) {
          const other = grid.has(`${c},${r}`) && taken.find((one) => one.cell === `${c},${r}`);
          if (other && Math.abs(other.px - px) < side && Math.abs(other.py - py) < side) free = false;
        }
      }
      if (!free) continue;
      const one = { point, px, py, half, cell: `${column},${row}` };
      grid.add(one.cell);
      taken.push(one);
      if (taken.length >= MAX_PICTURES) break;
    }
    for (const one of taken) {
      const image = this.image(one.point);
      if (!image) continue;
      const { context } = this;
      context.drawImage(image, one.px - half, one.py - half, 2 * half, 2 * half);
      context.lineWidth = 2 * this.ratio;
      const paint = this.paints[one.point];
      context.strokeStyle = `rgb(${paint & 255} ${(paint >> 8) & 255} ${(paint >> 16) & 255})`;
      context.strokeRect(one.px - half, one.py - half, 2 * half, 2 * half);
      this.drawn.push(one);
    }
  }

  /** A thumbnail, or null while it is loaded. The map is redrawn when it is. */
  image(point) {
    const id = this.points.ids[point];
    let image = this.images.get(id);
    if (!image) {
      if (this.images.size > 600) this.images.delete(this.images.keys().next().value);
      image = new Image();
      image.decoding = "async";
      image.onload = () => { image.ready = true; this.redraw(); };
      image.src = thumbnail({ id }, 96);
      this.images.set(id, image);
    }
    return image.ready ? image : null;
  }

  ring(point) {
    const { context } = this, [px, py] = this.toScreen(this.points.x[point], this.points.y[point]);
    context.strokeStyle = colour("--mark");
    context.lineWidth = 2.5 * this.ratio;
    const picture = this.drawn.find((one) => one.point === point);
    if (picture) { context.lineWidth *= 1.6; context.strokeRect(px - picture.half, py - picture.half, 2 * picture.half, 2 * picture.half); return; }
    context.beginPath();
    context.arc(px, py, 11 * this.ratio, 0, 7);
    context.stroke();
  }

  /** Zooms around a position in CSS pixels, by default the centre. */
  zoom(times, px = this.canvas.clientWidth / 2, py = this.canvas.clientHeight / 2) {
    const before = this.toPlane(px * this.ratio, py * this.ratio);
    this.view.zoom = Math.max(0.5, Math.min(4000, this.view.zoom * times));
    const after = this.toPlane(px * this.ratio, py * this.ratio);
    this.view.x += before[0] - after[0];
    this.view.y += before[1] - after[1];
  }

  /** Moves the map by CSS pixels. */
  pan(right, down) {
    this.view.x -= (right * this.ratio) / this.scale;
    this.view.y += (down * this.ratio) / this.scale;
  }
}
