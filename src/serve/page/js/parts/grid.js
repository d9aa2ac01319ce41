// A virtual grid of textures: only visible rows exist. Rows are reused while the grid scrolls, and entries are fetched in
// pages. Screen readers get the size of the whole grid.
import { oncePerFrame, el, shortenedName, debounce } from "../dom.js";
import { thumbnail } from "./picture.js";

const PAGE = 200;
const GAP = 10;
const CAPTION = 22;
// Browsers limit the height of elements to some tens of millions of pixels, so taller grids scroll in larger steps.
const MAX_HEIGHT = 8e6;
const MAX_PAGES = 150;

/**
 * `source(offset, limit, signal)` resolves to {total, textures}. `onTotal(total)` is called when the list is loaded,
 * `onScroll(index)` with the first visible texture, `findSimilar(entry)` and `toggleMark(entry)` on the keys f and x.
 */
export class TextureGrid {
  constructor({ label, size, source, findSimilar, toggleMark, onScroll, onTotal, signal }) {
    Object.assign(this, { source, findSimilar, toggleMark, onScroll, onTotal, signal, size });
    this.total = 0;
    this.pages = new Map();
    this.rows = new Map();
    this.spare = [];
    this.active = 0;
    this.marked = new Set();
    this.canvas = el("div", { class: "grid-canvas", role: "presentation" });
    this.element = el("div", { class: "grid", role: "grid", "aria-label": label, "aria-rowcount": 0, "aria-colcount": 0 }, this.canvas);
    this.draw = oncePerFrame(() => this.layRows());
    // Pictures are loaded when scrolling has stopped, so that a fast scroll past thousands loads none of them.
    this.settle = debounce(90, () => { this.fetchVisible(); this.loadPictures(); this.onScroll?.(this.first()); });
    this.element.addEventListener("scroll", () => { this.draw(); this.settle(); }, { passive: true });
    this.element.addEventListener("keydown", (event) => this.key(event));
    this.element.addEventListener("focusin", (event) => this.focused(event));
    this.watch = new ResizeObserver(() => this.measure());
    this.watch.observe(this.element);
  }

  /** Loads the entries again and scrolls to the one at index `at`. */
  async load(at = 0) {
    this.generation = (this.generation ?? 0) + 1;
    const generation = this.generation;
    const page = Math.floor(at / PAGE);
    const answer = await this.source(page * PAGE, PAGE, this.signal);
    if (generation !== this.generation) return;
    this.pages.clear();
    this.total = answer.total;
    this.pages.set(page, answer.textures);
    this.active = Math.min(at, Math.max(0, this.total - 1));
    this.onTotal?.(this.total);
    this.measure(true);
    this.scrollTo(at);
    this.layRows(true);
    this.fetchVisible();
    this.loadPictures();
  }

  /** Changes the size of the cells. The first visible texture stays visible. */
  resize(size) {
    this.size = size;
    this.measure();
  }

  measure(always = false) {
    const width = this.element.clientWidth - GAP;
    // Pictures scale with the font size, which is larger on large screens.
    const size = this.size * (parseFloat(getComputedStyle(document.documentElement).fontSize) / 14);
    const columns = Math.max(2, Math.round(width / (size + GAP)));
    const cell = Math.floor(width / columns) - GAP;
    if (!always && columns === this.columns && cell === this.cell) { this.draw(); this.settle(); return; }
    const at = this.columns ? this.first() : 0;
    Object.assign(this, { columns, cell, step: cell + CAPTION + GAP });
    this.rowCount = Math.ceil(this.total / columns);
    this.tall = this.rowCount * this.step + GAP;
    this.height = Math.min(this.tall, MAX_HEIGHT);
    this.canvas.style.height = `${this.height}px`;
    this.element.style.setProperty("--cell", `${cell}px`);
    // Below small pictures there is no room for names.
    this.element.classList.toggle("tight", cell < 92);
    this.element.setAttribute("aria-rowcount", this.rowCount);
    this.element.setAttribute("aria-colcount", columns);
    for (const row of this.rows.values()) row.element.remove();
    this.rows.clear();
    this.spare = [];
    if (!always) { this.scrollTo(at); this.layRows(); this.settle(); }
  }

