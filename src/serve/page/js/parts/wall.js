// A wall of textures of which only what is in sight exists: rows are made, moved and reused as the wall scrolls, and
// entries are fetched in pages. For screen readers it is a grid that knows its whole size.
import { eachFrame, el, named, settled } from "../dom.js";
import { place } from "./picture.js";

const PAGE = 200;
const GAP = 10;
const CAPTION = 22;
// Browsers stop laying out below some tens of millions of pixels: taller walls scroll in larger steps.
const TALLEST = 8e6;
const MOST_PAGES = 150;

/** `source(offset, limit, signal)` resolves to {total, textures}; `at` is the first texture in sight, told by `moved`. */
export class Wall {
  constructor({ label, size, source, open, alike, mark, moved, told, signal }) {
    Object.assign(this, { source, open, alike, mark, moved, told, signal, size });
    this.total = 0;
    this.pages = new Map();
    this.rows = new Map();
    this.spare = [];
    this.active = 0;
    this.marked = new Set();
    this.floor = el("div", { class: "wall-floor", role: "presentation" });
    this.element = el("div", { class: "wall", role: "grid", "aria-label": label, "aria-rowcount": 0, "aria-colcount": 0 }, this.floor);
    this.draw = eachFrame(() => this.layRows());
    // Pictures wait until the wall has come to rest: a fast scroll past thousands asks for none of them.
    this.rest = settled(90, () => { this.fetchSeen(); this.hang(); this.moved?.(this.first()); });
    this.element.addEventListener("scroll", () => { this.draw(); this.rest(); }, { passive: true });
    this.element.addEventListener("keydown", (event) => this.key(event));
    this.element.addEventListener("focusin", (event) => this.focused(event));
    this.watch = new ResizeObserver(() => this.measure());
    this.watch.observe(this.element);
  }

  /** Starts anew with another source's entries, at texture `at`. */
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
    this.told?.(this.total);
    this.measure(true);
    this.scrollTo(at);
    this.layRows(true);
    this.fetchSeen();
    this.hang();
  }

  /** Cells of another size; what was first in sight stays so. */
  resize(size) {
    this.size = size;
    this.measure();
  }

  measure(always = false) {
    const width = this.element.clientWidth - GAP;
    // Pictures grow with the letters, which are larger on large screens.
    const size = this.size * (parseFloat(getComputedStyle(document.documentElement).fontSize) / 14);
    const columns = Math.max(2, Math.round(width / (size + GAP)));
    const cell = Math.floor(width / columns) - GAP;
    if (!always && columns === this.columns && cell === this.cell) { this.draw(); this.rest(); return; }
    const at = this.columns ? this.first() : 0;
    Object.assign(this, { columns, cell, step: cell + CAPTION + GAP });
    this.rowCount = Math.ceil(this.total / columns);
    this.tall = this.rowCount * this.step + GAP;
    this.height = Math.min(this.tall, TALLEST);
    this.floor.style.height = `${this.height}px`;
    this.element.style.setProperty("--cell", `${cell}px`);
    // Beside a number there is no room for a name under a small picture.
    this.element.classList.toggle("tight", cell < 92);
    this.element.setAttribute("aria-rowcount", this.rowCount);
    this.element.setAttribute("aria-colcount", columns);
    for (const row of this.rows.values()) row.element.remove();
    this.rows.clear();
    this.spare = [];
    if (!always) { this.scrollTo(at); this.layRows(); this.rest(); }
  }

  /** How far down the wall the window begins, in the wall's own pixels. */
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
    // The row that has the focus stays in the page, or the focus would be lost.
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
        if (!row.element.isConnected) this.floor.append(row.element);
      }
      row.element.style.transform = `translateY(${at * this.step + GAP + shift}px)`;
    }
    for (const row of this.spare) row.element.remove();
  }

  makeRow() {
    const cells = Array.from({ length: this.columns }, () => {
      const box = el("span", { class: "box" });
      const id = el("span", { class: "edge" }), name = el("span", { class: "place" });
      const link = el("a", { class: "frame", tabindex: "-1" }, box, el("span", { class: "caption" }, id, " ", name));
      return { element: el("div", { role: "gridcell", class: "cell" }, link), link, box, id, name, entry: null };
    });
    return { element: el("div", { role: "row", class: "wall-row" }, cells.map((cell) => cell.element)), cells };
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
    cell.hung = false;
    cell.box.replaceChildren();
    cell.element.classList.toggle("waiting", !entry);
    cell.id.textContent = entry ? entry.id : "";
    cell.name.replaceChildren(entry ? named(entry.name) : "");
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

  /** Puts pictures into the cells in sight that have none yet. */
  hang() {
    const size = this.cell * devicePixelRatio > 128 ? 192 : 96;
    for (const row of this.rows.values()) {
      for (const cell of row.cells) {
        if (!cell.entry || cell.hung) continue;
        cell.hung = true;
        cell.box.replaceChildren(place(cell.entry, size));
      }
    }
  }

  fetchSeen() {
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
      if (this.pages.size > MOST_PAGES) {
        const far = [...this.pages.keys()].sort((a, b) => Math.abs(b - page) - Math.abs(a - page))[0];
        this.pages.delete(far);
      }
      for (const row of this.rows.values()) this.fillRow(row, row.at);
      this.hang();
    } catch (error) {
      if (generation === this.generation) this.pages.delete(page);
      if (error.name !== "AbortError") throw error;
    }
  }

  /** Shows which textures are marked. */
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
      // A step past an edge goes nowhere rather than to the far corner.
      if (to >= 0 && to < this.total) this.activate(to);
      else if (step < -1) this.activate(this.active % this.columns);
      else if (step > 1) this.activate(this.total - 1);
    } else if (event.key === "Home") this.activate(0);
    else if (event.key === "End") this.activate(this.total - 1);
    else if (event.key === "f" && entry) this.alike(entry);
    else if ((event.key === "x" || event.key === " ") && entry) this.mark(entry);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  leave() {
    this.watch.disconnect();
    this.draw.drop();
    this.rest.drop();
  }
}
