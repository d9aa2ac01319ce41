// The tags of a texture, with an editor if the server is not read-only.
import * as api from "../api.js";
import { el, uniqueId } from "../dom.js";
import { href } from "../route.js";
import { reportError, announce } from "../messages.js";

/** The first tags in one line. */
export function tagLine(tags, most = 3) {
  const entries = Object.entries(tags ?? {});
  return el("span", { class: "tag-line" }, ...entries.slice(0, most).map(([key, value]) => el("span", { class: "tag", title: `${key} = ${value}` }, value)),
    entries.length > most && el("span", { class: "soft" }, `+${entries.length - most}`));
}

/** All tags of `texture`, with an editor unless `readOnly`. */
export function tagEditor(texture, readOnly) {
  const list = el("dl", { class: "tags" }), box = el("div", {}, list);
  const draw = () => {
    const entries = Object.entries(texture.tags);
    list.replaceChildren(...entries.map(([key, value]) => el("div", { class: "pair" }, el("dt", {}, key),
      el("dd", {}, el("a", { href: href("browse", null, { where: `${key}=${value}` }), title: "All textures with this tag" }, value === "" ? "(empty)" : value),
        !readOnly && el("button", { type: "button", class: "quiet icon", "aria-label": `Remove the tag ${key}`, on: { click: () => drop(key) } }, "×")))));
    if (entries.length === 0) list.replaceChildren(el("div", { class: "soft" }, "No tags."));
  };
  async function drop(key) {
    try {
      await api.removeTag(texture.id, key);
      delete texture.tags[key];
      draw();
      announce(`Tag ${key} removed.`);
      keyInput.focus();
    } catch (error) { reportError(error); }
  }
  async function add(event) {
    event.preventDefault();
    const key = keyInput.value.trim(), value = valueInput.value.trim();
    if (!key) { keyInput.focus(); return; }
    try {
      await api.setTags(texture.id, { [key]: value });
      texture.tags[key] = value;
      draw();
      keyInput.value = valueInput.value = "";
      keyInput.focus();
      announce(`Tag ${key} = ${value} set.`);
    } catch (error) { reportError(error); }
  }
  const ids = [uniqueId("key"), uniqueId("value")];
  const keyInput = el("input", { id: ids[0], type: "text", size: 8, autocomplete: "off", placeholder: "key" });
  const valueInput = el("input", { id: ids[1], type: "text", size: 10, autocomplete: "off", placeholder: "value" });
  if (!readOnly) {
    box.append(el("form", { class: "add-tag", on: { submit: add } }, el("label", { class: "visually-hidden", for: ids[0] }, "Key of a new tag"), keyInput, el("span", { "aria-hidden": "true" }, "="),
      el("label", { class: "visually-hidden", for: ids[1] }, "Its value"), valueInput, el("button", { type: "submit" }, "Set")));
  }
  draw();
  return box;
}
