// Statistics of the store: normalisation, axes, drift, sizes. Starts reindexing and ingesting.
import * as api from "../api.js";
import { el, uniqueId } from "../dom.js";
import { bytes, count, counted, percent, short } from "../format.js";
import { reportError, emptyState, toast } from "../messages.js";
import { parseTags } from "../files.js";
import { bars, plot251 } from "../parts/plot.js";
import { jobPanel } from "../parts/job.js";

export const title = () => "Statistics";

export async function show(root, route, life) {
  const { signal, server } = life;
  const body = el("div", { class: "statistics-body" }), jobs = jobPanel(signal, () => { api.clearSpaces(); life.readHealth(); load().catch(reportError); });
  const version = el("p", { class: "edge" });
  root.append(el("div", { class: "statistics" }, el("div", { class: "section-head" }, el("h1", { "data-start": "", tabindex: "-1" }, "Statistics"), version), body));
  async function load() {
    const [report] = await Promise.all([api.statistics(signal), server.ready]);
    version.textContent = `hlacdb ${server.version}`;
    body.replaceChildren(...sections(report, jobs, server));
  }
  await load();
  jobs.resume();
  return { leave: () => jobs.leave() };
}

function sections(report, jobs, server) {
  const { space, statistics } = report;
  const section = (name, ...rest) => { const id = uniqueId("part"); return el("section", { "aria-labelledby": id }, el("h2", { id }, name), ...rest); };
  const fact = (name, value, title) => el("div", { class: "fact", title }, el("dt", {}, name), el("dd", {}, value));
  const grown = space ? report.textures - space.fitted_on : 0;
  return [
    el("dl", { class: "facts" }, fact("textures", count(report.textures)), fact("descriptors", count(report.descriptors), "one for each view of each texture"), fact("on disk", bytes(report.bytes.file ?? 0)),
      report.bytes.file && report.textures > 0 && fact("a texture", bytes(report.bytes.file / report.textures)), fact("revision", count(report.revision ?? 0))),
    section("Space", space ? [
      el("p", {}, el("b", {}, space.name), `, epoch ${space.epoch}: ${space.dims} coordinates, fitted on ${counted(space.fitted_on, "texture")}.`,
        grown > 0 && ` ${counted(grown, "texture has", "textures have")} been added since.`),
      space.drift && el("p", {}, driftText(space.drift), el("span", { class: "edge" }, ` shift ${short(space.drift.shift)}, spread ${short(space.drift.spread)}`)),
      el("details", {}, el("summary", {}, "The formula"), el("p", { class: "formula-text" }, space.formula)),
    ] : el("p", { class: "soft" }, "No space is fitted yet: add textures first."),
    server.readOnly ? el("p", { class: "soft" }, "This server is read-only. Fit the spaces with hlacdb reindex.")
      : el("div", { class: "jobs" }, el("p", { class: "buttons" }, el("button", { type: "button", class: "main", id: "reindex", on: { click: () => jobs.start("reindex", {}) } }, "Fit the spaces again"), el("span", { class: "soft" }, "on all textures; queries are answered meanwhile")),
        server.ingestFolder && ingestForm(jobs), jobs.element)),
    space?.axes?.length > 0 && section("Variance of the axes", axesChart(space.axes)),
    statistics.count > 0 ? section("Normalisation statistics of the 251 moments",
      el("p", { class: "legend-line" }, el("span", { class: "key line" }), "mean ", el("span", { class: "key band" }), "one deviation ", el("span", { class: "key outer" }), "minimum to maximum"),
      plot251({ label: "Mean and deviation of the moments", line: statistics.mean,
        band: { low: statistics.mean.map((m, at) => m - statistics.std[at]), high: statistics.mean.map((m, at) => m + statistics.std[at]) },
        outer: statistics.min && { low: statistics.min, high: statistics.max },
        describe: (at) => `mean ${short(statistics.mean[at])}, deviation ${short(statistics.std[at])}` }),
      statistics.leading_share !== undefined && el("p", { class: "soft" }, `One direction holds ${percent(statistics.leading_share)} of the variance of the raw moments, mostly brightness. This is why the spaces do not use raw moments.`))
      : emptyState("No statistics yet", "Add textures to see statistics."),
    section("Sizes", bars(Object.entries(report.bytes).filter(([name, n]) => name !== "file" && n > 0).sort((a, b) => b[1] - a[1]).map(([name, n]) => ({ name, value: n, text: bytes(n) })), { label: "Bytes by table" })),
    section("Settings", el("dl", { class: "source" }, ...Object.entries(report.settings).map(([key, value]) => el("div", { class: "pair" }, el("dt", {}, key), el("dd", {}, Array.isArray(value) ? value.join(", ") : String(value)))))),
  ].filter(Boolean);
}

/** A sentence on the drift: how far the store is from the textures that the space was fitted on. */
function driftText({ shift, spread }) {
  const off = Math.max(Math.abs(shift), Math.abs(Math.log(spread || 1)));
  return off < 0.25 ? "The store still resembles the textures that the space was fitted on." : off < 0.7 ? "The store differs a little from the textures that the space was fitted on." : "The store differs much from the textures that the space was fitted on: fit the spaces again.";
}

/** Each axis with its variance, its main view and its main feature. */
function axesChart(axes) {
  return bars(axes.map((axis, at) => {
    const [view, share] = Object.entries(axis.views ?? {}).sort((a, b) => b[1] - a[1])[0] ?? [];
    const [feature] = axis.features?.[0] ?? [];
    return { name: `axis ${at + 1}`, value: axis.variance, text: el("span", {}, short(axis.variance), view && el("span", { class: "axis-of" }, `${view} ${percent(share)}`)), title: feature && `mostly ${feature}` };
  }), { label: "Variance of the axes" });
}

function ingestForm(jobs) {
  const ids = [uniqueId("path"), uniqueId("tags")];
  const path = el("input", { id: ids[0], type: "text", placeholder: "the whole folder", autocomplete: "off", spellcheck: "false" }), tags = el("input", { id: ids[1], type: "text", placeholder: "rock=ketton", autocomplete: "off" });
  return el("form", { class: "ingest", on: { submit: (event) => {
    event.preventDefault();
    try { jobs.start("ingest", { path: path.value.trim() || ".", tags: parseTags(tags.value) }); } catch (error) { toast(error.message, { bad: true }); }
  } } }, el("label", { for: ids[0] }, "Folder on the server"), path, el("label", { for: ids[1] }, "tags"), tags, el("button", { type: "submit" }, "Add its volumes"));
}
