// A question and its answer: the query on the left, the hits in their order on the right.
import * as api from "../api.js";
import { el, named } from "../dom.js";
import { counted, count, distance, shape, time } from "../format.js";
import { addToStore, held } from "../files.js";
import { go, href, tune } from "../route.js";
import { failed, instead, say, sentence } from "../tell.js";
import { sheet, place } from "../parts/picture.js";
import { tagLine } from "../parts/tags.js";
import { Tray } from "../parts/tray.js";
import { body, choices, readQuestion, showAsked, write } from "./question.js";

export const title = (route) => (readQuestion(route.params) ? "Alike" : "Query");

export async function show(root, route, life) {
  const question = readQuestion(route.params);
  if (!question) { await invite(root, life); return null; }
  const { signal } = life;
  const asked = el("div", { class: "asked" }, el("p", { class: "soft" }, "…"));
  const summary = el("p", { class: "summary edge" });
  const heading = el("h1", { class: "hits-title", "data-start": "", tabindex: "-1" }, "Alike");
  const hint = el("p", { class: "soft hint", hidden: true }, "Tick several to search by all of them, or two to see them side by side.");
  const list = el("ol", { class: "hits" });
  const problem = el("div", {});
  const pick = (id) => tray.toggle(id);
  const tray = new Tray(route.params, (ids) => markCards(list, ids), () => question.space);
  const controls = el("div", {});
  const side = el("aside", { class: "query-side", "aria-label": "The query" }, asked, controls);
  root.append(el("div", { class: "query" }, side, el("section", { class: "query-hits", "aria-label": "Hits" }, el("div", { class: "section-head" }, heading, summary), hint, problem, list, tray.element)));

  // Asked before anything else: what the page waits for is the answer.
  let known = held.get(question.upload)?.upload ?? null, turn = 0;
  async function ask(primed = null) {
    const mine = ++turn;
    list.setAttribute("aria-busy", "true");
    try {
      const answer = primed ?? await api.query(body(question), signal);
      if (mine !== turn) return;
      known = answer.upload ?? known;
      problem.replaceChildren();
      showAnswer(answer);
      return answer;
    } catch (error) {
      if (mine !== turn || error.name === "AbortError") return;
      list.replaceChildren();
      heading.textContent = "No answer";
      summary.textContent = "";
      problem.replaceChildren(el("div", { role: "alert" }, question.upload && error.status === 404
        ? instead("The file is no longer held", "The server keeps the last few files it was asked about. Drop this one again, or add it to the store to keep it.")
        : instead("The question could not be answered", sentence(error))));
    } finally {
      if (mine === turn) list.removeAttribute("aria-busy");
    }
  }
  function showAnswer(answer) {
    const n = answer.hits.length;
    heading.textContent = n === 0 ? "Nothing alike" : `${count(n)} alike`;
    summary.textContent = `${answer.space}, epoch ${answer.epoch} · ${answer.index} · ${time(answer.elapsed_us)}`;
    summary.title = "space · index · time of the search at the server";
    hint.hidden = n < 2;
    drawHits(list, answer.hits, { question, tray, pick });
    if (n === 0) problem.replaceChildren(instead("Nothing alike", question.within || question.where.length ? "No texture is within these limits. Widen them under “Narrow it”." : "There is no other texture in the store to compare with."));
    say(n === 0 ? "No texture is alike." : `${counted(n, "texture")} alike. The nearest is ${answer.hits[0].name}, at distance ${distance(answer.hits[0].distance)}.`);
  }
  const primed = held.get(question.upload)?.answer;
  const same = primed && primed.hits.length === Math.min(question.k, primed.hits.length) && !question.within && (question.space ?? primed.space) === primed.space;
  if (primed) delete held.get(question.upload).answer;
  const answered = ask(same ? primed : null);
  const change = (changes) => {
    Object.assign(question, changes);
    tune(write(question));
    tray.draw();
    ask();
  };
  Promise.all([api.spaces(), life.server.ready]).then(([spaces]) => controls.replaceChildren(choices(question, spaces, change), more(question, life))).catch(failed);
  await answered;
  showAsked(asked, question, known, signal).catch((error) => { if (error.name !== "AbortError") asked.replaceChildren(el("p", { class: "soft" }, sentence(error))); });
  return { escape() { if (tray.ids.size > 0) tray.clear(); } };
}

