// What the page says: to screen readers (a live region), in passing (toasts), and in place of what cannot be shown.
import { el } from "./dom.js";

/** Says a sentence to screen readers. */
export function say(text) {
  const live = document.getElementById("live");
  live.textContent = "";
  // A region that is emptied and filled in one turn is not read again when the words are the same.
  setTimeout(() => { live.textContent = text; }, 30);
}

/** A message that goes by itself, unless it is an error. `action`: {text, run}. */
export function toast(text, { bad = false, action = null, stay = bad } = {}) {
  const close = () => note.remove();
  const note = el("div", { class: bad ? "toast bad" : "toast", role: bad ? "alert" : null },
    el("p", {}, text),
    action && el("button", { type: "button", on: { click: () => { close(); action.run(); } } }, action.text),
    el("button", { type: "button", class: "quiet icon", "aria-label": "Dismiss", on: { click: close } }, "×"));
  document.getElementById("toasts").append(note);
  if (!bad) say(text);
  if (!stay) setTimeout(close, 6000);
  return close;
}

/** Tells of a failure; aborted requests are no failures. */
export function failed(error) {
  if (error.name === "AbortError") return;
  if (error.name !== "Problem") console.error(error);
  toast(sentence(error), { bad: true });
}

/** A failure in words, causes included. */
export const sentence = (error) =>
  error.name === "Problem" ? [error.message, ...(error.causes ?? [])].join(" – ") : `Something on this page went wrong: ${error.message}`;

/** What stands where there is nothing to see: a heading, sentences, actions. */
export function instead(title, ...rest) {
  return el("section", { class: "instead" }, el("h2", {}, title), ...rest.map((part) => (typeof part === "string" ? el("p", {}, part) : part)));
}

/** A failure in place of a view. */
export function failure(error, retry) {
  const gone = error.status === 404, locked = error.status === 401;
  return el("section", { class: "instead", role: "alert" },
    el("h1", { tabindex: "-1", "data-start": "" }, locked ? "This server asks for its token" : gone ? "There is nothing here" : "This could not be shown"),
    el("p", {}, locked ? "Open the address that hlacdb serve printed, with ?token=… at its end." : sentence(error)),
    el("p", {}, retry && !locked && el("button", { type: "button", on: { click: retry } }, "Try again"), " ", el("a", { href: "#/" }, "To the wall of textures")));
}
