// The wall of all textures, with filters and a search.
import * as api from "../api.js";
import { el, freshId, settled } from "../dom.js";
import { counted, count } from "../format.js";
import { go, href, tune } from "../route.js";
import { failed, instead, say } from "../tell.js";
import { Facets, chips } from "../parts/facets.js";
import { Tray } from "../parts/tray.js";
import { Wall } from "../parts/wall.js";

export const title = () => "Browse";

const SORTS = [["id", "oldest first"], ["-id", "newest first"], ["name", "name, a to z"], ["-name", "name, z to a"], ["-size", "largest first"], ["size", "smallest first"]];
const SIZES = { small: 72, medium: 116, large: 190 };

const read = (params) => ({ where: params.getAll("where"), text: params.get("text") ?? "", sort: params.get("sort") ?? "id", size: Object.hasOwn(SIZES, params.get("size")) ? params.get("size") : "medium" });

export async function show(root, route, { signal, server }) {
  let asked = read(route.params);
  const total = el("h1", { class: "total", "data-start": "", tabindex: "-1" }, "Textures");
  const chosen = el("div", { class: "chosen" });
  const grown = el("button", { type: "button", class: "grown", hidden: true }, "The store has changed: show");
  const nothing = el("div", { class: "wall-nothing", hidden: true });
  const tray = new Tray(route.params, (ids) => wall.showMarks(ids));
  const wall = new Wall({
    label: "Textures", size: SIZES[asked.size], signal,
    source: (offset, limit, signal) => api.textures({ offset, limit, sort: asked.sort === "id" ? null : asked.sort, where: asked.where, text: asked.text }, signal),
    alike: (entry) => go(href("query", null, { ids: entry.id })),
    mark: (entry) => tray.toggle(entry.id),
    moved: (at) => tune({ at: at || null }),
    told: (n) => tell(n),
  });
  const address = () => ({ where: asked.where, text: asked.text, sort: asked.sort === "id" ? null : asked.sort, size: asked.size === "medium" ? null : asked.size, mark: [...tray.ids].join(",") });
  const renew = async (at = 0) => {
    chosen.replaceChildren(chips(asked.where, filter));
    try { await wall.load(at); } catch (error) { failed(error); }
  };
  /** Filters make entries in the history; a text being typed rewrites the present one. */
  function filter(where) { go(href("browse", null, { ...address(), where })); }
  function tell(n) {
    const all = server.textures, some = asked.where.length > 0 || asked.text !== "";
    total.textContent = some && all !== null ? `${count(n)} of ${counted(all, "texture")}` : counted(n, "texture");
    say(total.textContent);
    nothing.hidden = n > 0;
    wall.element.hidden = n === 0;
    if (n === 0 && !some) server.ready.then(() => nothing.replaceChildren(empty(server)));
    else if (n === 0) nothing.replaceChildren(noneLikeThat());
  }
  const noneLikeThat = () => instead("No texture is like that", "No texture has all these tags and this text in its name.",
    el("p", {}, el("button", { type: "button", on: { click: () => { search.value = ""; go(href("browse", null, { sort: asked.sort })); } } }, "Show all textures")));

  const typed = settled(180, () => { asked.text = search.value.trim(); tune({ text: asked.text, at: null }); renew(); });
  const search = el("input", { id: "search", type: "search", placeholder: "name or tag", value: asked.text, autocomplete: "off", spellcheck: "false", "aria-label": "Search names and tags", on: { input: typed, search: () => typed.now() } });
  const sort = el("select", { "aria-label": "Order", on: { change: () => go(href("browse", null, { ...address(), sort: sort.value === "id" ? null : sort.value })) } },
    ...SORTS.map(([value, text]) => el("option", { value, selected: value === asked.sort }, text)));
  const name = freshId("size");
  const size = el("fieldset", { class: "choice sizes" }, el("legend", { class: "unseen" }, "Size of the pictures"), ...Object.keys(SIZES).map((key) =>
    el("label", { title: `${key} pictures` }, el("input", { type: "radio", name, value: key, checked: key === asked.size, "aria-label": key, on: { change: () => { asked.size = key; tune({ size: key === "medium" ? null : key }); wall.resize(SIZES[key]); } } }), el("span", { class: `swatch ${key}`, "aria-hidden": "true" }))));

  const facetBox = el("details", { class: "facet-box" }, el("summary", {}, "Filters"));
  // Open beside the wall, closed above it on narrow screens.
  const wide = matchMedia("(min-width: 780px)");
  const fold = () => { facetBox.open = wide.matches; };
  wide.addEventListener("change", fold, { signal });
  fold();
  let facets = null;
  api.tags(signal).then(({ tags }) => {
    facets = new Facets(tags, asked.where, filter);
    facetBox.append(facets.element);
  }).catch((error) => { if (error.name !== "AbortError") facetBox.append(el("p", { class: "soft" }, error.message)); });

  root.append(el("div", { class: "browse" },
    el("div", { class: "browse-head" }, total, grown, el("div", { class: "search" }, search, el("kbd", { "aria-hidden": "true" }, "/")), sort, size),
    chosen,
    el("aside", { "aria-label": "Filters", class: "browse-side" }, facetBox),
    el("div", { class: "browse-wall" }, wall.element, nothing, tray.element,
      el("p", { class: "hints edge" }, el("kbd", {}, "← ↑ ↓ →"), " move ", el("kbd", {}, "Enter"), " open ", el("kbd", {}, "f"), " find alike ", el("kbd", {}, "x"), " mark ", el("kbd", {}, "o"), " open a file"))));
  wall.marked = tray.ids;
  server.ready.then(() => { if (!signal.aborted && wall.total > 0) tell(wall.total); });
  await renew(Number(route.params.get("at")) || 0);
  // The store has grown by what was just added here, or elsewhere; the wall does not move under the reader's hands.
  const anew = () => { grown.hidden = true; renew(wall.first()); };
  grown.addEventListener("click", anew);
  addEventListener("store", anew, { signal });
  addEventListener("grown", () => { grown.hidden = false; }, { signal });

  return {
    reroute(next) {
      asked = read(next.params);
      if (search.value.trim() !== asked.text) search.value = asked.text;
      sort.value = asked.sort;
      facets?.set(asked.where);
      for (const input of size.querySelectorAll("input")) input.checked = input.value === asked.size;
      wall.size = SIZES[asked.size];
      renew(Number(next.params.get("at")) || 0);
      return true;
    },
    escape() { if (tray.ids.size > 0) tray.clear(); },
    leave() { typed.drop(); wall.leave(); },
  };
}

/** What an empty store says. */
function empty(server) {
  return instead("This store is empty", server.readOnly
    ? "This server only reads it. Textures that another process adds are shown as soon as they are there: hlacdb ingest scans/ --tag project=cores"
    : "Drop volumes anywhere on this page to add them, or run hlacdb ingest scans/ beside this server. Any of .npy, .nrrd, .nii, .mha, .tif, .vox will do.",
  !server.readOnly && el("p", {}, el("button", { type: "button", class: "main", on: { click: () => document.getElementById("open-file").click() } }, "Choose files…")));
}
