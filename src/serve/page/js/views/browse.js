// The grid of all textures, with filters and a search.
import * as api from "../api.js";
import { el, uniqueId, debounce } from "../dom.js";
import { counted, count } from "../format.js";
import { go, href, replaceParams } from "../route.js";
import { reportError, emptyState, announce } from "../messages.js";
import { Facets, chips } from "../parts/facets.js";
import { Tray } from "../parts/tray.js";
import { TextureGrid } from "../parts/grid.js";

export const title = () => "Browse";

const SORTS = [["id", "oldest first"], ["-id", "newest first"], ["name", "name, a to z"], ["-name", "name, z to a"], ["-size", "largest first"], ["size", "smallest first"]];
const SIZES = { small: 72, medium: 116, large: 190 };

const readState = (params) => ({ where: params.getAll("where"), text: params.get("text") ?? "", sort: params.get("sort") ?? "id", size: Object.hasOwn(SIZES, params.get("size")) ? params.get("size") : "medium" });

export async function show(root, route, { signal, server }) {
  let state = readState(route.params);
  const total = el("h1", { class: "total", "data-start": "", tabindex: "-1" }, "Textures");
  const chosen = el("div", { class: "chosen" });
  const changed = el("button", { type: "button", class: "store-changed", hidden: true }, "The store has changed: show");
  const nothing = el("div", { class: "grid-empty", hidden: true });
  const tray = new Tray(route.params, (ids) => grid.showMarks(ids));
  const grid = new TextureGrid({
    label: "Textures", size: SIZES[state.size], signal,
    source: (offset, limit, signal) => api.textures({ offset, limit, sort: state.sort === "id" ? null : state.sort, where: state.where, text: state.text }, signal),
    findSimilar: (entry) => go(href("query", null, { ids: entry.id })),
    toggleMark: (entry) => tray.toggle(entry.id),
    onScroll: (at) => replaceParams({ at: at || null }),
    onTotal: (n) => showTotal(n),
  });
  const address = () => ({ where: state.where, text: state.text, sort: state.sort === "id" ? null : state.sort, size: state.size === "medium" ? null : state.size, mark: [...tray.ids].join(",") });
  const load = async (at = 0) => {
    chosen.replaceChildren(chips(state.where, filter));
    try { await grid.load(at); } catch (error) { reportError(error); }
  };
  /** A filter adds an entry to the history; typing changes the current one. */
  function filter(where) { go(href("browse", null, { ...address(), where })); }
  function showTotal(n) {
    const all = server.textures, filtered = state.where.length > 0 || state.text !== "";
    total.textContent = filtered && all !== null ? `${count(n)} of ${counted(all, "texture")}` : counted(n, "texture");
    announce(total.textContent);
    nothing.hidden = n > 0;
    grid.element.hidden = n === 0;
    if (n === 0 && !filtered) Promise.all([api.formats(), server.ready]).then(([formats]) => nothing.replaceChildren(empty(server, formats))).catch(reportError);
    else if (n === 0) nothing.replaceChildren(noMatch());
  }
  const noMatch = () => emptyState("No texture matches", "No texture has all these tags and this text in its name or tags.",
    el("p", {}, el("button", { type: "button", on: { click: () => { search.value = ""; go(href("browse", null, { sort: state.sort })); } } }, "Show all textures")));

  const typed = debounce(180, () => { state.text = search.value.trim(); replaceParams({ text: state.text, at: null }); load(); });
  const search = el("input", { id: "search", type: "search", placeholder: "name or tag", value: state.text, autocomplete: "off", spellcheck: "false", "aria-label": "Search names and tags", on: { input: typed, search: () => typed.flush() } });
  const sort = el("select", { "aria-label": "Sort order", on: { change: () => go(href("browse", null, { ...address(), sort: sort.value === "id" ? null : sort.value })) } },
    ...SORTS.map(([value, text]) => el("option", { value, selected: value === state.sort }, text)));
  const name = uniqueId("size");
  const size = el("fieldset", { class: "choice sizes" }, el("legend", { class: "visually-hidden" }, "Size of the pictures"), ...Object.keys(SIZES).map((key) =>
    el("label", { title: `${key} pictures` }, el("input", { type: "radio", name, value: key, checked: key === state.size, "aria-label": key, on: { change: () => { state.size = key; replaceParams({ size: key === "medium" ? null : key }); grid.resize(SIZES[key]); } } }), el("span", { class: `swatch ${key}`, "aria-hidden": "true" }))));

  const facetBox = el("details", { class: "facet-box" }, el("summary", {}, "Filters"));
  // Open beside the grid, closed above it on narrow screens.
  const wide = matchMedia("(min-width: 780px)");
  const toggleFacets = () => { facetBox.open = wide.matches; };
  wide.addEventListener("change", toggleFacets, { signal });
  toggleFacets();
  let facets = null;
  api.tags(signal).then(({ tags }) => {
    facets = new Facets(tags, state.where, filter);
    facetBox.append(facets.element);
  }).catch((error) => { if (error.name !== "AbortError") facetBox.append(el("p", { class: "soft" }, error.message)); });

  root.append(el("div", { class: "browse" },
    el("div", { class: "browse-head" }, total, changed, el("div", { class: "search" }, search, el("kbd", { "aria-hidden": "true" }, "/")), sort, size),
    chosen,
    el("aside", { "aria-label": "Filters", class: "browse-side" }, facetBox),
    el("div", { class: "browse-grid" }, grid.element, nothing, tray.element,
      el("p", { class: "hints edge" }, el("kbd", {}, "← ↑ ↓ →"), " move ", el("kbd", {}, "Enter"), " open ", el("kbd", {}, "f"), " find similar ", el("kbd", {}, "x"), " mark ", el("kbd", {}, "o"), " open a file"))));
  grid.marked = tray.ids;
  server.ready.then(() => { if (!signal.aborted && grid.total > 0) showTotal(grid.total); });
  await load(Number(route.params.get("at")) || 0);
  // Files added on this page are shown at once; changes by others only on request, so that the grid does not move by itself.
  const reload = () => { changed.hidden = true; load(grid.first()); };
  changed.addEventListener("click", reload);
  addEventListener("files-added", reload, { signal });
  addEventListener("store-changed", () => { changed.hidden = false; }, { signal });

  return {
    reroute(next) {
      state = readState(next.params);
      if (search.value.trim() !== state.text) search.value = state.text;
      sort.value = state.sort;
      facets?.set(state.where);
      for (const input of size.querySelectorAll("input")) input.checked = input.value === state.size;
      grid.size = SIZES[state.size];
      load(Number(next.params.get("at")) || 0);
      return true;
    },
    escape() { if (tray.ids.size > 0) tray.clear(); },
    leave() { typed.cancel(); grid.leave(); },
  };
}

/** Stands in for the grid of an empty store. */
function empty(server, formats) {
  return emptyState("This store is empty", server.readOnly
    ? "This server is read-only. Textures that another process adds appear here: hlacdb ingest scans/ --tag project=cores"
    : `Drop volumes anywhere on this page to add them (${formats}).`,
  !server.readOnly && el("p", {}, el("button", { type: "button", class: "main", on: { click: () => document.getElementById("open-file").click() } }, "Choose files…")));
}
