// The state of the page is in its address: `#/texture/12?form=sphere&axis=y`. `go` adds an entry to the history,
// `replaceParams` changes the current one.
import { append } from "./params.js";

/** Parses an address into view, argument and parameters. */
export function parse(hash = location.hash) {
  const text = hash.replace(/^#\/?/, "");
  const mark = text.indexOf("?");
  const path = (mark < 0 ? text : text.slice(0, mark)).split("/").filter(Boolean).map(decode);
  return { view: path[0] ?? "browse", arg: path[1] ?? null, params: new URLSearchParams(mark < 0 ? "" : text.slice(mark + 1)) };
}

function decode(text) {
  try { return decodeURIComponent(text); } catch { return text; }
}

/** The address of a state. `params`: a URLSearchParams, or an object for `append`. */
export function href(view, arg = null, params = {}) {
  const query = params instanceof URLSearchParams ? params : append(new URLSearchParams(), params);
  const path = view === "browse" ? "" : view + (arg === null ? "" : `/${encodeURIComponent(arg)}`);
  // Commas and colons are legal in a fragment and easier to read than %2C and %3A.
  const text = query.toString().replaceAll("%2C", ",").replaceAll("%3A", ":");
  return `#/${path}${text ? `?${text}` : ""}`;
}

/** Shows another state, with a new entry in the history. */
export function go(address) {
  if (location.hash === address) return;
  history.pushState(null, "", address);
  dispatchEvent(new Event("route"));
}

/** Changes parameters of the current address without a new entry in the history and without showing anything. */
export function replaceParams(changes) {
  const route = parse();
  for (const key of Object.keys(changes)) route.params.delete(key);
  append(route.params, changes);
  const address = href(route.view, route.arg, route.params);
  if (address !== location.hash) history.replaceState(null, "", address);
  return route.params;
}