  /** The scroll position in pixels of the whole grid, which may be taller than its element. */
  top() {
    const { scrollTop, clientHeight } = this.element;
    const room = this.height - clientHeight;
    return this.tall === this.height || room <= 0 ? scrollTop : (scrollTop / room) * (this.tall - clientHeight);
  }

  first() { return Math.min(Math.max(0, this.total - 1), Math.max(0, Math.round(this.top() / this.step)) * this.columns); }

  scrollTo(index) {
    const want = Math.floor(index / this.columns) * this.step;
    const { clientHeight } = this.element;
    const share = this.tall === this.height ? 1 : (this.height - clientHeight) / (this.tall - clientHeight);
    this.element.scrollTop = want * share;
  }

  layRows() {
    if (!this.columns) return;
    const top = this.top(), shift = this.element.scrollTop - top, reach = this.element.clientHeight;
    const from = Math.max(0, Math.floor(top / this.step) - 1);
    const to = Math.min(this.rowCount - 1, Math.ceil((top + reach) / this.step) + 1);
    const wanted = new Set();
    for (let at = from; at <= to; at += 1) wanted.add(at);
    // The focused row is kept, or the focus would be lost.
    if (this.element.contains(document.activeElement)) wanted.add(Math.floor(this.active / this.columns));
    for (const [at, row] of this.rows) {
      if (!wanted.has(at)) { this.rows.delete(at); this.spare.push(row); }
    }
    for (const at of wanted) {
      let row = this.rows.get(at);
      if (!row) {
        row = this.spare.pop() ?? this.makeRow();
        this.rows.set(at, row);
        this.fillRow(row, at);
        if (!row.element.isConnected) this.canvas.append(row.element);
      }
      row.element.style.transform = `translateY(${at * this.step + GAP + shift}px)`;
    }
    for (const row of this.spare) row.element.remove();
  }

  makeRow() {
    const cells = Array.from({ length: this.columns }, () => {
      const box = el("span", { class: "box" });
      const id = el("span", { class: "edge" }), name = el("span", { class: "caption-name" });
      const link = el("a", { class: "frame", tabindex: "-1" }, box, el("span", { class: "caption" }, id, " ", name));
      return { element: el("div", { role: "gridcell", class: "cell" }, link), link, box, id, name, entry: null };
    });
    return { element: el("div", { role: "row", class: "grid-row" }, cells.map((cell) => cell.element)), cells };
  }

  entry(index) { return this.pages.get(Math.floor(index / PAGE))?.[index % PAGE] ?? null; }

  fillRow(row, at) {
    row.at = at;
    row.element.setAttribute("aria-rowindex", at + 1);
    row.cells.forEach((cell, column) => this.fillCell(cell, at * this.columns + column, column));
  }

  fillCell(cell, index, column) {
    const there = index < this.total, entry = there ? this.entry(index) : null;
    cell.element.hidden = !there;
    cell.element.setAttribute("aria-colindex", column + 1);
    cell.index = index;
    cell.link.tabIndex = index === this.active ? 0 : -1;
    if (entry && entry === cell.entry) { this.fillMark(cell); return; }
    cell.entry = entry;
    cell.hasPicture = false;
    cell.box.replaceChildren();
    cell.element.classList.toggle("waiting", !entry);
    cell.id.textContent = entry ? entry.id : "";
    cell.name.replaceChildren(entry ? shortenedName(entry.name) : "");
    if (entry) {
      cell.link.href = `#/texture/${entry.id}`;
      cell.link.title = [entry.name, ...Object.entries(entry.tags).map(([key, value]) => `${key}: ${value}`)].join("\n");
    } else cell.link.removeAttribute("href");
    this.fillMark(cell);
  }

