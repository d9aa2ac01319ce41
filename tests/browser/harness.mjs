// What every test needs: a store, a real `hlacdb serve` on a free loopback port, a real Chromium, and its console errors.
import { execFileSync, spawn } from "node:child_process";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { createInterface } from "node:readline";
import { fileURLToPath } from "node:url";
import { chromium } from "playwright-core";

export const here = path.dirname(fileURLToPath(import.meta.url));
const root = path.resolve(here, "../..");

/** The program under test: $HLACDB_BIN, else the newest build of this source tree. */
export function binary() {
  if (process.env.HLACDB_BIN) return process.env.HLACDB_BIN;
  const built = ["debug", "release"].map((kind) => path.join(root, "target", kind, "hlacdb")).filter((file) => fs.existsSync(file));
  if (built.length === 0) throw new Error("there is no hlacdb to test: run cargo build, or name one with HLACDB_BIN");
  return built.sort((a, b) => fs.statSync(b).mtimeMs - fs.statSync(a).mtimeMs)[0];
}

/** The path of Chromium: $CHROMIUM, else the usual places; null if there is none. */
export function browserPath() {
  const places = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"];
  return places.find((place) => place && fs.existsSync(place)) ?? null;
}

/** A temporary folder that is removed after the tests. */
export function folder() {
  const made = fs.mkdtempSync(path.join(os.tmpdir(), "hlacdb-page-"));
  process.on("exit", () => fs.rmSync(made, { recursive: true, force: true }));
  return made;
}

/** Runs hlacdb on a store. */
export const hlacdb = (store, ...words) => execFileSync(binary(), ["-q", "-s", store, ...words], { encoding: "utf8" });

/** A store with the 60 textures of the recipe. */
export function synthesise(store, recipe = path.join(here, "recipe.toml")) {
  hlacdb(store, "synth", recipe);
  return store;
}

/** Starts `hlacdb serve`; resolves to {url, stop}. */
export async function serve(store, ...words) {
  const child = spawn(binary(), ["-q", "-s", store, "--json", "serve", "--addr", "127.0.0.1:0", ...words], { stdio: ["ignore", "pipe", "pipe"], env: { ...process.env, HLACDB_PAGE_DIR: process.env.HLACDB_PAGE_DIR ?? path.join(root, "src/serve/page") } });
  let errorOutput = "";
  child.stderr.on("data", (text) => { errorOutput += text; });
  const gone = new Promise((resolve) => child.once("exit", resolve));
  const url = await new Promise((resolve, reject) => {
    createInterface({ input: child.stdout }).once("line", (line) => { try { resolve(JSON.parse(line).url); } catch (error) { reject(error); } });
    gone.then((code) => reject(new Error(`hlacdb serve ended with ${code}: ${errorOutput}`)));
  });
  return { url, stop: async () => { child.kill("SIGTERM"); await gone; } };
}

// Without a graphics card, WebGL is drawn by software.
const SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];

export const launch = (args = SOFTWARE) => chromium.launch({ executablePath: browserPath(), args });

/** Opens a page of its own. Its console errors are collected in `errors`. */
export async function open(browser, url, { width = 1280, height = 860, expected = [], ...options } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, ...options });
  const page = await context.newPage(), errors = [];
  page.on("console", (message) => { if (message.type() === "error" && !expected.some((one) => message.text().includes(one) || message.location().url.includes(one))) errors.push(`${message.text()} (${message.location().url})`); });
  page.on("pageerror", (error) => errors.push(error.stack ?? String(error)));
  await page.goto(url);
  return { page, errors, close: () => context.close() };
}

/** A volume as the bytes of a .npy file: `value(z, y, x)` from 0 to 255. */
export function npy(side, value) {
  const header = `{'descr': '|u1', 'fortran_order': False, 'shape': (${side}, ${side}, ${side}), }`;
  const padded = header.padEnd(128 - 10 - 1) + "\n";
  const bytes = Buffer.alloc(128 + side ** 3);
  bytes.write("\x93NUMPY\x01\x00", 0, "latin1");
  bytes.writeUInt16LE(padded.length, 8);
  bytes.write(padded, 10, "latin1");
  let at = 128;
  for (let z = 0; z < side; z += 1) for (let y = 0; y < side; y += 1) for (let x = 0; x < side; x += 1) bytes[at++] = value(z, y, x);
  return bytes;
}

/** Drops files onto the page, as a hand would: [{name, bytes}]. */
export async function drop(page, files) {
  const transfer = await page.evaluateHandle((files) => {
    const transfer = new DataTransfer();
    for (const { name, base64 } of files) transfer.items.add(new File([Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0))], name));
    return transfer;
  }, files.map(({ name, bytes }) => ({ name, base64: Buffer.from(bytes).toString("base64") })));
  for (const event of ["dragenter", "dragover", "drop"]) await page.dispatchEvent("main", event, { dataTransfer: transfer });
}

/**
 * The pixels of a canvas: `hash` changes when any of them does, `lit` counts those that are not empty (of 96 x 96), `coarse`
 * has the means of eight by eight parts.
 */
export const pixels = (page, selector) => page.locator(selector).evaluate((canvas) => {
  const copy = document.createElement("canvas");
  copy.width = 96;
  copy.height = 96;
  const context = copy.getContext("2d");
  context.drawImage(canvas, 0, 0, 96, 96);
  const { data } = context.getImageData(0, 0, 96, 96);
  let hash = 0, lit = 0;
  const coarse = Array(64).fill(0);
  for (let at = 0; at < data.length; at += 4) {
    hash = (Math.imul(hash, 31) + data[at] + 7 * data[at + 3]) | 0;
    if (data[at + 3] > 0) lit += 1;
    const pixel = at / 4;
    coarse[8 * Math.floor(pixel / 96 / 12) + Math.floor((pixel % 96) / 12)] += data[at + 3] > 0 ? data[at] / 144 : 0;
  }
  return { hash, lit, coarse };
});

/** The largest difference between the parts of two pictures, out of 255. */
export const apart = (a, b) => Math.max(...a.coarse.map((value, at) => Math.abs(value - b.coarse[at])));

/** Waits until the full volume is drawn. */
export const drawn = (page) => page.waitForSelector("canvas.volume[data-drawn=yes]", { timeout: 30000 });
