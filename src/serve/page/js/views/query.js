// A query and its answer: the query on the left, the ranked hits on the right.
import * as api from "../api.js";
import { el, shortenedName } from "../dom.js";
import { counted, distance, shape, time } from "../format.js";
import { addToStore, sessionFiles } from "../files.js";
import { go, href, replaceParams } from "../route.js";
import { reportError, emptyState, announce, errorText } from "../messages.js";
import { contactSheet, thumbnail } from "../parts/picture.js";
import { tagLine } from "../parts/tags.js";
import { Tray } from "../parts/tray.js";
import { controls, readQuery, requestBody, showExamples, writeQuery } from "./query_state.js";

export const title = (route) => (readQuery(route.params) ? "Similar textures" : "Query");

export async function show(root, route, life) {
  const query = readQuery(route.params);
  if (!query) { await showStart(root, life); return null; }
  const { signal } = life;
  const examples = el("div", { class: "examples" }, el("p", { class: "soft" }, "…"));
  const summary = el("p", { class: "summary edge" });
  const heading = el("h1", { class: "hits-title", "data-start": "", tabindex: "-1" }, "Similar textures");
  const hint = el("p", { class: "soft hint", hidden: true }, "Select several to search by all of them, or two to compare them.");
  const list = el("ol", { class: "hits" });
  const problem = el("div", {});
  const pick = (id) => tray.toggle(id);
  const tray = new Tray(route.params, (ids) => markCards(list, ids), () => query.space);
  const controlBox = el("div", {});
  const side = el("aside", { class: "query-side", "aria-label": "The query" }, examples, controlBox);
  root.append(el("div", { class: "query" }, side, el("section", { class: "query-hits", "aria-label": "Hits" }, el("div", { class: "section-head" }, heading, summary), hint, problem, list, tray.element)));

  // The request is sent first, because the page waits for its answer.
  let upload = sessionFiles.get(query.upload)?.upload ?? null, turn = 0;
  async function run(ready = null) {
    const mine = ++turn;
    list.setAttribute("aria-busy", "true");
    try {
      const answer = ready ?? await api.query(requestBody(query), signal);
      if (mine !== turn) return;
      upload = answer.upload ?? upload;
      problem.replaceChildren();
      showAnswer(answer);
      return answer;
    } catch (error) {
      if (mine !== turn || error.name === "AbortError") return;
      list.replaceChildren();
      heading.textContent = "No answer";
      summary.textContent = "";
      problem.replaceChildren(el("div", { role: "alert" }, query.upload && error.status === 404
        ? emptyState("The upload has expired", "The server keeps only the most recent uploads. Drop the file again, or add it to the store.")
        : emptyState("The query failed", errorText(error))));
    } finally {
      if (mine === turn) list.removeAttribute("aria-busy");
    }
  }
  function showAnswer(answer) {
    const n = answer.hits.length;
    heading.textContent = n === 0 ? "No similar textures" : counted(n, "similar texture");
    summary.textContent = `${answer.space}, epoch ${answer.epoch} · ${answer.index} · ${time(answer.elapsed_us)}`;
    summary.title = "space · index · time of the search on the server";
    hint.hidden = n < 2;
    drawHits(list, answer.hits, { query, tray, pick });
    if (n === 0) problem.replaceChildren(emptyState("No similar textures", query.within || query.where.length ? "No texture meets the conditions. Change them under “Conditions”." : "The store has no other texture to compare with."));
    announce(n === 0 ? "No similar textures." : `${counted(n, "similar texture")}. The nearest is ${answer.hits[0].name}, at distance ${distance(answer.hits[0].distance)}.`);
  }
  // The answer that came with the upload is used once, if it is the answer to this query.
  const ready = sessionFiles.get(query.upload)?.answer;
  const usable = ready && ready.hits.length === Math.min(query.k, ready.hits.length) && !query.within && (query.space ?? ready.space) === ready.space;
  if (ready) delete sessionFiles.get(query.upload).answer;
  const answered = run(usable ? ready : null);
  const change = (changes) => {
    Object.assign(query, changes);
    replaceParams(writeQuery(query));
    tray.draw();
    run();
  };
  Promise.all([api.spaces(), life.server.ready]).then(([spaces]) => controlBox.replaceChildren(controls(query, spaces, change), addButton(query, life))).catch(reportError);
  await answered;
  showExamples(examples, query, upload, signal).catch((error) => { if (error.name !== "AbortError") examples.replaceChildren(el("p", { class: "soft" }, errorText(error))); });
  return { escape() { if (tray.ids.size > 0) tray.clear(); } };
}

