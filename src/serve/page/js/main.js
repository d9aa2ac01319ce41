// Starts the page: shows the view of the address, accepts files, handles shortcuts.
import * as api from "./api.js";
import { acceptsKeys } from "./dom.js";
import { acceptFiles } from "./files.js";
import { go, href, parse } from "./route.js";
import { reportError, errorView, announce } from "./messages.js";
import { themeButton } from "./theme.js";

// Each view is loaded when it is first shown, the others when the browser is idle.
const VIEWS = {
  browse: () => import("./views/browse.js"), texture: () => import("./views/texture.js"), query: () => import("./views/query.js"),
  compare: () => import("./views/compare.js"), map: () => import("./views/map.js"), statistics: () => import("./views/statistics.js"),
};
// The navigation entry of views that have none of their own.
const PARENT = { texture: "browse", compare: "query" };

const main = document.getElementById("main");
let shown = null;

/** The state of the server, known once `ready` resolves: `readOnly`, `ingestFolder`, `textures`, `version`. */
const server = { readOnly: true, ingestFolder: false, textures: null, version: "", ready: null };

async function readHealth() {
  const health = await api.health();
  Object.assign(server, { readOnly: health.read_only, ingestFolder: health.ingest_folder, textures: health.textures, version: health.version });
  document.getElementById("server-mode").textContent = health.read_only ? "read-only" : "";
  document.documentElement.dataset.readOnly = String(health.read_only);
}

/** Shows the view of the address. The current view may handle the change itself (`reroute`). */
async function showRoute(event) {
  const route = parse();
  if (shown?.route.view === route.view && shown.route.arg === route.arg && shown.handle?.reroute?.(route)) {
    shown.route = route;
    return;
  }
  shown?.life.abort();
  shown?.handle?.leave?.();
  const life = new AbortController();
  const mine = (shown = { route, life, handle: null });
  for (const link of document.querySelectorAll("#nav a")) {
    const current = link.dataset.view === (PARENT[route.view] ?? route.view);
    if (current) link.setAttribute("aria-current", "page"); else link.removeAttribute("aria-current");
  }
  document.body.dataset.view = route.view;
  main.replaceChildren();
  main.scrollTop = 0;
  main.setAttribute("aria-busy", "true");
  if (!Object.hasOwn(VIEWS, route.view)) {
    main.append(errorView(new api.Problem(404, `This page has no view called “${route.view}”.`)));
    main.removeAttribute("aria-busy");
    return;
  }
  try {
    // If a view cannot be loaded, the API gives a better reason than the browser.
    const view = await VIEWS[route.view]().catch(async (error) => { await api.health(); throw error; });
    if (mine !== shown) return;
    document.title = `${view.title(route)} – hlacdb`;
    const handle = await view.show(main, route, { signal: life.signal, server, readHealth });
    if (mine !== shown) { handle?.leave?.(); return; }
    mine.handle = handle;
    // After a navigation the focus moves to the heading of the new view; on the first load it stays at the top.
    if (event) {
      announce(document.title);
      if (!main.contains(document.activeElement)) (main.querySelector("[data-start]") ?? main).focus({ preventScroll: true });
    }
  } catch (error) {
    if (mine !== shown || error.name === "AbortError") return;
    if (error.name !== "Problem") console.error(error);
    main.replaceChildren(errorView(error, () => { shown = null; showRoute(); }));
  } finally {
    if (mine === shown) main.removeAttribute("aria-busy");
  }
}

function shortcuts(event) {
  if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
  if (event.key === "Escape" && event.target.closest?.("#search")) { main.querySelector("[role=grid] a[tabindex='0']")?.focus(); return; }
  if (acceptsKeys(event.target)) return;
  if (event.key === "/") {
    event.preventDefault();
    const field = document.getElementById("search");
    if (field) field.focus(); else { go(href("browse")); requestAnimationFrame(() => document.getElementById("search")?.focus()); }
  } else if (event.key === "o") {
    document.getElementById("open-file").click();
  } else if (event.key === "Escape" && !document.querySelector("dialog[open]")) {
    shown?.handle?.escape?.();
  }
}

themeButton(document.getElementById("theme"));
acceptFiles(server);
addEventListener("route", showRoute);
addEventListener("popstate", showRoute);
addEventListener("keydown", shortcuts);
document.getElementById("skip").addEventListener("click", (event) => { event.preventDefault(); main.focus(); });
// Another process may write to the store. The page does not change by itself, but offers to show the changes.
setInterval(async () => {
  if (document.hidden) return;
  const before = server.textures;
  try { await readHealth(); } catch { return; }
  if (before !== null && server.textures !== before) dispatchEvent(new Event("store-changed"));
}, 15000);
// The first view does not wait for the state of the server.
server.ready = readHealth().catch(reportError);
showRoute().then(() => {
  const idle = globalThis.requestIdleCallback ?? ((run) => setTimeout(run, 500));
  idle(() => Promise.all(Object.values(VIEWS).map((load) => load())).catch(() => { /* loaded again when shown */ }));
});
