// The address is the state: `#/texture/12?form=sphere&axis=y`. Views read a Route and write parameters back;
// `go` makes a new entry in the history, `tune` rewrites the current one.

/** What the address says: the view, its argument and its parameters. */
export function parse(hash = location.hash) {
  const text = hash.replace(/^#\/?/, "");
  const mark = text.indexOf("?");
  const path = (mark < 0 ? text : text.slice(0, mark)).split("/").filter(Boolean).map(decode);
  return { view: path[0] ?? "browse", arg: path[1] ?? null, params: new URLSearchParams(mark < 0 ? "" : text.slice(mark + 1)) };
}

function decode(text) {
  try { return decodeURIComponent(text); } catch { return text; }
}

/** The address of a state. `params`: a URLSearchParams or an object; empty and undefined values are left out, arrays repeat. */
export function href(view, arg = null, params = {}) {
  const query = params instanceof URLSearchParams ? params : new URLSearchParams();
  if (query !== params) {
    for (const [key, value] of Object.entries(params)) {
      for (const one of Array.isArray(value) ? value : [value]) {
        if (one !== undefined && one !== null && one !== "") query.append(key, one);
      }
    }
  }
  const path = view === "browse" ? "" : view + (arg === null ? "" : `/${encodeURIComponent(arg)}`);
  // Commas and colons are legal in a fragment and much easier to read than %2C.
  const text = query.toString().replaceAll("%2C", ",").replaceAll("%3A", ":");
  return `#/${path}${text ? `?${text}` : ""}`;
}

/** Goes to a state, with a new entry in the history. */
export function go(address) {
  if (location.hash === address) return;
  history.pushState(null, "", address);
  dispatchEvent(new Event("route"));
}

/** Rewrites the address of the present state: nothing is shown anew, back leads to where it led before. */
export function tune(changes) {
  const route = parse();
  for (const [key, value] of Object.entries(changes)) {
    route.params.delete(key);
    for (const one of Array.isArray(value) ? value : [value]) {
      if (one !== undefined && one !== null && one !== "") route.params.append(key, one);
    }
  }
  const address = href(route.view, route.arg, route.params);
  if (address !== location.hash) history.replaceState(null, "", address);
  return route.params;
}
