// One texture: its volume, slices, 251 moments, tags and origin.
import * as api from "../api.js";
import { el, debounce } from "../dom.js";
import { bytes, count, percent, shape, short } from "../format.js";
import { go, href, replaceParams } from "../route.js";
import { reportError, emptyState, errorText, toast } from "../messages.js";
import { ContactSheet } from "../parts/contact.js";
import { plot251 } from "../parts/plot.js";
import { Scrubber } from "../parts/scrubber.js";
import { tagEditor } from "../parts/tags.js";
import { Camera } from "../volume/camera.js";
import { FORMS } from "../volume/marcher.js";
import { readTransfer, writeTransfer } from "../volume/transfer.js";
import { Viewer, choice, defaultTransfer } from "../volume/viewer.js";
import { readVoxels } from "../volume/voxels.js";

export const title = (route) => `Texture ${route.arg}`;

// The longest side of the volume that is loaded: enough for the picture, small enough for slow connections.
export const EDGE = 128;
const AXES = ["z", "y", "x"];

/** The form, cuts and colours of an address. */
export function viewerState(params, home, forms = "cloud") {
  const numbers = (params.get("cut") ?? "").split(",").map((text) => Number(text) / 100);
  const cuts = numbers.length === 6 && numbers.every((x) => x >= 0 && x <= 1);
  return {
    form: FORMS.includes(params.get("form")) ? params.get("form") : forms,
    transfer: readTransfer(params.get("tf"), home),
    cut: { low: cuts ? [0, 2, 4].map((at) => numbers[at]) : [0, 0, 0], high: cuts ? [1, 3, 5].map((at) => numbers[at]) : [1, 1, 1] },
  };
}

/** The same as parameters of an address. */
export function viewerParams(state, home) {
  const cut = AXES.flatMap((_, at) => [state.cut.low[at], state.cut.high[at]]).map((x) => Math.round(x * 100));
  return { form: state.form === "cloud" ? null : state.form, tf: writeTransfer(state.transfer, home), cut: cut.join(",") === "0,100,0,100,0,100" ? null : cut.join(",") };
}

export async function show(root, route, life) {
  const id = Number(route.arg);
  if (!Number.isInteger(id) || id < 1) throw new api.Problem(404, `“${route.arg}” is not the number of a texture.`);
  const [texture] = await Promise.all([api.texture(id, life.signal), life.server.ready]);
  document.title = `${texture.name} – hlacdb`;
  const parts = [];
  const seen = el("div", { class: "texture-seen" });
  root.append(el("article", { class: "texture" }, head(texture, life), seen, momentsPlot(texture, life), records(texture, life)));
  if (texture.voxels) showVoxels(seen, texture, route.params, life, parts).catch((error) => { if (error.name !== "AbortError") seen.replaceChildren(emptyState("The voxels could not be read", errorText(error))); });
  else seen.append(el("p", { class: "note" }, "Only the moments of this texture are stored, so its voxels cannot be shown. It can be found, compared and plotted like any other. Textures are stored with their voxels by default."));
  return { leave: () => parts.forEach((part) => part.leave()) };
}

function head(texture, { server }) {
  return el("header", { class: "texture-head" },
    el("div", {}, el("p", { class: "edge" }, `texture ${texture.id}`), el("h1", { "data-start": "", tabindex: "-1" }, texture.name),
      el("p", { class: "edge" }, texture.shape ? `${shape(texture.shape)} voxels${texture.channels === 3 ? ", colour" : ""}` : "moments only")),
    el("div", { class: "actions" },
      el("a", { class: "button main", href: href("query", null, { ids: texture.id }) }, "Find similar"),
      el("a", { class: "button", href: href("map", null, { sel: texture.id }) }, "Show on the map"),
      !server.readOnly && el("button", { type: "button", class: "quiet", on: { click: () => confirmRemoval(texture) } }, "Remove…")));
}

