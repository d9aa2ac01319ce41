// What the store knows of itself: normalisation statistics, axes, drift, sizes; and a fit of the spaces.
import * as api from "../api.js";
import { el, freshId } from "../dom.js";
import { bytes, count, counted, percent, short } from "../format.js";
import { failed, instead, toast } from "../tell.js";
import { parseTags } from "../files.js";
import { bars, plot251 } from "../parts/plot.js";
import { jobPanel } from "../parts/job.js";

export const title = () => "Statistics";

export async function show(root, route, life) {
  const { signal, server } = life;
  const body = el("div", { class: "statistics-body" }), jobs = jobPanel(signal, () => { api.forgetSpaces(); life.renew(); load().catch(failed); });
  const version = el("p", { class: "edge" });
  root.append(el("div", { class: "statistics" }, el("div", { class: "section-head" }, el("h1", { "data-start": "", tabindex: "-1" }, "Statistics"), version), body));
  async function load() {
    const [told] = await Promise.all([api.statistics(signal), server.ready]);
    version.textContent = `hlacdb ${server.version}`;
    body.replaceChildren(...parts(told, jobs, server));
  }
  await load();
  jobs.resume();
  return { leave: () => jobs.leave() };
}

function parts(told, jobs, server) {
  const { space, statistics } = told;
  const section = (name, ...rest) => { const id = freshId("part"); return el("section", { "aria-labelledby": id }, el("h2", { id }, name), ...rest); };
  const fact = (name, value, title) => el("div", { class: "fact", title }, el("dt", {}, name), el("dd", {}, value));
  const grown = space ? told.textures - space.fitted_on : 0;
  return [
    el("dl", { class: "facts" }, fact("textures", count(told.textures)), fact("descriptors", count(told.descriptors), "one for each view of each texture"), fact("on disk", bytes(told.bytes.file ?? 0)),
      told.bytes.file && told.textures > 0 && fact("a texture", bytes(told.bytes.file / told.textures)), fact("revision", count(told.revision ?? 0))),
    section("Space", space ? [
      el("p", {}, el("b", {}, space.name), `, epoch ${space.epoch}: ${space.dims} coordinates, fitted on ${counted(space.fitted_on, "texture")}.`,
        grown > 0 && ` ${counted(grown, "texture has", "textures have")} come since.`),
      space.drift && el("p", {}, driftWords(space.drift), el("span", { class: "edge" }, ` shift ${short(space.drift.shift)}, spread ${short(space.drift.spread)}`)),
      el("details", {}, el("summary", {}, "The formula"), el("p", { class: "formula-text" }, space.formula)),
    ] : el("p", { class: "soft" }, "No space is fitted yet: that takes textures."),
    server.readOnly ? el("p", { class: "soft" }, "This server is read only: spaces are fitted by hlacdb reindex.")
      : el("div", { class: "jobs" }, el("p", { class: "buttons" }, el("button", { type: "button", class: "main", id: "reindex", on: { click: () => jobs.start("reindex", {}) } }, "Fit the spaces anew"), el("span", { class: "soft" }, "on all textures of now; queries go on meanwhile")),
        server.ingestFolder && ingestForm(jobs), jobs.element)),
    space?.axes?.length > 0 && section("Variance of the axes", axesChart(space.axes)),
    statistics.count > 0 ? section("Normalisation statistics of the 251 moments",
      el("p", { class: "legend-line" }, el("span", { class: "key line" }), "mean ", el("span", { class: "key band" }), "one deviation ", el("span", { class: "key outer" }), "least to greatest"),
      plot251({ label: "Mean and deviation of the moments", line: statistics.mean,
        band: { low: statistics.mean.map((m, at) => m - statistics.std[at]), high: statistics.mean.map((m, at) => m + statistics.std[at]) },
        outer: statistics.min && { low: statistics.min, high: statistics.max },
        told: (at) => `mean ${short(statistics.mean[at])}, deviation ${short(statistics.std[at])}` }),
      statistics.leading_share !== undefined && el("p", { class: "soft" }, `One direction holds ${percent(statistics.leading_share)} of the variance of raw moments: mostly brightness. That is why the spaces do not use them raw.`))
      : instead("Nothing to count yet", "Statistics come with the first textures."),
    section("Sizes", bars(Object.entries(told.bytes).filter(([name, n]) => name !== "file" && n > 0).sort((a, b) => b[1] - a[1]).map(([name, n]) => ({ name, value: n, told: bytes(n) })), { label: "Bytes by table" })),
    section("Settings", el("dl", { class: "source" }, ...Object.entries(told.settings).map(([key, value]) => el("div", { class: "pair" }, el("dt", {}, key), el("dd", {}, Array.isArray(value) ? value.join(", ") : String(value)))))),
  ].filter(Boolean);
}

/** Drift in words: how far the store of now lies from what the space was fitted on. */
function driftWords({ shift, spread }) {
  const off = Math.max(Math.abs(shift), Math.abs(Math.log(spread || 1)));
  return off < 0.25 ? "The store is still what the space was fitted on." : off < 0.7 ? "The store has drifted a little from what the space was fitted on." : "The store has drifted far from what the space was fitted on: fit it anew.";
}

/** Each axis with its variance and what it mostly looks at. */
function axesChart(axes) {
  return bars(axes.map((axis, at) => {
    const [view, share] = Object.entries(axis.views ?? {}).sort((a, b) => b[1] - a[1])[0] ?? [];
    const [feature] = axis.features?.[0] ?? [];
    return { name: `axis ${at + 1}`, value: axis.variance, told: el("span", {}, short(axis.variance), view && el("span", { class: "axis-of" }, `${view} ${percent(share)}`)), title: feature && `mostly ${feature}` };
  }), { label: "Variance of the axes" });
}

function ingestForm(jobs) {
  const ids = [freshId("path"), freshId("tags")];
  const path = el("input", { id: ids[0], type: "text", placeholder: "the whole folder", autocomplete: "off", spellcheck: "false" }), tags = el("input", { id: ids[1], type: "text", placeholder: "rock=ketton", autocomplete: "off" });
  return el("form", { class: "ingest", on: { submit: (event) => {
    event.preventDefault();
    try { jobs.start("ingest", { path: path.value.trim() || ".", tags: parseTags(tags.value) }); } catch (error) { toast(error.message, { bad: true }); }
  } } }, el("label", { for: ids[0] }, "Folder below the server’s"), path, el("label", { for: ids[1] }, "tags"), tags, el("button", { type: "submit" }, "Add its volumes"));
}
