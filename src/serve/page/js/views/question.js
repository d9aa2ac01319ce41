// What is asked, as an address says it, as the API wants it, and as the left side of the query view shows it.
import { el, freshId, settled } from "../dom.js";
import { shape } from "../format.js";
import { href } from "../route.js";
import { sheet } from "../parts/picture.js";
import { tagLine } from "../parts/tags.js";
import * as api from "../api.js";

export const HOME_K = 30;
export const MOST_K = 1000;

/** What an address asks; null when it asks nothing. */
export function readQuestion(params) {
  const ids = (params.get("ids") ?? "").split(",").map(Number).filter((id) => Number.isInteger(id) && id > 0);
  const block = (params.get("block") ?? "").split(",").map(Number);
  const question = {
    ids, upload: params.get("upload"),
    block: block.length === 7 && block.every(Number.isInteger) ? { id: block[0], origin: block.slice(1, 4), size: block.slice(4) } : null,
    combine: params.get("combine") === "min" ? "min" : "mean",
    k: Math.max(1, Math.min(MOST_K, Math.round(Number(params.get("k"))) || HOME_K)),
    within: Number(params.get("within")) > 0 ? Number(params.get("within")) : null,
    where: params.getAll("where"), space: params.get("space"),
  };
  return ids.length > 0 || question.upload || question.block ? question : null;
}

/** The body of the request. */
export function body(question) {
  const { ids, upload, block, combine, k, within, where, space } = question;
  const what = upload ? { upload } : block ? { block } : { ids, ...(ids.length > 1 ? { combine } : {}) };
  return { ...what, k, ...(within ? { within } : {}), where, ...(space ? { space } : {}), exclude_self: true };
}

/** As parameters of an address. */
export const write = (q) => ({ ids: q.ids.join(","), upload: q.upload, block: q.block && [q.block.id, ...q.block.origin, ...q.block.size].join(","),
  combine: q.combine === "min" && q.ids.length > 1 ? "min" : null, k: q.k === HOME_K ? null : q.k, within: q.within, where: q.where, space: q.space });

/** Shows what is asked by: pictures and names. */
export async function showAsked(box, question, upload, signal) {
  if (question.upload) {
    const name = upload?.name ?? "a file";
    box.replaceChildren(el("div", { class: "asked-one" }, sheet({ token: question.upload, shape: upload?.shape, voxels: Boolean(upload?.shape) }, { eager: true }),
      el("p", { class: "asked-name" }, name), el("p", { class: "edge" }, shape(upload?.shape))));
    return;
  }
  if (question.block) {
    const entry = await api.texture(question.block.id, signal), { origin, size } = question.block;
    box.replaceChildren(el("div", { class: "asked-one" }, el("a", { href: href("texture", entry.id) }, sheet(entry, { eager: true })),
      el("p", { class: "asked-name" }, "a block of ", el("a", { href: href("texture", entry.id) }, entry.name)),
      el("p", { class: "edge" }, `${size.join(" × ")} from ${origin.join(", ")} (z, y, x)`)));
    return;
  }
  const entries = await Promise.all(question.ids.slice(0, 12).map((id) => api.texture(id, signal)));
  const one = entries.length === 1;
  box.classList.toggle("several", !one);
  box.replaceChildren(...entries.map((entry) => el("div", { class: "asked-one" },
    el("a", { href: href("texture", entry.id), "aria-label": `Open ${entry.name}` }, sheet(entry, { eager: true })),
    el("p", { class: "asked-name" }, el("a", { href: href("texture", entry.id) }, entry.name)),
    one ? el("p", { class: "edge" }, `${shape(entry.shape)} · texture ${entry.id}`) : el("a", { class: "edge", href: href("query", null, { ...write(question), ids: question.ids.filter((id) => id !== entry.id).join(",") }), "aria-label": `leave out ${entry.name}` }, "leave out"),
    one && tagLine(entry.tags, 6))),
  question.ids.length > 12 ? el("p", { class: "soft" }, `and ${question.ids.length - 12} others`) : "");
}

/** The choices of k, space, reach, filters, and of how several examples are joined. `changed(changes)`. */
export function choices(question, spaces, changed) {
  const ids = ["k", "space", "within", "where"].map(freshId);
  const slow = settled(160, changed);
  const k = el("input", { id: ids[0], type: "number", min: 1, max: MOST_K, value: question.k, inputmode: "numeric" });
  const slide = el("input", { type: "range", min: 1, max: 100, value: Math.min(100, question.k), "aria-label": "How many hits, by a slider" });
  const setK = (value, other) => { const n = Math.round(Number(value)); if (n >= 1) { other.value = n; slow({ k: Math.min(MOST_K, n) }); } };
  k.addEventListener("input", () => setK(k.value, slide));
  slide.addEventListener("input", () => setK(slide.value, k));
  const about = el("p", { class: "soft formula" });
  const space = el("select", { id: ids[1] }, ...(spaces?.spaces ?? []).map((one) => el("option", { value: one.name, selected: one.name === (question.space ?? spaces.default) }, one.name)));
  const tell = () => { const one = spaces?.spaces.find((one) => one.name === space.value); about.textContent = one?.about ?? one?.formula ?? ""; about.title = one?.formula ?? ""; };
  space.addEventListener("change", () => { tell(); changed({ space: space.value === spaces.default ? null : space.value }); });
  tell();
  const within = el("input", { id: ids[2], type: "number", min: 0, step: "any", value: question.within ?? "", placeholder: "any distance" });
  within.addEventListener("change", () => changed({ within: Number(within.value) > 0 ? Number(within.value) : null }));
  const where = el("input", { id: ids[3], type: "text", placeholder: "rock=ketton", autocomplete: "off", value: question.where.join(", "), spellcheck: "false" });
  where.addEventListener("change", () => changed({ where: where.value.split(",").map((part) => part.trim()).filter((part) => part.indexOf("=") > 0) }));
  const combine = question.ids.length > 1 ? el("div", { class: "row" }, el("label", { for: `${ids[0]}-combine` }, "join"), el("select", { id: `${ids[0]}-combine`, on: { change: (event) => changed({ combine: event.target.value }) } },
    el("option", { value: "mean", selected: question.combine === "mean" }, "like their mean"), el("option", { value: "min", selected: question.combine === "min" }, "like any of them"))) : null;
  return el("div", { class: "choices" }, combine,
    el("div", { class: "row" }, el("label", { for: ids[0] }, "hits"), k, slide),
    el("div", { class: "row" }, el("label", { for: ids[1] }, "space"), space), about,
    el("details", { open: Boolean(question.within || question.where.length) }, el("summary", {}, "Narrow it"),
      el("div", { class: "row" }, el("label", { for: ids[2] }, "within"), within),
      el("div", { class: "row" }, el("label", { for: ids[3] }, "only"), where)));
}