/** Asks before a texture is removed. */
function confirmRemoval(texture) {
  const dialog = el("dialog", { class: "dialog", "aria-labelledby": "removal" },
    el("h2", { id: "removal" }, `Remove “${texture.name}” from the store?`), el("p", {}, "Its voxels, moments and tags are removed too. This cannot be undone."),
    el("p", { class: "buttons" }, el("button", { type: "button", on: { click: () => dialog.close() } }, "Cancel"),
      el("button", { type: "button", class: "main", on: { click: async () => {
        try {
          await api.remove(texture.id);
          dialog.close();
          toast(`${texture.name} was removed.`);
          go(href("browse"));
        } catch (error) { dialog.close(); reportError(error); }
      } } }, "Remove")));
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

/** The volume, its slices and the contact sheet, which show one position. It is part of the address. */
async function showVoxels(box, texture, params, { signal }, parts) {
  const axis = AXES.includes(params.get("axis")) ? params.get("axis") : "z";
  const given = (params.get("at") ?? "").split(",").map(Number);
  const at = given.length === 3 && given.every(Number.isInteger) ? { z: given[0], y: given[1], x: given[2] } : null;
  const contact = new ContactSheet({ what: texture, axis, picked: (index) => scrubber?.set({ [contact.axis]: index }) });
  let scrubber = null;
  const stage = el("section", { class: "texture-volume", "aria-label": "Volume" }, el("div", { class: "viewer" }, el("div", { class: "stage loading" }, el("p", { class: "stage-note" }, "Reading voxels…"))));
  const axes = choice("Axis of the slices", AXES.map((axis) => [axis, `across ${axis}`]), axis, (axis) => {
    contact.show(axis);
    if (scrubber) contact.point(scrubber.at[axis]);
    replaceParams({ axis: axis === "z" ? null : axis });
  });
  const slices = el("section", { class: "texture-slices", "aria-labelledby": "slices-title" }, el("div", { class: "section-head" }, el("h2", { id: "slices-title" }, "All slices"), axes), contact.element);
  const through = el("section", { class: "texture-scrub", "aria-labelledby": "scrub-title" }, el("h2", { id: "scrub-title" }, "One slice across each axis"));
  box.append(stage, slices, through);

  const volume = await readVoxels(texture, EDGE, signal);
  const home = defaultTransfer(volume), camera = new Camera(params.get("cam"));
  const write = debounce(250, (viewer) => replaceParams({ ...viewerParams(viewer.state, home), cam: camera.write() }));
  const viewer = new Viewer({ volume, camera, label: texture.name, signal, state: viewerState(params, home), changed: () => { write(viewer); block(); } });
  camera.addEventListener("turn", () => write(viewer), { signal });
  const part = el("p", { class: "block-query" });
  stage.replaceChildren(viewer.element);
  stage.querySelector(".viewer-controls")?.append(part);
  function block() {
    const { low, high } = viewer.state.cut;
    const origin = low.map((share, i) => Math.round(share * texture.shape[i])), size = high.map((share, i) => Math.round(share * texture.shape[i]) - origin[i]);
    const whole = size.every((side, i) => side === texture.shape[i]), fits = size.every((side) => side >= 16);
    part.replaceChildren(whole ? "" : fits
      ? el("a", { class: "button", href: href("query", null, { block: [texture.id, ...origin, ...size].join(",") }) }, `Find textures similar to this block of ${size.join(" × ")}`)
      : el("span", { class: "soft" }, "A block to search by needs at least 16 voxels a side."));
  }
  block();
  const writePosition = debounce(200, (at) => replaceParams({ at: `${at.z},${at.y},${at.x}` }));
  scrubber = new Scrubber({ what: texture, volume, at, changed: (at) => { contact.point(at[contact.axis]); writePosition(at); } });
  contact.point(scrubber.at[contact.axis]);
  through.append(scrubber.element);
  parts.push(viewer, scrubber, { leave: () => { write.cancel(); writePosition.cancel(); } });
}

/** The 251 moments, or their deviations from the means of the store. */
function momentsPlot(texture, { signal }) {
  const box = el("div", { class: "plot-box" }, el("p", { class: "soft" }, "Reading the moments…"));
  const view = el("select", { "aria-label": "View of the volume" });
  const section = el("section", { class: "texture-plot", "aria-labelledby": "plot-title" });
  let mode = "store";
  const modes = choice("What is plotted", [["store", "deviation from the store"], ["raw", "raw"]], mode, (next) => { mode = next; draw(); });
  section.append(el("div", { class: "section-head" }, el("h2", { id: "plot-title" }, "The 251 moments"), modes, view), box);
  let moments = null, statistics = null;
  function draw() {
    if (!moments) return;
    const comparable = view.value === "full@1" && statistics?.count > 1;
    for (const input of modes.querySelectorAll("input")) input.disabled = !comparable;
    const label = `Moments of ${texture.name}`;
    if (mode === "store" && comparable) {
      const away = moments.map((m, at) => (statistics.std[at] > 0 ? (m - statistics.mean[at]) / statistics.std[at] : 0));
      box.replaceChildren(plot251({ label, stems: away, describe: (at) => `${short(moments[at])}, ${short(Math.abs(away[at]))} deviations ${away[at] < 0 ? "below" : "above"} the store's mean of ${short(statistics.mean[at])}` }));
    } else box.replaceChildren(plot251({ label, stems: moments, describe: (at) => short(moments[at]) }));
  }
  async function load(name) {
    try {
      const descriptor = await api.descriptor(texture.id, name, signal);
      moments = descriptor.moments;
      if (view.options.length === 0) view.append(...descriptor.views.map((one) => el("option", { value: one, selected: one === descriptor.view }, one)));
      draw();
    } catch (error) { if (error.name !== "AbortError") box.replaceChildren(el("p", { class: "soft" }, errorText(error))); }
  }
  view.addEventListener("change", () => load(view.value));
  load("full@1");
  api.statistics(signal).then((report) => { statistics = report.statistics; draw(); }).catch(() => { /* the plot shows raw moments only */ });
  return section;
}

function records(texture, { server }) {
  const source = texture.source ?? {}, rows = [];
  const row = (name, value) => { if (value !== null && value !== undefined && value !== "") rows.push(el("div", { class: "pair" }, el("dt", {}, name), el("dd", {}, value))); };
  const words = (value) => (typeof value === "object" ? Object.entries(value).map(([key, one]) => `${key} ${Array.isArray(one) ? one.join(" × ") : one}`).join(", ") : String(value));
  row("kind", source.kind);
  row("file", texture.file ?? texture.path_shown ?? texture.path);
  row("samples", source.samples);
  row("levels", source.mapping && words(source.mapping));
  row("spacing", source.spacing && (Array.isArray(source.spacing) ? source.spacing.map(short).join(" × ") : words(source.spacing)));
  row("block", texture.block && (texture.block.origin ? `from ${texture.block.origin.join(", ")} of ${shape(texture.block.shape)} (z, y, x)` : words(texture.block)));
  row("windows", texture.windows && count(texture.windows));
  row("stored as", texture.stored_bytes && texture.shape && `${bytes(texture.stored_bytes)}, ${percent(texture.stored_bytes / (texture.shape.reduce((a, b) => a * b) * (texture.channels ?? 1)))} of its voxels`);
  const hash = texture.hash ?? texture.content;
  row("content", hash && el("code", { class: "hash", title: hash }, hash));
  if (rows.length === 0) row("kind", "imported moments");
  return el("section", { class: "texture-records" },
    el("section", { "aria-labelledby": "tags-title" }, el("h2", { id: "tags-title" }, "Tags"), tagEditor(texture, server.readOnly)),
    el("section", { "aria-labelledby": "source-title" }, el("h2", { id: "source-title" }, "Origin"), el("dl", { class: "source" }, rows)));
}
