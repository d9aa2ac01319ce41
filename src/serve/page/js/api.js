// The JSON API. Every failure becomes a Problem with the sentence of the server.

import { append } from "./params.js";

const ROOT = "api/v1/";

/** A failed request: `status` (0 if the server was not reached), `message`, `causes`. */
export class Problem extends Error {
  constructor(status, message, causes = []) {
    super(message);
    this.name = "Problem";
    this.status = status;
    this.causes = causes;
  }
}

async function toProblem(response) {
  const plain = `The server answered ${response.status} ${response.statusText}`.trim() + ".";
  try {
    const { detail, title, causes } = await response.json();
    return new Problem(response.status, detail || title || plain, causes ?? []);
  } catch {
    return new Problem(response.status, plain);
  }
}

/** Sends a request. Resolves to a Response with a status of success. */
export async function request(path, options = {}) {
  let response;
  try {
    response = await fetch(ROOT + path, { credentials: "same-origin", ...options });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Problem(0, "The server cannot be reached. Is hlacdb serve still running?");
  }
  if (!response.ok) throw await toProblem(response);
  return response;
}

const json = async (path, options) => {
  const response = await request(path, options);
  return response.status === 204 ? null : response.json();
};
const send = (method, path, body, signal) =>
  json(path, { method, signal, body: JSON.stringify(body), headers: { "content-type": "application/json" } });

/** An object as a query string. */
export function search(params) {
  const text = append(new URLSearchParams(), params).toString();
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
export const removeTag = (id, key) => json(`textures/${id}/tags/${encodeURIComponent(key)}`, { method: "DELETE" });
export const remove = (id) => json(`textures/${id}`, { method: "DELETE" });
export const startJob = (kind, body = {}) => send("POST", `jobs/${kind}`, body);
export const cancelJob = (id) => json(`jobs/${id}`, { method: "DELETE" });
export const query = (body, signal) => send("POST", "query", body, signal);

/** The extensions of the file formats that can be read, as one text; fetched once. */
let cachedFormats = null;
export const formats = () => (cachedFormats ??= json("formats").then(
  ({ formats }) => formats.map(({ extensions }) => extensions[0]).filter(Boolean).join(", "),
  (error) => { cachedFormats = null; throw error; }));

/** The spaces of the store, fetched once. */
let cachedSpaces = null;
export const spaces = () => (cachedSpaces ??= json("spaces").catch((error) => { cachedSpaces = null; throw error; }));
export const clearSpaces = () => { cachedSpaces = null; };

/** A query by a file. The server keeps the file as an upload. */
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

/** The path of a texture `{id}` or an upload `{token}`. */
const pathOf = (what) => (what.token ? `uploads/${encodeURIComponent(what.token)}` : `textures/${what.id}`);
export const thumbnail = (what, size) => `${ROOT}${pathOf(what)}/thumbnail.png?size=${size}`;
export const sheet = (what, options) => `${ROOT}${pathOf(what)}/slices.png${search(options)}`;
export const slice = (what, axis, index) => `${ROOT}${pathOf(what)}/slice.png?axis=${axis}&index=${index}`;
export const voxelsPath = (what, edge) => `${pathOf(what)}/voxels?edge=${edge}`;
export const jobEvents = (job) => `${ROOT}jobs/${job}/events`;