  fillMark(cell) {
    const on = cell.entry !== null && this.marked.has(cell.entry.id);
    cell.element.classList.toggle("marked", on);
    if (cell.entry) cell.link.setAttribute("aria-label", `${cell.entry.id} ${cell.entry.name}${on ? ", marked" : ""}`);
  }

  /** Adds the missing pictures of the visible cells. */
  loadPictures() {
    const size = this.cell * devicePixelRatio > 128 ? 192 : 96;
    for (const row of this.rows.values()) {
      for (const cell of row.cells) {
        if (!cell.entry || cell.hasPicture) continue;
        cell.hasPicture = true;
        cell.box.replaceChildren(thumbnail(cell.entry, size));
      }
    }
  }

  fetchVisible() {
    if (!this.columns || this.total === 0) return;
    const top = this.top();
    const from = Math.max(0, Math.floor(top / this.step)) * this.columns;
    const to = Math.min(this.total - 1, (Math.ceil((top + this.element.clientHeight) / this.step) + 1) * this.columns);
    for (let page = Math.floor(from / PAGE); page <= Math.floor(to / PAGE); page += 1) this.fetchPage(page);
  }

  async fetchPage(page) {
    if (this.pages.has(page)) return;
    const generation = this.generation;
    this.pages.set(page, null);
    try {
      const answer = await this.source(page * PAGE, PAGE, this.signal);
      if (generation !== this.generation) return;
      this.pages.set(page, answer.textures);
      if (this.pages.size > MAX_PAGES) {
        const far = [...this.pages.keys()].sort((a, b) => Math.abs(b - page) - Math.abs(a - page))[0];
        this.pages.delete(far);
      }
      for (const row of this.rows.values()) this.fillRow(row, row.at);
      this.loadPictures();
    } catch (error) {
      if (generation === this.generation) this.pages.delete(page);
      if (error.name !== "AbortError") throw error;
    }
  }

  /** Shows the marks of these ids. */
  showMarks(ids) {
    this.marked = ids;
    for (const row of this.rows.values()) row.cells.forEach((cell) => this.fillMark(cell));
  }

  focused(event) {
    const cell = this.cellOf(event.target);
    if (cell && cell.index !== this.active) this.activate(cell.index, false);
  }

  cellOf(target) {
    for (const row of this.rows.values()) for (const cell of row.cells) if (cell.element.contains(target)) return cell;
    return null;
  }

  activate(index, focus = true) {
    this.active = Math.max(0, Math.min(this.total - 1, index));
    const row = Math.floor(this.active / this.columns), top = this.top(), at = row * this.step;
    if (focus && at < top) this.scrollTo(this.active);
    else if (focus && at + this.step > top + this.element.clientHeight) {
      const fit = Math.max(0, Math.floor(this.element.clientHeight / this.step) - 1);
      this.scrollTo(Math.max(0, (row - fit) * this.columns));
    }
    this.layRows();
    for (const row of this.rows.values()) {
      for (const cell of row.cells) {
        cell.link.tabIndex = cell.index === this.active ? 0 : -1;
        if (focus && cell.index === this.active) cell.link.focus({ preventScroll: true });
      }
    }
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const page = Math.max(1, Math.floor(this.element.clientHeight / this.step)) * this.columns;
    const step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -this.columns, ArrowDown: this.columns, PageUp: -page, PageDown: page }[event.key];
    const entry = this.entry(this.active);
    if (step !== undefined) {
      const to = this.active + step;
      // A step past an edge stops at the edge.
      if (to >= 0 && to < this.total) this.activate(to);
      else if (step < -1) this.activate(this.active % this.columns);
      else if (step > 1) this.activate(this.total - 1);
    } else if (event.key === "Home") this.activate(0);
    else if (event.key === "End") this.activate(this.total - 1);
    else if (event.key === "f" && entry) this.findSimilar(entry);
    else if ((event.key === "x" || event.key === " ") && entry) this.toggleMark(entry);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  leave() {
    this.watch.disconnect();
    this.draw.cancel();
    this.settle.cancel();
  }
}
