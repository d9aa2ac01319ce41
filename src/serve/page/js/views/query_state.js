// The state of a query: read from and written to an address, sent to the API, and shown on the left of the query view.
import { el, uniqueId, debounce } from "../dom.js";
import { shape } from "../format.js";
import { href } from "../route.js";
import { contactSheet } from "../parts/picture.js";
import { tagLine } from "../parts/tags.js";
import * as api from "../api.js";

const DEFAULT_K = 30;
const MAX_K = 1000;

/** The query of an address; null if it has no example. */
export function readQuery(params) {
  const ids = (params.get("ids") ?? "").split(",").map(Number).filter((id) => Number.isInteger(id) && id > 0);
  const block = (params.get("block") ?? "").split(",").map(Number);
  const query = {
    ids, upload: params.get("upload"),
    block: block.length === 7 && block.every(Number.isInteger) ? { id: block[0], origin: block.slice(1, 4), size: block.slice(4) } : null,
    combine: params.get("combine") === "min" ? "min" : "mean",
    k: Math.max(1, Math.min(MAX_K, Math.round(Number(params.get("k"))) || DEFAULT_K)),
    within: Number(params.get("within")) > 0 ? Number(params.get("within")) : null,
    where: params.getAll("where"), space: params.get("space"),
  };
  return ids.length > 0 || query.upload || query.block ? query : null;
}

/** The body of the request. */
export function requestBody(query) {
  const { ids, upload, block, combine, k, within, where, space } = query;
  const example = upload ? { upload } : block ? { block } : { ids, ...(ids.length > 1 ? { combine } : {}) };
  return { ...example, k, ...(within ? { within } : {}), where, ...(space ? { space } : {}), exclude_self: true };
}

/** The query as parameters of an address. */
export const writeQuery = (q) => ({ ids: q.ids.join(","), upload: q.upload, block: q.block && [q.block.id, ...q.block.origin, ...q.block.size].join(","),
  combine: q.combine === "min" && q.ids.length > 1 ? "min" : null, k: q.k === DEFAULT_K ? null : q.k, within: q.within, where: q.where, space: q.space });

/** Shows the examples: pictures and names. */
export async function showExamples(box, query, upload, signal) {
  if (query.upload) {
    const name = upload?.name ?? "a file";
    box.replaceChildren(el("div", { class: "example" }, contactSheet({ token: query.upload, shape: upload?.shape, voxels: Boolean(upload?.shape) }, { eager: true }),
      el("p", { class: "example-name" }, name), el("p", { class: "edge" }, shape(upload?.shape))));
    return;
  }
  if (query.block) {
    const entry = await api.texture(query.block.id, signal), { origin, size } = query.block;
    box.replaceChildren(el("div", { class: "example" }, el("a", { href: href("texture", entry.id) }, contactSheet(entry, { eager: true })),
      el("p", { class: "example-name" }, "a block of ", el("a", { href: href("texture", entry.id) }, entry.name)),
      el("p", { class: "edge" }, `${size.join(" × ")} from ${origin.join(", ")} (z, y, x)`)));
    return;
  }
  const entries = await Promise.all(query.ids.slice(0, 12).map((id) => api.texture(id, signal)));
  const one = entries.length === 1;
  box.classList.toggle("several", !one);
  box.replaceChildren(...entries.map((entry) => el("div", { class: "example" },
    el("a", { href: href("texture", entry.id), "aria-label": `Open ${entry.name}` }, contactSheet(entry, { eager: true })),
    el("p", { class: "example-name" }, el("a", { href: href("texture", entry.id) }, entry.name)),
    one ? el("p", { class: "edge" }, `${shape(entry.shape)} · texture ${entry.id}`) : el("a", { class: "edge", href: href("query", null, { ...writeQuery(query), ids: query.ids.filter((id) => id !== entry.id).join(",") }), "aria-label": `remove ${entry.name} from the examples` }, "remove"),
    one && tagLine(entry.tags, 6))),
  query.ids.length > 12 ? el("p", { class: "soft" }, `and ${query.ids.length - 12} others`) : "");
}

/** Controls for the number of hits, space, greatest distance, filters, and the combination of several examples. `changed(changes)`. */
export function controls(query, spaces, changed) {
  const ids = ["k", "space", "within", "where"].map(uniqueId);
  const changedSoon = debounce(160, changed);
  const k = el("input", { id: ids[0], type: "number", min: 1, max: MAX_K, value: query.k, inputmode: "numeric" });
  const slide = el("input", { type: "range", min: 1, max: 100, value: Math.min(100, query.k), "aria-label": "Number of hits, slider" });
  const setK = (value, other) => { const n = Math.round(Number(value)); if (n >= 1) { other.value = n; changedSoon({ k: Math.min(MAX_K, n) }); } };
  k.addEventListener("input", () => setK(k.value, slide));
  slide.addEventListener("input", () => setK(slide.value, k));
  const about = el("p", { class: "soft formula" });
  const space = el("select", { id: ids[1] }, ...(spaces?.spaces ?? []).map((one) => el("option", { value: one.name, selected: one.name === (query.space ?? spaces.default) }, one.name)));
  const showAbout = () => { const one = spaces?.spaces.find((one) => one.name === space.value); about.textContent = one?.about ?? one?.formula ?? ""; about.title = one?.formula ?? ""; };
  space.addEventListener("change", () => { showAbout(); changed({ space: space.value === spaces.default ? null : space.value }); });
  showAbout();
  const within = el("input", { id: ids[2], type: "number", min: 0, step: "any", value: query.within ?? "", placeholder: "any distance" });
  within.addEventListener("change", () => changed({ within: Number(within.value) > 0 ? Number(within.value) : null }));
  const where = el("input", { id: ids[3], type: "text", placeholder: "rock=ketton", autocomplete: "off", value: query.where.join(", "), spellcheck: "false" });
  where.addEventListener("change", () => changed({ where: where.value.split(",").map((part) => part.trim()).filter((part) => part.indexOf("=") > 0) }));
  const combine = query.ids.length > 1 ? el("div", { class: "row" }, el("label", { for: `${ids[0]}-combine` }, "combine"), el("select", { id: `${ids[0]}-combine`, on: { change: (event) => changed({ combine: event.target.value }) } },
    el("option", { value: "mean", selected: query.combine === "mean" }, "like all of them"), el("option", { value: "min", selected: query.combine === "min" }, "like any of them"))) : null;
  return el("div", { class: "choices" }, combine,
    el("div", { class: "row" }, el("label", { for: ids[0] }, "hits"), k, slide),
    el("div", { class: "row" }, el("label", { for: ids[1] }, "space"), space), about,
    el("details", { open: Boolean(query.within || query.where.length) }, el("summary", {}, "Conditions"),
      el("div", { class: "row" }, el("label", { for: ids[2] }, "within"), within),
      el("div", { class: "row" }, el("label", { for: ids[3] }, "only"), where)));
}