/** What can be done with the query itself. */
function more(question, { server }) {
  const mine = held.get(question.upload);
  if (!mine || server.readOnly) return "";
  return el("p", {}, el("button", { type: "button", on: { click: async () => {
    const [id] = await addToStore([mine.file]);
    if (id) go(href("texture", id));
  } } }, "Add this file to the store…"));
}

function drawHits(list, hits, { question, tray, pick }) {
  const farthest = hits.at(-1)?.distance || 1;
  // A tag that all hits have says nothing about any of them.
  const shared = new Set(Object.entries(hits[0]?.tags ?? {}).filter(([key, value]) => hits.length > 1 && hits.every((hit) => hit.tags[key] === value)).map(([key]) => key));
  const own = (tags) => Object.fromEntries(Object.entries(tags).filter(([key]) => !shared.has(key)));
  list.replaceChildren(...hits.map((hit, at) => {
    const mark = el("input", { type: "checkbox", checked: tray.ids.has(hit.id), "aria-label": `Mark ${hit.name} as an example`, on: { change: () => pick(hit.id) } });
    const base = question.ids.length === 1 ? question.ids[0] : question.block?.id ?? null;
    return el("li", { class: tray.ids.has(hit.id) ? "hit marked" : "hit", data: { id: hit.id } },
      el("a", { class: "hit-sheet", href: href("texture", hit.id), "aria-label": `${hit.name}, rank ${hit.rank}, distance ${distance(hit.distance)}` }, sheet(hit, { eager: at < 20, small: true })),
      el("div", { class: "hit-line" }, el("label", { class: "rank", title: "Mark as an example" }, mark, el("span", {}, hit.rank)), el("a", { class: "hit-name", href: href("texture", hit.id), tabindex: "-1", "aria-hidden": "true", title: hit.name }, named(hit.name)), el("span", { class: "edge" }, distance(hit.distance))),
      el("div", { class: "far", "aria-hidden": "true" }, el("i", { style: { width: `${(100 * hit.distance) / farthest}%` } })),
      el("div", { class: "hit-more" }, tagLine(own(hit.tags), 2),
        el("span", { class: "hit-actions" }, el("a", { href: href("query", null, { ids: hit.id, space: question.space, k: question.k === 30 ? null : question.k }), title: "Find textures like this one", "aria-label": `alike: find textures like ${hit.name}` }, "alike"),
          base && base !== hit.id ? el("a", { href: href("compare", null, { a: base, b: hit.id, space: question.space }), title: "Side by side with the query", "aria-label": `compare ${hit.name} with the query` }, "compare") : null)));
  }));
}

function markCards(list, ids) {
  for (const card of list.children) {
    const on = ids.has(Number(card.dataset.id));
    card.classList.toggle("marked", on);
    card.querySelector("input[type=checkbox]").checked = on;
  }
}

/** The view before anything is asked: how to ask, and some textures to ask by. */
async function invite(root, { signal, server }) {
  const some = el("ul", { class: "plain some" });
  root.append(el("div", { class: "invite" },
    el("h1", { "data-start": "", tabindex: "-1" }, "Which textures look like yours?"),
    el("button", { type: "button", class: "drop-here", on: { click: () => document.getElementById("open-file").click() } },
      el("b", {}, "Drop a volume anywhere on this page"), el("span", {}, "or press to choose one: .npy, .nrrd, .nii, .mha, .tif, .vox"), el("span", { class: "soft" }, "It is compared, and not kept unless you add it.")),
    el("p", {}, "Or ask by a texture of the store:"), some));
  await server.ready;
  const total = server.textures ?? 0;
  if (total === 0) { some.replaceWith(el("p", { class: "soft" }, "The store has none yet.")); return; }
  // Evenly spread over the store, so that its kinds are all likely to be there.
  const want = Math.min(total, 12);
  const answers = await Promise.allSettled(Array.from({ length: want }, (_, at) => api.textures({ offset: Math.floor((at * total) / want), limit: 1 }, signal)));
  some.append(...answers.filter((one) => one.status === "fulfilled" && one.value.textures.length).map(({ value }) => value.textures[0]).map((entry) =>
    el("li", {}, el("a", { href: href("query", null, { ids: entry.id }), title: `${entry.name}, ${shape(entry.shape)}` }, el("span", { class: "box" }, place(entry, 192)), named(entry.name)))));
}
