// The progress of a job of the server, with a button to cancel it.
import * as api from "../api.js";
import { el } from "../dom.js";
import { count } from "../format.js";
import { reportError, announce, toast } from "../messages.js";

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
      el("p", { class: "edge" }, open ? `${count(job.done)} of ${count(job.total)}` : "running"),
      el("button", { type: "button", class: "quiet", on: { click: () => api.cancelJob(job.id).catch(reportError) } }, "Cancel"));
  }

  function end(job) {
    events?.close();
    events = null;
    element.hidden = true;
    const name = NAMES[job.kind] ?? job.kind;
    if (job.state === "failed") toast(`${name}: ${job.error ?? job.message ?? "failed"}`, { bad: true });
    else if (job.state === "cancelled") toast(`${name}: cancelled.`);
    else { toast(job.message || `${name}: done.`, { stay: (job.message ?? "").length > 60 }); announce(`${name}: done.`); }
    finished(job);
  }

  function follow(job) {
    draw(job);
    events?.close();
    events = new EventSource(api.jobEvents(job.id));
    events.addEventListener("progress", (event) => draw(JSON.parse(event.data)));
    events.addEventListener("end", (event) => end(JSON.parse(event.data)));
    // The browser reconnects by itself. If the server no longer knows the job, it has ended.
    events.addEventListener("error", () => { if (events?.readyState === EventSource.CLOSED) { element.hidden = true; events = null; } });
  }

  return {
    element,
    async start(kind, body) {
      try { follow(await api.startJob(kind, body)); } catch (error) { reportError(error); }
    },
    /** Follows a job that was started before the page was loaded. */
    async resume() {
      try {
        const { jobs } = await api.jobs(signal);
        const running = jobs.find((job) => job.state === "running");
        if (running) follow(running);
      } catch { /* the jobs cannot be read: there is nothing to follow */ }
    },
    leave() { events?.close(); },
  };
}
