// Files: dropped anywhere on the page, pasted, or opened. One file is a question; several may go into the store.
import * as api from "./api.js";
import { el, freshId } from "./dom.js";
import { counted } from "./format.js";
import { go, href, parse } from "./route.js";
import { failed, toast } from "./tell.js";

/** Files of this session by the token of their upload, so that they can be added to the store later; and the answers
 * that came with them, so that the query view need not ask again. */
export const held = new Map();

/** Asks for textures like a file, and goes to the answer. */
export async function askByFile(file) {
  const done = toast(`Reading ${file.name}…`, { stay: true });
  document.documentElement.dataset.busy = "";
  try {
    const here = parse();
    const kept = here.view === "query" ? here.params : new URLSearchParams();
    const k = Number(kept.get("k")) || 30, space = kept.get("space") ?? undefined;
    const answer = await api.queryFile(file, { k, space, where: kept.getAll("where") });
    const { token } = answer.upload;
    held.set(token, { file, answer, upload: answer.upload });
    go(href("query", null, { upload: token, k: kept.get("k"), space, where: kept.getAll("where") }));
  } catch (error) {
    failed(error);
  } finally {
    delete document.documentElement.dataset.busy;
    done();
  }
}

/** Adds files to the store after asking for tags. Resolves to the new ids. */
export function addToStore(files) {
  return new Promise((resolve) => {
    const id = freshId("tags");
    const tags = el("input", { id, type: "text", placeholder: "rock=ketton, project=cores", autocomplete: "off" });
    const go = el("button", { type: "submit", class: "main" }, "Add");
    const dialog = el("dialog", { class: "dialog", "aria-labelledby": `${id}-title` },
      el("form", { method: "dialog", on: { submit: (event) => { event.preventDefault(); run(); } } },
        el("h2", { id: `${id}-title` }, `Add ${counted(files.length, "file")} to the store`),
        el("ul", { class: "plain files" }, ...files.slice(0, 8).map((file) => el("li", {}, file.name)),
          files.length > 8 && el("li", {}, `and ${counted(files.length - 8, "other")}`)),
        el("label", { for: id }, "Tags for all of them, as key=value (may be left empty)"), tags,
        el("p", { class: "buttons" }, el("button", { type: "button", on: { click: () => dialog.close() } }, "Cancel"), go)));
    let ids = [];
    async function run() {
      go.disabled = true;
      try {
        const answer = await api.addFiles(files, parseTags(tags.value));
        ids = answer.ids;
        const parts = [answer.added && `${counted(answer.added, "texture")} added`, answer.duplicates && `${counted(answer.duplicates, "texture")} there already`];
        if (parts.some(Boolean)) toast(`${parts.filter(Boolean).join(", ")}.`, { action: ids.length ? { text: "Show", run: () => (location.hash = href("texture", ids[0])) } : null, stay: true });
        for (const bad of answer.failed) toast(`${bad.path}: ${bad.error}`, { bad: true });
        dialog.close();
      } catch (error) {
        failed(error);
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
    if (mark < 1) throw new api.Problem(0, `“${part}” is no tag: a tag is written key=value.`);
    tags[part.slice(0, mark).trim()] = part.slice(mark + 1).trim();
  }
  return tags;
}

async function take(files, server) {
  if (files.length === 0) return;
  // An empty store has nothing to find: there a file can only be its first texture.
  if (files.length === 1 && (server.textures !== 0 || server.readOnly)) { await askByFile(files[0]); return; }
  if (server.readOnly) { toast("This server is read only: drop one file to find textures like it.", { bad: true }); return; }
  await addToStore(files);
  dispatchEvent(new Event("store"));
}

/** Listens for files. */
export function acceptFiles(server) {
  const veil = document.getElementById("veil"), input = document.getElementById("file-input");
  const carries = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  let depth = 0;
  const hide = () => { depth = 0; veil.hidden = true; };
  addEventListener("dragenter", (event) => { if (carries(event)) { depth += 1; veil.hidden = false; } });
  addEventListener("dragleave", (event) => { if (carries(event)) { depth -= 1; if (depth <= 0) hide(); } });
  addEventListener("dragover", (event) => { if (carries(event)) { event.preventDefault(); event.dataTransfer.dropEffect = "copy"; } });
  addEventListener("drop", (event) => {
    if (!carries(event)) return;
    event.preventDefault();
    hide();
    take([...event.dataTransfer.files], server);
  });
  addEventListener("paste", (event) => { if (event.clipboardData?.files.length) take([...event.clipboardData.files], server); });
  document.getElementById("open-file").addEventListener("click", () => input.click());
  input.addEventListener("change", () => { const files = [...input.files]; input.value = ""; take(files, server); });
}