/** Offers to add the uploaded file to the store. */
function addButton(query, { server }) {
  const mine = sessionFiles.get(query.upload);
  if (!mine || server.readOnly) return "";
  return el("p", {}, el("button", { type: "button", on: { click: async () => {
    const [id] = await addToStore([mine.file]);
    if (id) go(href("texture", id));
  } } }, "Add this file to the store…"));
}

function drawHits(list, hits, { query, tray, pick }) {
  const farthest = hits.at(-1)?.distance || 1;
  // Tags that all hits share are not shown.
  const shared = new Set(Object.entries(hits[0]?.tags ?? {}).filter(([key, value]) => hits.length > 1 && hits.every((hit) => hit.tags[key] === value)).map(([key]) => key));
  const distinct = (tags) => Object.fromEntries(Object.entries(tags).filter(([key]) => !shared.has(key)));
  list.replaceChildren(...hits.map((hit, at) => {
    const mark = el("input", { type: "checkbox", checked: tray.ids.has(hit.id), "aria-label": `Mark ${hit.name} as an example`, on: { change: () => pick(hit.id) } });
    const base = query.ids.length === 1 ? query.ids[0] : query.block?.id ?? null;
    return el("li", { class: tray.ids.has(hit.id) ? "hit marked" : "hit", data: { id: hit.id } },
      el("a", { class: "hit-sheet", href: href("texture", hit.id), "aria-label": `${hit.name}, rank ${hit.rank}, distance ${distance(hit.distance)}` }, contactSheet(hit, { eager: at < 20, small: true })),
      el("div", { class: "hit-line" }, el("label", { class: "rank", title: "Mark as an example" }, mark, el("span", {}, hit.rank)), el("a", { class: "hit-name", href: href("texture", hit.id), tabindex: "-1", "aria-hidden": "true", title: hit.name }, shortenedName(hit.name)), el("span", { class: "edge" }, distance(hit.distance))),
      el("div", { class: "distance-bar", "aria-hidden": "true" }, el("i", { style: { width: `${(100 * hit.distance) / farthest}%` } })),
      el("div", { class: "hit-more" }, tagLine(distinct(hit.tags), 2),
        el("span", { class: "hit-actions" }, el("a", { href: href("query", null, { ids: hit.id, space: query.space, k: query.k === 30 ? null : query.k }), title: "Find textures similar to this one", "aria-label": `similar: find textures similar to ${hit.name}` }, "similar"),
          base && base !== hit.id ? el("a", { href: href("compare", null, { a: base, b: hit.id, space: query.space }), title: "Compare with the query", "aria-label": `compare ${hit.name} with the query` }, "compare") : null)));
  }));
}

function markCards(list, ids) {
  for (const card of list.children) {
    const on = ids.has(Number(card.dataset.id));
    card.classList.toggle("marked", on);
    card.querySelector("input[type=checkbox]").checked = on;
  }
}

/** The view without a query: how to query, and some textures to start from. */
async function showStart(root, { signal, server }) {
  const some = el("ul", { class: "plain some" }), kinds = el("span", {}, "or click to choose one");
  api.formats().then((formats) => { kinds.textContent = `or click to choose one: ${formats}`; }).catch(() => { /* the button works without the list */ });
  root.append(el("div", { class: "query-start" },
    el("h1", { "data-start": "", tabindex: "-1" }, "Which textures look like yours?"),
    el("button", { type: "button", class: "drop-here", on: { click: () => document.getElementById("open-file").click() } },
      el("b", {}, "Drop a volume anywhere on this page"), kinds, el("span", { class: "soft" }, "It is compared with the store, and stored only if you add it.")),
    el("p", {}, "Or start from a texture of the store:"), some));
  await server.ready;
  const total = server.textures ?? 0;
  if (total === 0) { some.replaceWith(el("p", { class: "soft" }, "The store is empty.")); return; }
  // Evenly spaced over the store, so that all kinds are likely to appear.
  const want = Math.min(total, 12);
  const answers = await Promise.allSettled(Array.from({ length: want }, (_, at) => api.textures({ offset: Math.floor((at * total) / want), limit: 1 }, signal)));
  some.append(...answers.filter((one) => one.status === "fulfilled" && one.value.textures.length).map(({ value }) => value.textures[0]).map((entry) =>
    el("li", {}, el("a", { href: href("query", null, { ids: entry.id }), title: `${entry.name}, ${shape(entry.shape)}` }, el("span", { class: "box" }, thumbnail(entry, 192)), shortenedName(entry.name)))));
}
