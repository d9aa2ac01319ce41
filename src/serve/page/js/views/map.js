// A map of the store: its points on the two axes of greatest variance of a space, coloured by a tag.
import * as api from "../api.js";
import { oncePerFrame, el, uniqueId, shortenedName, debounce } from "../dom.js";
import { count, counted, percent } from "../format.js";
import { go, href, replaceParams } from "../route.js";
import { reportError, emptyState } from "../messages.js";
import { colour } from "../theme.js";
import { css, palette } from "../map/palette.js";
import { Scatter } from "../map/scatter.js";
import { thumbnail } from "../parts/picture.js";
import { tagLine } from "../parts/tags.js";

export const title = () => "Map";
const MAX_LISTED = 24;

export async function show(root, route, { signal }) {
  const params = route.params;
  const [spaces, { tags }] = await Promise.all([api.spaces(), api.tags(signal)]);
  // By default the first key with several values, but not as many as textures.
  const defaultKey = tags.find(({ values, others }) => values.length > 1 && values.length <= 60 && !others)?.key ?? tags[0]?.key ?? null;
  const key = params.has("tag") ? params.get("tag") : defaultKey;
  const space = params.get("space") ?? spaces.default;
  const map = await api.map(space, key, signal);
  const ids = [uniqueId("space"), uniqueId("tag"), uniqueId("pictures")];
  const spaceSelect = el("select", { id: ids[0], on: { change: () => go(href("map", null, { space: spaceSelect.value, tag: params.get("tag") })) } }, ...spaces.spaces.map((one) => el("option", { value: one.name, selected: one.name === space }, one.name)));
  const tagSelect = el("select", { id: ids[1], on: { change: () => go(href("map", null, { space: params.get("space"), tag: tagSelect.value })) } }, ...tags.map((one) => el("option", { value: one.key, selected: one.key === key }, one.key)));
  const { explained } = map;
  const head = el("div", { class: "section-head" }, el("h1", { "data-start": "", tabindex: "-1" }, "Map"),
    el("div", { class: "row" }, el("label", { for: ids[0] }, "space"), spaceSelect), tags.length > 0 && el("div", { class: "row" }, el("label", { for: ids[1] }, "coloured by"), tagSelect),
    el("p", { class: "edge" }, `${counted(map.total, "texture")} · the two axes hold ${percent(explained[0] + explained[1])} of the variance`));
  if (map.ids.length === 0) { root.append(el("div", { class: "map-view" }, head, emptyState("No map yet", "The store has no points in this space. Add textures, or fit the space under Statistics."))); return null; }

  const canvas = el("canvas", { class: "map", tabindex: "0", role: "application", "aria-roledescription": "map", "aria-label": `Map of ${counted(map.ids.length, "texture")}: arrow keys move it, plus and minus zoom, 0 shows all, Enter selects the texture nearest to the centre. Visible textures are listed beside it.` });
  const tip = el("div", { class: "map-tip", hidden: true });
  const legend = el("div", { class: "legend" }), card = el("div", { class: "map-card", hidden: true, role: "region", "aria-label": "The selected texture" });
  const list = el("ul", { class: "plain visible-list" }), listed = el("p", { class: "edge" });
  const zoomTo = (times) => { scatter.zoom(times); moved(); };
  const tools = el("div", { class: "map-tools" },
    el("button", { type: "button", "aria-label": "Zoom in", on: { click: () => zoomTo(1.6) } }, "+"), el("button", { type: "button", "aria-label": "Zoom out", on: { click: () => zoomTo(1 / 1.6) } }, "−"),
    el("button", { type: "button", "aria-label": "Show all", on: { click: () => { scatter.measure(); moved(); } } }, "all"));
  root.append(el("div", { class: "map-view" }, head, el("div", { class: "map-stage" }, canvas, tip, tools, card),
    el("aside", { class: "map-side", "aria-label": "Legend and visible textures" }, legend, el("section", {}, el("h2", {}, "Visible"), listed, list))));

  const draw = oncePerFrame(() => scatter.draw());
  const scatter = new Scatter(canvas, { ids: map.ids, x: Float64Array.from(map.x), y: Float64Array.from(map.y) }, draw);
  const names = new Map();
  let only = params.get("only");
  function paint() {
    const dark = getComputedStyle(document.documentElement).colorScheme.includes("dark") && !getComputedStyle(document.documentElement).colorScheme.includes("light")
      || (document.documentElement.dataset.theme === undefined && matchMedia("(prefers-color-scheme: dark)").matches);
    const colours = palette(Math.max(1, map.values?.length ?? 0), dark), none = dark ? [150, 150, 146] : [110, 110, 106];
    const packed = ([r, g, b]) => (255 << 24 | b << 16 | g << 8 | r) >>> 0;
    const paints = colours.map(packed), plain = packed(none);
    scatter.paints = Uint32Array.from(map.ids, (_, at) => { const value = map.value?.[at] ?? -1; return value < 0 ? plain : paints[value]; });
    scatter.dimPaint = packed(colour("--hair").match(/\d+/g).slice(0, 3).map(Number));
    dim();
    drawLegend(colours, none);
    draw();
  }
  function dim() {
    const at = only === null ? -1 : map.values.indexOf(only);
    scatter.dim = at < 0 ? null : Uint8Array.from(map.ids, (_, point) => (map.value[point] === at ? 0 : 1));
  }
  function drawLegend(colours, none) {
    const counts = new Map();
    for (const value of map.value ?? []) counts.set(value, (counts.get(value) ?? 0) + 1);
    const entry = (value, text, paint) => el("li", {}, el("button", { type: "button", class: "facet", "aria-pressed": String(value !== null && only === value), disabled: value === null, on: { click: () => { only = only === value ? null : value; replaceParams({ only }); repaint(); } } },
      el("i", { class: "dot", style: { background: css(paint) } }), el("span", { class: "value" }, text), el("span", { class: "edge" }, count(counts.get(value === null ? -1 : map.values.indexOf(value)) ?? 0))));
    const top = legend.querySelector("ul")?.scrollTop ?? 0;
    legend.replaceChildren(el("h2", {}, key ?? "Textures"), el("ul", { class: "plain" }, ...(map.values ?? []).map((value, at) => entry(value, value || "(empty)", colours[at])), counts.has(-1) && key ? entry(null, "without", none) : null));
    legend.querySelector("ul").scrollTop = top;
  }
  const repaint = () => { const focused = legend.contains(document.activeElement) ? [...legend.querySelectorAll("button")].indexOf(document.activeElement) : -1; paint(); listVisible(); if (focused >= 0) legend.querySelectorAll("button")[focused]?.focus(); };

  const nameOf = async (point) => {
    const id = map.ids[point];
    if (!names.has(id)) names.set(id, api.texture(id, signal).catch(() => ({ id, name: `texture ${id}`, tags: {}, voxels: false })));
    return names.get(id);
  };
  const listVisible = debounce(220, async () => {
    const { total, points } = scatter.visible(400);
    const chosen = points.filter((point) => !scatter.dim?.[point]).slice(0, MAX_LISTED);
    const entries = await Promise.all(chosen.map(nameOf));
    if (signal.aborted) return;
    listed.textContent = `${counted(total, "texture")}${total > chosen.length ? `, the ${chosen.length} nearest to the centre` : ""}`;
    list.replaceChildren(...entries.map((entry) => el("li", {}, el("a", { href: href("texture", entry.id), title: entry.name }, el("span", { class: "box" }, thumbnail(entry, 96)), shortenedName(entry.name)))));
  });
  const write = debounce(250, () => {
    const { x, y, zoom } = scatter.view;
    replaceParams({ view: zoom === 1 ? null : [x, y].map((n) => n.toFixed(4)).concat(zoom.toFixed(2)).join(",") });
  });
  const moved = () => { draw(); write(); listVisible(); };

  async function select(point) {
    scatter.selected = point;
    draw();
    replaceParams({ sel: point < 0 ? null : map.ids[point] });
    card.hidden = point < 0;
    if (point < 0) return;
    const entry = await nameOf(point);
    card.replaceChildren(el("span", { class: "box" }, thumbnail(entry, 192)), el("div", {}, el("p", { class: "edge" }, `texture ${entry.id}`), el("h2", {}, entry.name), tagLine(entry.tags, 4),
      el("p", { class: "actions" }, el("a", { class: "button main", href: href("query", null, { ids: entry.id, space: params.get("space") }) }, "Find similar"), el("a", { class: "button", href: href("texture", entry.id) }, "Open"))),
    el("button", { type: "button", class: "quiet icon", "aria-label": "Close", on: { click: () => { select(-1); canvas.focus(); } } }, "×"));
  }
  addControls(canvas, scatter, { moved, select, hover: showTip(tip, scatter, nameOf), signal });
  const fit = new ResizeObserver(() => draw());
  fit.observe(canvas);
  addEventListener("theme", paint, { signal });

  const view = (params.get("view") ?? "").split(",").map(Number);
  scatter.fit();
  if (view.length === 3 && view.every(Number.isFinite) && view[2] > 0) scatter.view = { x: view[0], y: view[1], zoom: view[2] };
  const chosen = map.ids.indexOf(Number(params.get("sel")));
  paint();
  listVisible();
  if (chosen >= 0) {
    if (!params.get("view")) Object.assign(scatter.view, { x: scatter.points.x[chosen], y: scatter.points.y[chosen], zoom: 3 });
    select(chosen).catch(reportError);
  }
  return { escape() { if (scatter.selected >= 0) select(-1); }, leave() { fit.disconnect(); draw.cancel(); listVisible.cancel(); write.cancel(); } };
}

