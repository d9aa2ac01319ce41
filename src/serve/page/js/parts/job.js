// A long job of the server: its progress as it comes, and a way to stop it.
import * as api from "../api.js";
import { el } from "../dom.js";
import { count } from "../format.js";
import { failed, say, toast } from "../tell.js";

const NAMES = { reindex: "Fitting the spaces", ingest: "Adding volumes" };

/** `finished()` is called when a job is done. */
export function jobPanel(signal, finished) {
  const element = el("div", { class: "job", hidden: true });
  let events = null;

  function draw(job) {
    const open = job.total > 0, name = NAMES[job.kind] ?? job.kind;
    element.hidden = false;
    element.replaceChildren(el("p", {}, el("b", {}, name), " ", job.message ?? ""),
      el("progress", { "aria-label": name, ...(open ? { max: job.total } : {}), ...(open ? { value: job.done } : {}) }),
      el("p", { class: "edge" }, open ? `${count(job.done)} of ${count(job.total)}` : "at work"),
      el("button", { type: "button", class: "quiet", on: { click: () => api.cancelJob(job.id).catch(failed) } }, "Stop"));
  }

  function end(job) {
    events?.close();
    events = null;
    element.hidden = true;
    const name = NAMES[job.kind] ?? job.kind;
    if (job.state === "failed") toast(`${name}: ${job.error ?? job.message ?? "failed"}`, { bad: true });
    else if (job.state === "cancelled") toast(`${name} was stopped.`);
    else { toast(job.message || `${name}: done.`, { stay: (job.message ?? "").length > 60 }); say(`${name}: done.`); }
    finished(job);
  }

  function follow(job) {
    draw(job);
    events?.close();
    events = new EventSource(api.eventsOf(job.id));
    events.addEventListener("progress", (event) => draw(JSON.parse(event.data)));
    events.addEventListener("end", (event) => end(JSON.parse(event.data)));
    // The browser connects again by itself; a job that is no longer known is over.
    events.addEventListener("error", () => { if (events?.readyState === EventSource.CLOSED) { element.hidden = true; events = null; } });
  }

  return {
    element,
    async start(kind, body) {
      try { follow(await api.startJob(kind, body)); } catch (error) { failed(error); }
    },
    /** Takes up a job that was running before the page came. */
    async resume() {
      try {
        const told = await api.jobs(signal);
        const running = (told.jobs ?? told).find((job) => job.state === "running");
        if (running) follow(running);
      } catch { /* a server without jobs */ }
    },
    leave() { events?.close(); },
  };
}
