// The JSON API. Every failure becomes a Problem, whose message is the sentence of the server's library.

const ROOT = "api/v1/";

/** A request that failed: `status` (0: the server was not reached), `message`, `causes`. */
export class Problem extends Error {
  constructor(status, message, causes = []) {
    super(message);
    this.name = "Problem";
    this.status = status;
    this.causes = causes;
  }
}

async function problemOf(response) {
  const plain = `The server answered ${response.status} ${response.statusText}`.trim() + ".";
  try {
    const told = await response.json();
    return new Problem(response.status, told.detail || told.title || plain, told.causes ?? []);
  } catch {
    return new Problem(response.status, plain);
  }
}

/** A request; resolves to a Response that is ok. */
export async function ask(path, options = {}) {
  let response;
  try {
    response = await fetch(ROOT + path, { credentials: "same-origin", ...options });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Problem(0, "The server cannot be reached. Is hlacdb serve still running?");
  }
  if (!response.ok) throw await problemOf(response);
  return response;
}

const json = async (path, options) => {
  const response = await ask(path, options);
  return response.status === 204 ? null : response.json();
};
const send = (method, path, body, signal) =>
  json(path, { method, signal, body: JSON.stringify(body), headers: { "content-type": "application/json" } });

/** `key=value` pairs and lists as a query string. */
export function search(params) {
  const query = new URLSearchParams();
  for (const [key, value] of Object.entries(params)) {
    for (const one of Array.isArray(value) ? value : [value]) {
      if (one !== undefined && one !== null && one !== "") query.append(key, one);
    }
  }
  const text = query.toString();
  return text ? `?${text}` : "";
}

export const health = (signal) => json("health", { signal });
export const textures = (params, signal) => json(`textures${search(params)}`, { signal });
export const texture = (id, signal) => json(`textures/${id}`, { signal });
export const tags = (signal) => json("tags", { signal });
export const descriptor = (id, view, signal) => json(`textures/${id}/descriptor${search({ view })}`, { signal });
export const statistics = (signal) => json("statistics", { signal });
export const explain = (a, b, space, signal) => json(`explain${search({ a, b, space })}`, { signal });
export const map = (space, tag, signal) => json(`map${search({ space, tag })}`, { signal });
export const jobs = (signal) => json("jobs", { signal });
export const setTags = (id, changes) => send("PUT", `textures/${id}/tags`, changes);
export const dropTag = (id, key) => json(`textures/${id}/tags/${encodeURIComponent(key)}`, { method: "DELETE" });
export const remove = (id) => json(`textures/${id}`, { method: "DELETE" });
export const startJob = (kind, body = {}) => send("POST", `jobs/${kind}`, body);
export const cancelJob = (id) => json(`jobs/${id}`, { method: "DELETE" });
export const query = (question, signal) => send("POST", "query", question, signal);

/** The spaces of the store; asked for once. */
let known = null;
export const spaces = () => (known ??= json("spaces").catch((error) => { known = null; throw error; }));
export const forgetSpaces = () => { known = null; };

/** A query by a file: it is kept by the server as an upload. */
export function queryFile(file, options, signal) {
  const form = new FormData();
  form.append("options", JSON.stringify(options));
  form.append("file", file, file.name);
  return json("query", { method: "POST", body: form, signal });
}

/** Adds files to the store, with tags. */
export function addFiles(files, tags) {
  const form = new FormData();
  for (const [key, value] of Object.entries(tags)) form.append("tag", `${key}=${value}`);
  for (const file of files) form.append("file", file, file.name);
  return json("textures", { method: "POST", body: form });
}

/** Where a texture or an upload is: `{id}` or `{token}`. */
const place = (what) => (what.token ? `uploads/${encodeURIComponent(what.token)}` : `textures/${what.id}`);
export const thumbnail = (what, size) => `${ROOT}${place(what)}/thumbnail.png?size=${size}`;
export const sheet = (what, options) => `${ROOT}${place(what)}/slices.png${search(options)}`;
export const slice = (what, axis, index) => `${ROOT}${place(what)}/slice.png?axis=${axis}&index=${index}`;
export const voxelsPath = (what, edge) => `${place(what)}/voxels?edge=${edge}`;
export const eventsOf = (job) => `${ROOT}jobs/${job}/events`;
