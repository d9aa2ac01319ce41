// Messages: to screen readers (a live region), as toasts, and in place of a view that cannot be shown.
import { el } from "./dom.js";

/** Announces a sentence to screen readers. */
export function announce(text) {
  const live = document.getElementById("live");
  live.textContent = "";
  // Screen readers do not repeat an equal text that is set at once after clearing it.
  setTimeout(() => { live.textContent = text; }, 30);
}

/** A message that disappears by itself unless it is an error (`bad`) or is to stay. `action`: {text, run}. Returns a function that closes it. */
export function toast(text, { bad = false, action = null, stay = bad } = {}) {
  const close = () => note.remove();
  const note = el("div", { class: bad ? "toast bad" : "toast", role: bad ? "alert" : null },
    el("p", {}, text),
    action && el("button", { type: "button", on: { click: () => { close(); action.run(); } } }, action.text),
    el("button", { type: "button", class: "quiet icon", "aria-label": "Dismiss", on: { click: close } }, "×"));
  document.getElementById("toasts").append(note);
  if (!bad) announce(text);
  if (!stay) setTimeout(close, 6000);
  return close;
}

/** Shows an error as a toast. Aborted requests are ignored. */
export function reportError(error) {
  if (error.name === "AbortError") return;
  if (error.name !== "Problem") console.error(error);
  toast(errorText(error), { bad: true });
}

/** The text of an error, causes included. */
export const errorText = (error) =>
  error.name === "Problem" ? [error.message, ...(error.causes ?? [])].join(" – ") : `Internal error of the page: ${error.message}`;

/** Stands in for empty content: a heading, sentences, actions. */
export function emptyState(title, ...rest) {
  return el("section", { class: "empty-state" }, el("h2", {}, title), ...rest.map((part) => (typeof part === "string" ? el("p", {}, part) : part)));
}

/** An error in place of a view. */
export function errorView(error, retry) {
  const missing = error.status === 404, locked = error.status === 401;
  return el("section", { class: "empty-state", role: "alert" },
    el("h1", { tabindex: "-1", "data-start": "" }, locked ? "This server requires a token" : missing ? "Not found" : "This view cannot be shown"),
    el("p", {}, locked ? "Open the address that hlacdb serve printed, followed by ?token=…" : errorText(error)),
    el("p", {}, retry && !locked && el("button", { type: "button", on: { click: retry } }, "Try again"), " ", el("a", { href: "#/" }, "All textures")));
}
