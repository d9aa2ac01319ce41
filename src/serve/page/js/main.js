// Starts the page: which view the address asks for, files dropped anywhere, shortcuts.
import * as api from "./api.js";
import { takesKeys } from "./dom.js";
import { acceptFiles } from "./files.js";
import { go, href, parse } from "./route.js";
import { failed, failure, say } from "./tell.js";
import { themeButton } from "./theme.js";

// Each view is fetched when it is first shown; the others follow when there is nothing else to do.
const VIEWS = {
  browse: () => import("./views/browse.js"), texture: () => import("./views/texture.js"), query: () => import("./views/query.js"),
  compare: () => import("./views/compare.js"), map: () => import("./views/map.js"), statistics: () => import("./views/statistics.js"),
};
// Which entry of the navigation a view belongs to.
const UNDER = { texture: "browse", compare: "query" };

const main = document.getElementById("main");
let shown = null;

/** What views know of the server, once it is `ready`: `readOnly`, `ingestFolder`, `textures`, `version`. */
const server = { readOnly: true, ingestFolder: false, textures: null, version: "", ready: null };

async function readHealth() {
  const told = await api.health();
  Object.assign(server, { readOnly: told.read_only, ingestFolder: told.ingest_folder, textures: told.textures, version: told.version });
  document.getElementById("server-mode").textContent = told.read_only ? "read only" : "";
  document.documentElement.dataset.readOnly = String(told.read_only);
}

/** Shows what the address says. A view that is shown already may take the change itself (`reroute`). */
async function showRoute(event) {
  const route = parse();
  if (shown?.route.view === route.view && shown.route.arg === route.arg && shown.hold?.reroute?.(route)) {
    shown.route = route;
    return;
  }
  shown?.life.abort();
  shown?.hold?.leave?.();
  const life = new AbortController();
  const mine = (shown = { route, life, hold: null });
  for (const link of document.querySelectorAll("#nav a")) {
    const here = link.dataset.view === (UNDER[route.view] ?? route.view);
    if (here) link.setAttribute("aria-current", "page"); else link.removeAttribute("aria-current");
  }
  document.body.dataset.view = route.view;
  main.replaceChildren();
  main.scrollTop = 0;
  main.setAttribute("aria-busy", "true");
  if (!Object.hasOwn(VIEWS, route.view)) {
    main.append(failure(new api.Problem(404, `This page has no view called “${route.view}”.`)));
    main.removeAttribute("aria-busy");
    return;
  }
  try {
    // A view that cannot be fetched has a reason that the server can name better than the browser.
    const view = await VIEWS[route.view]().catch(async (error) => { await api.health(); throw error; });
    if (mine !== shown) return;
    document.title = `${view.title(route)} – hlacdb`;
    const hold = await view.show(main, route, { signal: life.signal, server, renew: readHealth });
    if (mine !== shown) { hold?.leave?.(); return; }
    mine.hold = hold;
    // After a step through the page the reader starts at the new view's heading; on the first load, at the top.
    if (event) {
      say(document.title);
      if (!main.contains(document.activeElement)) (main.querySelector("[data-start]") ?? main).focus({ preventScroll: true });
    }
  } catch (error) {
    if (mine !== shown || error.name === "AbortError") return;
    if (error.name !== "Problem") console.error(error);
    main.replaceChildren(failure(error, () => { shown = null; showRoute(); }));
  } finally {
    if (mine === shown) main.removeAttribute("aria-busy");
  }
}

function shortcuts(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
  if (event.key === "Escape" && event.target.closest?.("#search")) { main.querySelector("[role=grid] a[tabindex='0']")?.focus(); return; }
  if (takesKeys(event.target)) return;
  if (event.key === "/") {
    event.preventDefault();
    const field = document.getElementById("search");
    if (field) field.focus(); else { go(href("browse")); requestAnimationFrame(() => document.getElementById("search")?.focus()); }
  } else if (event.key === "o") {
    document.getElementById("open-file").click();
  } else if (event.key === "Escape" && !document.querySelector("dialog[open]")) {
    shown?.hold?.escape?.();
  }
}

themeButton(document.getElementById("theme"));
acceptFiles(server);
addEventListener("route", showRoute);
addEventListener("popstate", showRoute);
// A link to the present address asks for it anew, too (after an upload has gone, for one).
addEventListener("keydown", shortcuts);
document.getElementById("skip").addEventListener("click", (event) => { event.preventDefault(); main.focus(); });
// Another process may write to the store: what is shown stays as it is, and the wall offers the rest.
setInterval(async () => {
  if (document.hidden) return;
  const before = server.textures;
  try { await readHealth(); } catch { return; }
  if (before !== null && server.textures !== before) dispatchEvent(new Event("grown"));
}, 15000);
// The first view need not wait to know whether the store may be written to.
server.ready = readHealth().catch(failed);
showRoute().then(() => {
  const idle = globalThis.requestIdleCallback ?? ((run) => setTimeout(run, 500));
  idle(() => Promise.all(Object.values(VIEWS).map((load) => load())).catch(() => { /* asked for again when shown */ }));
});
