// The tags of one texture: shown, and changed where the server lets one.
import * as api from "../api.js";
import { el, freshId } from "../dom.js";
import { href } from "../route.js";
import { failed, say } from "../tell.js";

/** A few tags in a line, for cards. */
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
        !readOnly && el("button", { type: "button", class: "quiet icon", "aria-label": `Take away the tag ${key}`, on: { click: () => drop(key) } }, "×")))));
    if (entries.length === 0) list.replaceChildren(el("div", { class: "soft" }, "No tags."));
  };
  async function drop(key) {
    try {
      await api.dropTag(texture.id, key);
      delete texture.tags[key];
      draw();
      say(`Tag ${key} taken away.`);
      key_.focus();
    } catch (error) { failed(error); }
  }
  async function add(event) {
    event.preventDefault();
    const key = key_.value.trim(), value = value_.value.trim();
    if (!key) { key_.focus(); return; }
    try {
      await api.setTags(texture.id, { [key]: value });
      texture.tags[key] = value;
      draw();
      key_.value = value_.value = "";
      key_.focus();
      say(`Tag ${key} = ${value} set.`);
    } catch (error) { failed(error); }
  }
  const ids = [freshId("key"), freshId("value")];
  const key_ = el("input", { id: ids[0], type: "text", size: 8, autocomplete: "off", placeholder: "key" });
  const value_ = el("input", { id: ids[1], type: "text", size: 10, autocomplete: "off", placeholder: "value" });
  if (!readOnly) {
    box.append(el("form", { class: "add-tag", on: { submit: add } }, el("label", { class: "unseen", for: ids[0] }, "Key of a new tag"), key_, el("span", { "aria-hidden": "true" }, "="),
      el("label", { class: "unseen", for: ids[1] }, "Its value"), value_, el("button", { type: "submit" }, "Set")));
  }
  draw();
  return box;
}