/** Shows the name and picture of the point under the pointer. */
function showTip(tip, scatter, nameOf) {
  let last = -1;
  return async (point, px, py) => {
    if (point < 0) { last = -1; tip.hidden = true; return; }
    tip.style.left = `${Math.min(px + 14, scatter.canvas.clientWidth - 170)}px`;
    tip.style.top = `${Math.min(py + 14, scatter.canvas.clientHeight - 90)}px`;
    if (point === last) { tip.hidden = false; return; }
    last = point;
    const entry = await nameOf(point);
    if (last !== point) return;
    tip.replaceChildren(el("span", { class: "box" }, thumbnail(entry, 96)), el("span", {}, el("b", {}, entry.name), tagLine(entry.tags, 2)));
    tip.hidden = false;
  };
}

/** Dragging, pinching, the wheel and keys move the map; a click selects a point. */
function addControls(canvas, scatter, { moved, select, hover, signal }) {
  const on = (name, listener, options = {}) => canvas.addEventListener(name, listener, { signal, ...options });
  const held = new Map();
  let far = 0;
  on("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); held.set(event.pointerId, [event.offsetX, event.offsetY]); far = 0; });
  on("pointermove", (event) => {
    const before = held.get(event.pointerId), now = [event.offsetX, event.offsetY];
    if (!before) { hover(scatter.pick(...now), ...now); return; }
    far += Math.hypot(now[0] - before[0], now[1] - before[1]);
    if (held.size === 1) scatter.pan(now[0] - before[0], now[1] - before[1]);
    else {
      const other = [...held].find(([id]) => id !== event.pointerId)[1], span = (a) => Math.hypot(a[0] - other[0], a[1] - other[1]);
      if (span(before) > 0) scatter.zoom(span(now) / span(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
    }
    held.set(event.pointerId, now);
    moved();
  });
  on("pointerup", (event) => { if (held.size === 1 && far < 5) select(scatter.pick(event.offsetX, event.offsetY)); held.delete(event.pointerId); });
  on("pointercancel", (event) => held.delete(event.pointerId));
  on("pointerleave", () => hover(-1));
  on("wheel", (event) => { event.preventDefault(); scatter.zoom(Math.exp(-event.deltaY / 400), event.offsetX, event.offsetY); moved(); }, { passive: false });
  on("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const by = event.shiftKey ? 160 : 48;
    // A point that is selected with the keyboard is moved to the centre, so that it is visible.
    const choose = (point) => { if (point >= 0) Object.assign(scatter.view, { x: scatter.points.x[point], y: scatter.points.y[point] }); select(point); };
    const moves = { ArrowLeft: () => scatter.pan(by, 0), ArrowRight: () => scatter.pan(-by, 0), ArrowUp: () => scatter.pan(0, by), ArrowDown: () => scatter.pan(0, -by),
      "+": () => scatter.zoom(1.4), "=": () => scatter.zoom(1.4), "-": () => scatter.zoom(1 / 1.4), 0: () => scatter.measure(), Enter: () => choose(scatter.nearestToCentre()) };
    if (!moves[event.key]) return;
    event.preventDefault();
    moves[event.key]();
    moved();
  });
}
