// The tray: textures marked as examples, to search with all of them, or to look at two side by side. Kept in the address.
import { el } from "../dom.js";
import { counted } from "../format.js";
import { href, tune } from "../route.js";
import { say } from "../tell.js";

/** `changed(ids)`: a Set of marked ids. `space()`: the space in use, if one is chosen. */
export class Tray {
  constructor(params, changed, space = () => null) {
    Object.assign(this, { changed, space });
    this.ids = new Set((params.get("mark") ?? "").split(",").map(Number).filter((id) => id > 0));
    this.element = el("div", { class: "tray", role: "region", "aria-label": "Marked textures", hidden: true });
    this.draw();
  }

  toggle(id) {
    if (this.ids.has(id)) this.ids.delete(id); else this.ids.add(id);
    say(this.ids.has(id) ? `Marked, ${counted(this.ids.size, "texture")} in all.` : `No longer marked.`);
    this.tell();
  }

  clear() {
    this.ids.clear();
    this.tell();
  }

  tell() {
    tune({ mark: [...this.ids].join(",") });
    this.draw();
    this.changed(this.ids);
  }

  draw() {
    const ids = [...this.ids], space = this.space();
    this.element.hidden = ids.length === 0;
    this.element.replaceChildren(
      el("span", { class: "tray-count" }, `${ids.length} marked`),
      el("a", { class: "button main", href: href("query", null, { ids: ids.join(","), space }) }, ids.length > 1 ? "Find alike to all of them" : "Find alike"),
      ids.length === 2 ? el("a", { class: "button", href: href("compare", null, { a: ids[0], b: ids[1], space }) }, "Side by side") : null,
      el("button", { type: "button", class: "quiet", on: { click: () => this.clear() } }, "Clear"));
  }
}
