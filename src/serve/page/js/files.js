// Files that are dropped on the page, pasted or opened. One file starts a query; several can be added to the store.
import * as api from "./api.js";
import { el, uniqueId } from "./dom.js";
import { counted } from "./format.js";
import { go, href, parse } from "./route.js";
import { reportError, toast } from "./messages.js";

/** The files of this session by the token of their upload, so that they can be added to the store later, with the answers
 * to their queries, so that the query view need not repeat them. */
export const sessionFiles = new Map();

/** Finds textures similar to a file and shows them. */
export async function queryByFile(file) {
  const done = toast(`Reading ${file.name}…`, { stay: true });
  document.documentElement.dataset.busy = "";
  try {
    const current = parse();
    const params = current.view === "query" ? current.params : new URLSearchParams();
    const k = Number(params.get("k")) || 30, space = params.get("space") ?? undefined;
    const answer = await api.queryFile(file, { k, space, where: params.getAll("where") });
    const { token } = answer.upload;
    sessionFiles.set(token, { file, answer, upload: answer.upload });
    go(href("query", null, { upload: token, k: params.get("k"), space, where: params.getAll("where") }));
  } catch (error) {
    reportError(error);
  } finally {
    delete document.documentElement.dataset.busy;
    done();
  }
}

/** Asks for tags, then adds files to the store. Resolves to their ids. */
export function addToStore(files) {
  return new Promise((resolve) => {
    const id = uniqueId("tags");
    const tags = el("input", { id, type: "text", placeholder: "rock=ketton, project=cores", autocomplete: "off" });
    const go = el("button", { type: "submit", class: "main" }, "Add");
    const dialog = el("dialog", { class: "dialog", "aria-labelledby": `${id}-title` },
      el("form", { method: "dialog", on: { submit: (event) => { event.preventDefault(); run(); } } },
        el("h2", { id: `${id}-title` }, `Add ${counted(files.length, "file")} to the store`),
        el("ul", { class: "plain files" }, ...files.slice(0, 8).map((file) => el("li", {}, file.name)),
          files.length > 8 && el("li", {}, `and ${counted(files.length - 8, "other")}`)),
        el("label", { for: id }, "Tags for all of them as key=value (optional)"), tags,
        el("p", { class: "buttons" }, el("button", { type: "button", on: { click: () => dialog.close() } }, "Cancel"), go)));
    let ids = [];
    async function run() {
      go.disabled = true;
      try {
        const answer = await api.addFiles(files, parseTags(tags.value));
        ids = answer.ids;
        const parts = [answer.added && `${counted(answer.added, "texture")} added`, answer.duplicates && `${counted(answer.duplicates, "texture")} already in the store`];
        if (parts.some(Boolean)) toast(`${parts.filter(Boolean).join(", ")}.`, { action: ids.length ? { text: "Show", run: () => (location.hash = href("texture", ids[0])) } : null, stay: true });
        for (const bad of answer.failed) toast(`${bad.path}: ${bad.error}`, { bad: true });
        dialog.close();
      } catch (error) {
        reportError(error);
        go.disabled = false;
      }
    }
    dialog.addEventListener("close", () => { dialog.remove(); resolve(ids); });
    document.body.append(dialog);
    dialog.showModal();
  });
}

/** `a=b, c=d` → {a: "b", c: "d"} */
export function parseTags(text) {
  const tags = {};
  for (const part of text.split(/[,;\n]/).map((part) => part.trim()).filter(Boolean)) {
    const mark = part.indexOf("=");
    if (mark < 1) throw new api.Problem(0, `“${part}” is not a tag. Write tags as key=value.`);
    tags[part.slice(0, mark).trim()] = part.slice(mark + 1).trim();
  }
  return tags;
}

async function handleFiles(files, server) {
  if (files.length === 0) return;
  // An empty store has nothing to find, so a file is added to it.
  if (files.length === 1 && (server.textures !== 0 || server.readOnly)) { await queryByFile(files[0]); return; }
  if (server.readOnly) { toast("This server is read-only: drop one file to find similar textures.", { bad: true }); return; }
  await addToStore(files);
  dispatchEvent(new Event("files-added"));
}

/** Handles files that are dropped, pasted or chosen. */
export function acceptFiles(server) {
  const overlay = document.getElementById("drop-overlay"), input = document.getElementById("file-input");
  const hasFiles = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  let depth = 0;
  const hide = () => { depth = 0; overlay.hidden = true; };
  addEventListener("dragenter", (event) => { if (hasFiles(event)) { depth += 1; overlay.hidden = false; } });
  addEventListener("dragleave", (event) => { if (hasFiles(event)) { depth -= 1; if (depth <= 0) hide(); } });
  addEventListener("dragover", (event) => { if (hasFiles(event)) { event.preventDefault(); event.dataTransfer.dropEffect = "copy"; } });
  addEventListener("drop", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    hide();
    handleFiles([...event.dataTransfer.files], server);
  });
  addEventListener("paste", (event) => { if (event.clipboardData?.files.length) handleFiles([...event.clipboardData.files], server); });
  document.getElementById("open-file").addEventListener("click", () => input.click());
  input.addEventListener("change", () => { const files = [...input.files]; input.value = ""; handleFiles(files, server); });
}
