// Two textures side by side: they turn and are sliced together. Below, their distance by view, cells and orbit.
import * as api from "../api.js";
import { el, debounce } from "../dom.js";
import { distance, percent, shape } from "../format.js";
import { glyph } from "../masks.js";
import { go, href, replaceParams } from "../route.js";
import { errorText } from "../messages.js";
import { contactSheet, noVoxels } from "../parts/picture.js";
import { bars } from "../parts/plot.js";
import { tagLine } from "../parts/tags.js";
import { Camera } from "../volume/camera.js";
import { FORMS } from "../volume/marcher.js";
import { Viewer, choice, defaultTransfer } from "../volume/viewer.js";
import { depthOf, readVoxels, slicePixels } from "../volume/voxels.js";
import { EDGE, viewerState } from "./texture.js";

export const title = () => "Compare";
const AXES = ["z", "y", "x"];

export async function show(root, route, { signal }) {
  const ids = ["a", "b"].map((key) => Number(route.params.get(key)));
  if (ids.some((id) => !Number.isInteger(id) || id < 1)) throw new api.Problem(404, "A comparison needs two textures: mark two and choose “Compare”.");
  const entries = await Promise.all(ids.map((id) => api.texture(id, signal)));
  document.title = `${entries[0].name} and ${entries[1].name} – hlacdb`;
  const camera = new Camera(route.params.get("cam")), viewers = [], sliceDrawers = [];
  const write = debounce(250, () => replaceParams({ cam: camera.write() }));
  camera.addEventListener("turn", write, { signal });
  const stages = entries.map(() => el("div", { class: "compare-stage" }));
  const columns = entries.map((entry, at) => el("section", { class: "compare-one", "aria-label": entry.name },
    el("header", {}, el("p", { class: "edge" }, `${at === 0 ? "A" : "B"} · texture ${entry.id} · ${shape(entry.shape)}`), el("h2", {}, el("a", { href: href("texture", entry.id) }, entry.name)), tagLine(entry.tags, 4)),
    stages[at]));
  const sheets = el("section", { "aria-label": "All slices of both" }, el("div", { class: "compare-two" }, entries.map((entry) => contactSheet(entry, { eager: true }))));
  const form = FORMS.includes(route.params.get("form")) ? route.params.get("form") : "cloud";
  const forms = choice("Form of both", FORMS.map((form) => [form, form[0].toUpperCase() + form.slice(1)]), form, (form) => {
    for (const viewer of viewers) { viewer.state.form = form; viewer.show(); }
    replaceParams({ form: form === "cloud" ? null : form });
  });
  let axis = AXES.includes(route.params.get("axis")) ? route.params.get("axis") : "z";
  const position = el("input", { type: "range", min: 0, max: 1000, value: Number(route.params.get("at")) || 500, "aria-label": "Position of the slice in both", on: { input: () => { slices(); remember(); } } });
  const remember = debounce(250, () => replaceParams({ at: position.value === "500" ? null : position.value, axis: axis === "z" ? null : axis }));
  const axes = choice("Axis of the slices of both", AXES.map((axis) => [axis, axis]), axis, (next) => { axis = next; slices(); remember(); });
  const slices = () => sliceDrawers.forEach((draw) => draw(axis, position.value / 1000));
  const difference = el("section", { class: "difference", "aria-labelledby": "difference-title" }, el("h2", { id: "difference-title" }, "How they differ"), el("p", { class: "soft" }, "…"));
  root.append(el("div", { class: "compare" },
    el("div", { class: "section-head" }, el("h1", { "data-start": "", tabindex: "-1" }, "Compare"), forms, el("div", { class: "row compare-slice" }, el("span", { class: "edge" }, "slice"), axes, position)),
    el("div", { class: "compare-two" }, columns), difference, sheets));
  explain(difference, ids, route.params.get("space"), signal);
  entries.forEach((entry, at) => load(entry, stages[at]).catch((error) => { if (error.name !== "AbortError") stages[at].replaceChildren(el("p", { class: "note" }, errorText(error))); }));

  async function load(entry, stage) {
    if (!entry.voxels) { stage.replaceChildren(el("div", { class: "stage" }, noVoxels())); return; }
    const volume = await readVoxels(entry, EDGE, signal);
    const viewer = new Viewer({ volume, camera, label: entry.name, signal, bare: true, state: { ...viewerState(route.params, defaultTransfer(volume)), form: form } });
    const canvas = el("canvas", { class: "compare-slice-picture", role: "img", "aria-label": `A slice of ${entry.name}` });
    stage.replaceChildren(viewer.element, canvas);
    viewers.push(viewer);
    const draw = (axis, share) => {
      const depth = depthOf(volume.shape, axis), image = slicePixels(volume, axis, Math.min(depth - 1, Math.floor(share * depth)));
      canvas.width = image.width;
      canvas.height = image.height;
      canvas.getContext("2d").putImageData(image, 0, 0);
    };
    sliceDrawers.push(draw);
    draw(axis, position.value / 1000);
  }
  return { leave() { write.cancel(); remember.cancel(); viewers.forEach((viewer) => viewer.leave()); } };
}

/** The shares of the distance: by view, by number of cells, by orbit. */
async function explain(box, [a, b], space, signal) {
  try {
    const [answer, spaces] = await Promise.all([api.explain(a, b, space, signal), api.spaces()]);
    const chosen = space ?? spaces.default;
    const select = el("select", { "aria-label": "Space", on: { change: () => go(href("compare", null, { a, b, space: select.value === spaces.default ? null : select.value })) } },
      ...spaces.spaces.map((one) => el("option", { value: one.name, selected: one.name === chosen }, one.name)));
    const explained = answer.explanation ?? answer;
    const row = (name, share, title) => ({ name, value: share, text: percent(share), title });
    const views = [...explained.views].map((one) => (Array.isArray(one) ? one : [one.view, one.share])).sort((x, y) => Math.abs(y[1]) - Math.abs(x[1]));
    const orbits = explained.orbits.slice(0, 12).map((one) => row(el("span", { class: "orbit" }, glyph(one.masks[0], 3), el("span", {}, `${one.view} ${one.aspect === "masks" ? "" : one.aspect}`)), one.share, `orbit of ${one.masks.slice(0, 12).join(" ")}${one.masks.length > 12 ? " …" : ""}`));
    box.replaceChildren(el("div", { class: "section-head" }, el("h2", { id: "difference-title" }, "How they differ"), el("p", { class: "distance" }, el("b", {}, distance(explained.distance)), " in ", select)),
      el("p", { class: "soft" }, "Shares of the distance. Positive shares increase it, negative shares reduce it."),
      el("div", { class: "difference-parts" },
        el("section", {}, el("h3", {}, "by view of the volume"), bars(views.map(([view, share]) => row(view, share)), { label: "Shares by view" })),
        el("section", {}, el("h3", {}, "by cells of the mask"), bars(explained.cells.map((share, at) => row(`${at + 1} ${at ? "cells" : "cell"}`, share)), { label: "Shares by number of cells" })),
        el("section", {}, el("h3", {}, "by orbit, the twelve largest"), bars(orbits, { label: "Shares by orbit" }))));
  } catch (error) {
    if (error.name !== "AbortError") box.replaceChildren(el("h2", { id: "difference-title" }, "How they differ"), el("p", { class: "soft" }, errorText(error)));
  }
}
