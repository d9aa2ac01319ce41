// The tags of the store as filters: each key with its values and the number of textures that have them.
import { el } from "../dom.js";
import { count } from "../format.js";

const SHOWN = 12;

/** `where`: the active filters as "key=value". `changed(where)` is called with new ones. A key has one value at a time, because all filters must hold. */
export class Facets {
  constructor(tags, where, changed) {
    Object.assign(this, { tags, where: [...where], changed, open: new Set() });
    this.element = el("div", { class: "facets" });
    this.draw();
  }

  set(where) {
    this.where = [...where];
    this.draw();
  }

  toggle(key, value) {
    const pair = `${key}=${value}`, on = this.where.includes(pair);
    this.where = this.where.filter((other) => !other.startsWith(`${key}=`));
    if (!on) this.where.push(pair);
    this.draw();
    this.changed(this.where);
  }

  draw() {
    const focused = document.activeElement?.dataset?.pair;
    if (this.tags.length === 0) this.element.replaceChildren(el("p", { class: "soft" }, "No texture has a tag yet. Add tags to filter by them: hlacdb ingest … --tag rock=ketton"));
    else this.element.replaceChildren(...this.tags.map((tag) => this.key(tag)));
    if (focused) this.element.querySelector(`[data-pair="${CSS.escape(focused)}"]`)?.focus();
  }

  key({ key, values, others }) {
    const all = this.open.has(key);
    const chosen = this.where.filter((pair) => pair.startsWith(`${key}=`)).map((pair) => pair.slice(key.length + 1));
    const first = values.slice(0, all ? undefined : SHOWN);
    // A chosen value is always shown, even if it is rare or missing from the list.
    for (const value of chosen) if (!first.some((one) => one.value === value)) first.unshift(values.find((one) => one.value === value) ?? { value, count: null });
    const most = Math.max(1, ...values.map((one) => one.count));
    const buttons = first.map(({ value, count: n }) => el("li", {},
      el("button", { type: "button", class: "facet", "aria-pressed": String(chosen.includes(value)), data: { pair: `${key}=${value}` }, style: { "--share": (n ?? 0) / most }, on: { click: () => this.toggle(key, value) } },
        el("span", { class: "value" }, value === "" ? "(empty)" : value), el("span", { class: "edge" }, n === null ? "" : count(n)))));
    const hidden = values.length - Math.min(values.length, SHOWN);
    return el("section", {}, el("h2", { class: "key" }, key), el("ul", { class: "plain" }, ...buttons),
      hidden > 0 && el("button", { type: "button", class: "quiet more", "aria-expanded": String(all), on: { click: () => { if (all) this.open.delete(key); else this.open.add(key); this.draw(); } } }, all ? "fewer" : `${count(hidden)} more`),
      others > 0 && all && el("p", { class: "soft" }, `${count(others)} rarer values are not listed. Search for them by text.`));
  }
}

/** The active filters as buttons that remove them. */
export function chips(where, changed) {
  return el("ul", { class: "plain chips", "aria-label": "Active filters", hidden: where.length === 0 }, ...where.map((pair) =>
    el("li", {}, el("button", { type: "button", class: "chip on", "aria-label": `Remove the filter ${pair}`, on: { click: () => changed(where.filter((other) => other !== pair)) } }, pair.replace("=", " = "), el("span", { "aria-hidden": "true" }, " ×")))));
}
