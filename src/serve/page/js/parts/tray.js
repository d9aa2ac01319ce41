// The tray: textures that are marked as examples, to search by all of them or to compare two. They are part of the address.
import { el } from "../dom.js";
import { counted } from "../format.js";
import { href, replaceParams } from "../route.js";
import { announce } from "../messages.js";

/** `changed(ids)` gets the Set of marked ids; `space()` returns the chosen space, if any. */
export class Tray {
  constructor(params, changed, space = () => null) {
    Object.assign(this, { changed, space });
    this.ids = new Set((params.get("mark") ?? "").split(",").map(Number).filter((id) => id > 0));
    this.element = el("div", { class: "tray", role: "region", "aria-label": "Marked textures", hidden: true });
    this.draw();
  }

  toggle(id) {
    if (this.ids.has(id)) this.ids.delete(id); else this.ids.add(id);
    announce(this.ids.has(id) ? `Marked. ${counted(this.ids.size, "texture")} marked.` : "Mark removed.");
    this.update();
  }

  clear() {
    this.ids.clear();
    this.update();
  }

  update() {
    replaceParams({ mark: [...this.ids].join(",") });
    this.draw();
    this.changed(this.ids);
  }

  draw() {
    const ids = [...this.ids], space = this.space();
    this.element.hidden = ids.length === 0;
    this.element.replaceChildren(
      el("span", { class: "tray-count" }, `${ids.length} marked`),
      el("a", { class: "button main", href: href("query", null, { ids: ids.join(","), space }) }, ids.length > 1 ? "Find similar to all" : "Find similar"),
      ids.length === 2 ? el("a", { class: "button", href: href("compare", null, { a: ids[0], b: ids[1], space }) }, "Compare") : null,
      el("button", { type: "button", class: "quiet", on: { click: () => this.clear() } }, "Clear"));
  }
}
