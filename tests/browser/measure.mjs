// Measures the page: `node measure.mjs STORE [STORE_OF_100000]`. No test depends on it.
import { launch, open, serve } from "./harness.mjs";

const [store, large] = process.argv.slice(2);
if (!store) throw new Error("node measure.mjs STORE [STORE_OF_100000]");
const browser = await launch();
const median = (times) => times.sort((a, b) => a - b)[times.length >> 1];
const report = (name, times) => console.log(`${name}: median ${median(times).toFixed(0)} ms of ${times.map((time) => time.toFixed(0)).join(", ")}`);

/** Times from the start of `hlacdb serve` to a usable grid and to one with its pictures. The browser is already running. */
async function start(file) {
  const { page, close } = await open(browser, "about:blank");
  const begun = performance.now();
  const server = await serve(file, "--read-only");
  const listening = performance.now() - begun;
  await page.goto(server.url, { waitUntil: "commit" });
  await page.waitForFunction(() => document.querySelector(".grid a[href]"), null, { polling: "raf" });
  const interactive = performance.now() - begun;
  await page.waitForFunction(() => [...document.querySelectorAll(".grid .cell:not([hidden]) .box")].filter((box) => box.getBoundingClientRect().top < innerHeight).every((box) => box.querySelector(".no-voxels") || box.querySelector("img")?.complete) && document.querySelector(".grid .box > *"), null, { polling: "raf" });
  const usable = performance.now() - begun;
  await close();
  return { server, listening, interactive, usable };
}

/** Times from the click on “Find similar” to the hits and to the slices of all visible hits. */
async function click(page) {
  await page.locator(".texture-head .button.main").waitFor();
  await page.waitForLoadState("networkidle");
  await page.waitForFunction(() => { const canvas = document.querySelector("canvas.volume"); return !canvas || canvas.dataset.drawn === "yes"; });
  return page.evaluate(() => new Promise((resolve) => {
    const begun = performance.now();
    document.querySelector(".texture-head .button.main").click();
    let hits = 0;
    const look = () => {
      const cards = [...document.querySelectorAll(".hit")];
      if (cards.length && !hits) hits = performance.now() - begun;
      const seen = cards.filter((card) => card.getBoundingClientRect().top < innerHeight);
      if (seen.length && seen.every((card) => { const image = card.querySelector("img"); return image?.complete && image.naturalWidth > 0; })) requestAnimationFrame(() => resolve({ hits, slices: performance.now() - begun, seen: seen.length }));
      else requestAnimationFrame(look);
    };
    look();
  }));
}

const runs = [];
for (let n = 0; n < 5; n += 1) {
  const { server, ...times } = await start(store);
  runs.push(times);
  await server.stop();
}
report("serve listens after", runs.map((run) => run.listening));
report("from serve to a usable grid", runs.map((run) => run.interactive));
report("from serve to a grid with all visible pictures", runs.map((run) => run.usable));

const { server } = await start(store), clicks = [];
for (const id of [3, 101, 222, 333, 444]) {
  const { page, close } = await open(browser, `${server.url}#/texture/${id}`);
  clicks.push(await click(page));
  await close();
}
report("click to hits", clicks.map((one) => one.hits));
report(`click to the slices of ${clicks[0].seen} visible hits`, clicks.map((one) => one.slices));
const queries = [];
for (let id = 1; id <= 101; id += 1) {
  const begun = performance.now();
  const answer = await fetch(`${server.url}api/v1/query`, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify({ ids: [id], k: 30 }) });
  await answer.json();
  queries.push(performance.now() - begun);
}
console.log(`a query by id over HTTP, seen from node: median ${median(queries).toFixed(2)} ms of 101`);
await server.stop();

if (large) {
  const { server, usable } = await start(large);
  console.log(`the large store: from serve to a grid ${usable.toFixed(0)} ms`);
  const { page, errors, close } = await open(browser, server.url, { width: 1440, height: 900 });
  await page.locator(".grid .box > *").first().waitFor();
  await page.evaluate(() => { globalThis.long = []; new PerformanceObserver((list) => globalThis.long.push(...list.getEntries().map((entry) => entry.duration))).observe({ type: "longtask", buffered: false }); });
  const frames = await page.evaluate(() => new Promise((resolve) => {
    // Scrolls steadily for four seconds, then jumps through the whole grid.
    const grid = document.querySelector(".grid"), gaps = [], begun = performance.now();
    let last = begun, jumps = 0;
    const step = (now) => {
      gaps.push(now - last);
      last = now;
      if (now - begun < 4000) grid.scrollTop += 60;
      else if (jumps < 120) { jumps += 1; grid.scrollTop = ((jumps * 0.618) % 1) * grid.scrollHeight; }
      else { resolve(gaps); return; }
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }));
  await page.waitForTimeout(1000);
  const long = await page.evaluate(() => globalThis.long);
  frames.sort((a, b) => a - b);
  console.log(`scrolling 100000: ${frames.length} frames, median ${median(frames).toFixed(0)} ms, 99th of 100 ${frames[Math.floor(frames.length * 0.99)].toFixed(0)} ms, long tasks (> 50 ms): ${long.length}${long.length ? `, the longest ${Math.max(...long).toFixed(0)} ms` : ""}; errors ${errors.length}`);
  await page.goto(`${server.url}#/map`);
  await page.locator("canvas.map").waitFor();
  await page.waitForLoadState("networkidle");
  const draws = await page.evaluate(async () => {
    const times = [], canvas = document.querySelector("canvas.map");
    canvas.focus();
    for (let n = 0; n < 20; n += 1) {
      await new Promise((next) => requestAnimationFrame(next));
      const begun = performance.now();
      canvas.dispatchEvent(new KeyboardEvent("keydown", { key: n % 2 ? "ArrowLeft" : "ArrowRight" }));
      await new Promise((next) => requestAnimationFrame(() => setTimeout(next)));
      times.push(performance.now() - begun);
    }
    return times;
  });
  report("a move of the map of the large store", draws);
  await close();
  await server.stop();
}
await browser.close();
