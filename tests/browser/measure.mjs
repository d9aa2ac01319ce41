// Times of the page, for people: `node measure.mjs STORE [STORE_OF_100000]`. No test depends on them.
import { launch, open, serve } from "./harness.mjs";

const [store, large] = process.argv.slice(2);
if (!store) throw new Error("node measure.mjs STORE [STORE_OF_100000]");
const browser = await launch();
const median = (times) => times.sort((a, b) => a - b)[times.length >> 1];
const told = (name, times) => console.log(`${name}: median ${median(times).toFixed(0)} ms of ${times.map((time) => time.toFixed(0)).join(", ")}`);

/** From `hlacdb serve` to a wall that can be used, and to one with its pictures. The browser is running already. */
async function start(file) {
  const { page, close } = await open(browser, "about:blank");
  const begun = performance.now();
  const server = await serve(file, "--read-only");
  const listening = performance.now() - begun;
  await page.goto(server.url, { waitUntil: "commit" });
  await page.waitForFunction(() => document.querySelector(".wall a[href]"), null, { polling: "raf" });
  const walked = performance.now() - begun;
  await page.waitForFunction(() => [...document.querySelectorAll(".wall .cell:not([hidden]) .box")].filter((box) => box.getBoundingClientRect().top < innerHeight).every((box) => box.querySelector(".no-voxels") || box.querySelector("img")?.complete) && document.querySelector(".wall .box > *"), null, { polling: "raf" });
  const usable = performance.now() - begun;
  await close();
  return { server, listening, walked, usable };
}

/** From the click on “Find alike” to the slices of all hits in the window. */
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
told("serve listens after", runs.map((run) => run.listening));
told("serve to a wall one can walk, search and open", runs.map((run) => run.walked));
told("serve to a wall with all pictures in sight", runs.map((run) => run.usable));

const { server } = await start(store), clicks = [];
for (const id of [3, 101, 222, 333, 444]) {
  const { page, close } = await open(browser, `${server.url}#/texture/${id}`);
  clicks.push(await click(page));
  await close();
}
told("click to hits", clicks.map((one) => one.hits));
told(`click to the slices of ${clicks[0].seen} hits in sight`, clicks.map((one) => one.slices));
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
  console.log(`the large store: serve to a wall ${usable.toFixed(0)} ms`);
  const { page, errors, close } = await open(browser, server.url, { width: 1440, height: 900 });
  await page.locator(".wall .box > *").first().waitFor();
  await page.evaluate(() => { globalThis.long = []; new PerformanceObserver((list) => globalThis.long.push(...list.getEntries().map((entry) => entry.duration))).observe({ type: "longtask", buffered: false }); });
  const frames = await page.evaluate(() => new Promise((resolve) => {
    // Steadily for four seconds, then in jumps through the whole wall.
    const wall = document.querySelector(".wall"), gaps = [], begun = performance.now();
    let last = begun, jumps = 0;
    const step = (now) => {
      gaps.push(now - last);
      last = now;
      if (now - begun < 4000) wall.scrollTop += 60;
      else if (jumps < 120) { jumps += 1; wall.scrollTop = ((jumps * 0.618) % 1) * wall.scrollHeight; }
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
  told("a move of the map of all of them", draws);
  await close();
  await server.stop();
}
await browser.close();
